"""Coherent layers: which formula they take, that all agree, and the tmm package."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.optics import coherent, film, interface, response
from pellicle.optics.pair import Pair, to_complex

AMBIENT, SUBSTRATE, ANGLE = 1.3, Pair(np.array([1.7, 4.0]), np.array([0.0, 0.1])), 0.7
POWERS = (response.reflectance, response.reflectance_below, response.transmittance)
few_layers = jax.jit(coherent.few_layers, static_argnames="propagating")
stack = jax.jit(coherent.stack)


def amplitudes(responses):
    return [np.asarray(to_complex(x)) for r in responses for x in (r.reflected, r.below, r.denominator)]


@pytest.mark.parametrize("propagating", [False, True])
def test_one_smooth_layer_takes_the_closed_form(propagating):
    layer, phase = np.array([2.1, 1.9]), np.array([0.3, 5.0])
    result = coherent.responses(AMBIENT, [layer], SUBSTRATE, [phase], ANGLE, propagating=propagating)
    expected = film.film(AMBIENT, layer, SUBSTRATE, phase, ANGLE, propagating=propagating)
    np.testing.assert_array_equal(amplitudes(result), amplitudes(expected))


@pytest.mark.parametrize("propagating", [False, True])
@pytest.mark.parametrize("angle", [None, ANGLE])
@pytest.mark.parametrize("count", [1, 3])
def test_few_layers_agree_with_the_loop(count, angle, propagating):
    layers, phases = [2.1, Pair(1.5, 0.2), 1.4][:count], [0.3, 1.0, 2.0][:count]
    few = few_layers(AMBIENT, layers, SUBSTRATE, phases, angle, propagating=propagating)
    for one, many in zip(few, stack(AMBIENT, layers, SUBSTRATE, phases, angle), strict=True):
        for power in POWERS:
            np.testing.assert_allclose(power(one), power(many), rtol=1e-13)
        for name in ("reflected", "below"):
            r, expected = (to_complex(getattr(x, name)) / to_complex(x.denominator) for x in (one, many))
            np.testing.assert_allclose(r, expected, rtol=1e-13)


def test_no_layer_is_the_bare_interface():
    a, q0 = interface.transverse(AMBIENT, ANGLE)
    for result, letter in zip(coherent.responses(AMBIENT, [], SUBSTRATE, [], ANGLE), "sp", strict=True):
        face = (AMBIENT, q0, SUBSTRATE, interface.normal(SUBSTRATE, a), letter)
        np.testing.assert_allclose(response.reflectance(result), interface.reflectance(*face), atol=1e-15)
        np.testing.assert_allclose(response.transmittance(result), interface.transmittance(*face), rtol=1e-14)


WAVELENGTH = 550.0


def random_stack(rng: np.random.Generator, count: int):
    index = [complex(rng.uniform(0.1, 4), rng.choice([0.0, rng.uniform(0, 3)])) for _ in range(count)]
    substrate = complex(rng.uniform(1, 4), rng.choice([0.0, rng.uniform(0, 2)]))
    return index, rng.uniform(0, 400, count).tolist(), substrate, rng.uniform(0, 1.5)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_agrees_with_tmm(count):
    rng = np.random.default_rng(count)
    run = jax.jit(lambda n, d, n2, theta: coherent.stack(1.0, list(n), n2, list(d), theta))
    for _ in range(20):
        index, depth, substrate, theta = random_stack(rng, count)
        phases = 2 * np.pi / WAVELENGTH * np.array(depth)
        responses = run(jnp.array(index), phases, jnp.asarray(substrate), theta)
        for result, letter in zip(responses, "sp", strict=True):
            truth = tmm.coh_tmm(letter, [1.0, *index, substrate], [np.inf, *depth, np.inf], theta, WAVELENGTH)
            assert complex(result.reflected / result.denominator) == pytest.approx(truth["r"], abs=1e-13)
            assert float(response.reflectance(result)) == pytest.approx(truth["R"], abs=1e-13)
            assert float(response.transmittance(result)) == pytest.approx(truth["T"], rel=1e-11, abs=1e-14)


def test_a_thickness_is_required_for_each_layer(refuses):
    refuses(ValueError, "one for each of 2 layers", pl.reflectance, WAVELENGTH, [100.0], [1.46, 2.3], 1.5)


@pytest.mark.parametrize(("layers", "rough", "most"), [(5, False, 900), (2, True, 2100)])
def test_a_stack_is_a_program_of_few_operations(layers, rough, most):
    """705 and 1736; 1277 and 2780 where each loop computes roots and the elements of matrices again."""
    nm = np.linspace(400.0, 900.0, 64)
    faces = [2 * np.pi / nm * 3.0] + [0.0] * layers if rough else None
    media, angle = [1.5 + 0.01j * i for i in range(layers)], 1.0 if rough else None

    def reflectance(thickness):
        phases = [2 * jnp.pi / nm * x for x in thickness]
        around = 1.0 + 0.0 * nm, media, 3.9 + 0.02j + 0.0 * nm
        return response.reflectance(*coherent.responses(*around, phases, angle, roughness=faces))

    with jax.enable_x64(True):
        compiled = jax.jit(reflectance).lower(np.full(layers, 50.0)).compile()
    # its text also has the frames of the caller
    assert str(compiled.as_text()).count(" = ") < most
