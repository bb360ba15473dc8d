"""Absorptance of layers and field in depth, against the `tmm` package and by conservation of energy."""

from functools import cache, partial

import jax
import numpy as np
import pytest
import tmm

import pellicle as pl

RNG = np.random.default_rng(18)
COUNT, LAYERS = 60, 3
INDEX = RNG.uniform(1.2, 4, (LAYERS, COUNT)) + 1j * RNG.choice([0.0, 1e-6, 1e-3, 0.3, 3.0], (LAYERS, COUNT))
THICKNESS = RNG.uniform(0, 500, (LAYERS, COUNT))
SUBSTRATE = RNG.uniform(0.2, 4, COUNT) + 1j * RNG.choice([0.0, 0.02, 4.0], COUNT)
AMBIENT = RNG.choice([1.0, 1.33, 1.52], COUNT)
ANGLE = RNG.uniform(0, 89, COUNT)
WAVELENGTH = RNG.uniform(300, 1100, COUNT)
DEPTH = RNG.uniform(-300, np.sum(THICKNESS, axis=0) + 300, (4, COUNT))


def media(i=slice(None)):
    """Arguments of one random stack, or of all of them, without polarisation."""
    film = (WAVELENGTH[i], THICKNESS[:, i], list(INDEX[:, i]), SUBSTRATE[i])
    return film, {"ambient": AMBIENT[i], "angle": ANGLE[i]}


@cache
@partial(jax.jit, static_argnums=0)
def computed(polarisation):
    """Absorptance, field, R and T of all stacks for s, p or unpolarised light."""
    film, light = media()
    light = light | {"polarisation": polarisation}
    powers = (f(*film, **light) for f in (pl.absorptance, pl.reflectance, pl.transmittance))
    return (*powers, pl.field(*film, DEPTH, **light))


def reference(i, letter):
    film, light = media(i)
    indices, thickness = [light["ambient"], *film[2], film[3]], [np.inf, *film[1], np.inf]
    return tmm.coh_tmm(letter, indices, thickness, np.deg2rad(light["angle"]), film[0])


@pytest.mark.slow
@pytest.mark.parametrize("letter", "sp")
def test_random_stacks_as_tmm(letter):
    absorbed, R, _, field = computed(letter)
    assert absorbed.shape == (LAYERS, COUNT)
    assert field.electric.shape == field.magnetic.shape == (3, 4, COUNT)
    for i in range(COUNT):
        exact = reference(i, letter)
        assert R[i] == pytest.approx(exact["R"], abs=1e-12)
        np.testing.assert_allclose(absorbed[:, i], tmm.absorp_in_each_layer(exact)[1:-1], rtol=0, atol=1e-12)
        for j, depth in enumerate(DEPTH[:, i]):
            at = tmm.position_resolved(*tmm.find_in_structure_with_inf(exact["d_list"], depth), exact)
            E = np.array([at["Ex"], at["Ey"], at["Ez"]])
            np.testing.assert_allclose(field.electric[:, j, i], E, rtol=1e-10, atol=1e-12)
            assert field.intensity[j, i] == pytest.approx(np.sum(abs(E) ** 2), rel=1e-10, abs=1e-12)
            assert field.absorbed[j, i] == pytest.approx(at["absor"], rel=1e-10, abs=1e-14)


@pytest.mark.slow
def test_the_magnetic_field_has_the_poynting_vector_of_tmm():
    """Its part along z, E_x H_y* − E_y H_x*, over the incident n₀ cos θ₀."""
    incident = AMBIENT * np.cos(np.deg2rad(ANGLE))
    for letter in "sp":
        (Ex, Ey, _), (Hx, Hy, _) = (np.asarray(x) for x in computed(letter)[-1][2:])
        power = np.real(Ex * np.conj(Hy) - Ey * np.conj(Hx)) / incident
        for i in range(0, COUNT, 5):
            exact = reference(i, letter)
            for j, depth in enumerate(DEPTH[:, i]):
                at = tmm.position_resolved(*tmm.find_in_structure_with_inf(exact["d_list"], depth), exact)
                assert power[j, i] == pytest.approx(at["poyn"], rel=1e-10, abs=1e-12)


@pytest.mark.slow  # compiles for seconds
def test_unpolarised_is_the_mean_with_the_components_of_both():
    (A_s, *_, s), (A_p, *_, p), (A, *_, both) = map(computed, ("s", "p", "unpolarised"))
    np.testing.assert_allclose(A, 0.5 * (A_s + A_p), rtol=1e-14)
    np.testing.assert_allclose(both.intensity, 0.5 * (s.intensity + p.intensity), rtol=1e-13)
    np.testing.assert_allclose(both.absorbed, 0.5 * (s.absorbed + p.absorbed), rtol=1e-13)
    np.testing.assert_allclose(both.electric, s.electric + p.electric, rtol=1e-13)
    np.testing.assert_allclose(both.magnetic, s.magnetic + p.magnetic, rtol=1e-13)


@pytest.mark.slow  # compiles a stack of its own
def test_one_layer_has_an_axis_of_layers_too():
    nm = np.linspace(400, 800, 5)
    assert pl.absorptance(nm, 100.0, 2.0 + 0.1j, 1.5).shape == (1, 5)
    assert pl.absorptance(nm, 100.0, "Au", "Si", angle=np.array([[0.0], [60.0]])).shape == (1, 2, 5)
    assert not np.any(pl.absorptance(nm, [100.0], [2.0], 1.5))


@pytest.mark.slow  # compiles for 6 s
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_precision_follows_the_input(dtype):
    nm = np.array([500.0, 600.0], dtype)
    A = pl.absorptance(nm, 30.0, 0.4 + 2.5j, 1.5, angle=30.0)
    found = pl.field(nm, 30.0, 0.4 + 2.5j, 1.5, 10.0, angle=30.0)
    assert A.dtype == found.intensity.dtype == found.absorbed.dtype == dtype
    assert found.electric.dtype == found.magnetic.dtype == np.result_type(dtype, np.complex64)


@pytest.mark.slow
def test_weak_absorption_is_proportional_to_k_and_has_its_slope():
    """At k = 0 the absorptance is 0 and its derivative is not; at 1e-12 all digits are there."""

    @jax.jit
    def at(k):
        def absorptance(k):
            return pl.absorptance(550.0, [200.0], [1.46 + 1j * k], 3.9, angle=40.0)[0]

        return absorptance(k), jax.grad(absorptance)(k)

    none, slope = at(0.0)
    little, _ = at(1e-12)
    assert none == 0
    assert float(little / 1e-12) == pytest.approx(float(slope), rel=1e-11)  # the next order is k
    assert slope > 1


def test_what_is_refused(refuses):
    refuses(ValueError, "ambient must not absorb", pl.absorptance, 500.0, 10.0, 2.0, 1.5, ambient=1.3 + 0.1j)
    refuses(ValueError, "one for each of 2 layers", pl.field, 500.0, [10.0], [2.0, 1.5], 1.5, 0.0)
    refuses(ValueError, "`depth` must be a number", pl.field, 500.0, 10.0, 2.0, 1.5, "0:100")
