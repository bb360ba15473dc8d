"""Several coherent layers against the tmm package, the closed form of a film, and 200 digits."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.optics import film, response, stack

WAVELENGTH = 550.0


def random_stack(rng: np.random.Generator, count: int):
    index = [complex(rng.uniform(0.1, 4), rng.choice([0.0, rng.uniform(0, 3)])) for _ in range(count)]
    substrate = complex(rng.uniform(1, 4), rng.choice([0.0, rng.uniform(0, 2)]))
    return index, rng.uniform(0, 400, count).tolist(), substrate, rng.uniform(0, 1.5)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_agrees_with_tmm(count):
    rng = np.random.default_rng(count)
    run = jax.jit(lambda n, d, n2, theta: stack.stack(1.0, list(n), n2, list(d), theta))
    for _ in range(20):
        index, depth, substrate, theta = random_stack(rng, count)
        phases = 2 * np.pi / WAVELENGTH * np.array(depth)
        responses = run(jnp.array(index), phases, jnp.asarray(substrate), theta)
        for result, letter in zip(responses, "sp", strict=True):
            truth = tmm.coh_tmm(letter, [1.0, *index, substrate], [np.inf, *depth, np.inf], theta, WAVELENGTH)
            assert complex(result.reflected / result.denominator) == pytest.approx(truth["r"], abs=1e-13)
            assert float(response.reflectance(result)) == pytest.approx(truth["R"], abs=1e-13)
            assert float(response.transmittance(result)) == pytest.approx(truth["T"], rel=1e-11, abs=1e-14)


def test_one_layer_is_the_film_from_both_sides():
    arguments = (1.3, jnp.asarray(2.1 + 0.3j), jnp.asarray(1.7 + 0.1j), 2 * np.pi / WAVELENGTH * 130.0, 0.7)
    single = film.film(*arguments)
    many = stack.stack(arguments[0], [arguments[1]], arguments[2], [arguments[3]], arguments[4])
    for a, b in zip(single, many, strict=True):
        for signal in (response.reflectance, response.reflectance_below, response.transmittance):
            assert float(signal(b)) == pytest.approx(float(signal(a)), abs=1e-14)


@pytest.mark.slow
def test_an_opaque_layer_among_fifty_keeps_its_transmittance():
    """tmm clamps such a transmittance; the reference in 200 digits does not."""
    index = [complex(1.46 if i % 2 else 2.3) for i in range(50)]
    depth = [80.0] * 50
    index[25], depth[25] = 0.5 + 4j, 3000.0
    angle = 30.0
    reflected, transmitted = mpmath_s(index, depth, 1.5, np.deg2rad(angle))
    options = {"angle": angle, "polarisation": "s"}
    result = float(pl.transmittance(WAVELENGTH, depth, index, 1.5, **options))
    assert 0 < transmitted < 1e-100
    assert result == pytest.approx(transmitted, rel=1e-9)
    assert float(pl.reflectance(WAVELENGTH, depth, index, 1.5, **options)) == pytest.approx(
        reflected, abs=1e-13
    )
    signal = jax.jit(lambda d: pl.reflectance(WAVELENGTH, d, index, 1.5, **options))
    depth = jnp.array(depth)
    slope = jax.grad(signal)(depth)
    for i in (0, 24, 25, 49):  # above the metal, the metal, and what it hides
        step = jnp.zeros(50).at[i].set(1e-3)
        numeric = float(signal(depth + step) - signal(depth - step)) / 2e-3
        assert float(slope[i]) == pytest.approx(numeric, rel=1e-6, abs=1e-11)
    assert np.all(np.abs(slope[25:]) < 1e-15)  # rounding is all that is left of them


def mpmath_s(index, depth, substrate, theta):
    """Return R and T of s-polarised light by the characteristic matrices in 200 digits."""
    with mpmath.workdps(200):
        a, k = mpmath.sin(theta), 2 * mpmath.pi / WAVELENGTH
        root = lambda n: mpmath.sqrt(mpmath.mpc(n) ** 2 - a**2)  # noqa: E731
        field, slope = mpmath.mpc(1), root(substrate)
        for n, d in zip(reversed(index), reversed(depth), strict=True):
            q = root(n)
            c, s = mpmath.cos(k * d * q), mpmath.sin(k * d * q)
            field, slope = field * c - 1j * s / q * slope, slope * c - 1j * s * q * field
        q0 = mpmath.cos(theta)
        r = (q0 * field - slope) / (q0 * field + slope)
        t = 2 * q0 / (q0 * field + slope)
        return float(abs(r) ** 2), float(abs(t) ** 2 * mpmath.re(root(substrate)) / q0)


def test_gradients_against_finite_differences():
    index, depth = [1.46, 2.3 + 0.1j, 1.9], jnp.array([100.0, 50.0, 20.0])
    signal = jax.jit(lambda d: pl.reflectance(WAVELENGTH, d, index, 3.9 + 0.02j, angle=60.0))
    slope = jax.grad(signal)(depth)
    for i in range(3):
        step = jnp.zeros(3).at[i].set(1e-3)
        assert float(slope[i]) == pytest.approx(
            float((signal(depth + step) - signal(depth - step)) / 2e-3), rel=1e-6, abs=1e-10
        )


def test_a_thickness_is_required_for_each_layer():
    with pytest.raises(ValueError, match="one for each of 2 layers"):
        pl.reflectance(WAVELENGTH, [100.0], [1.46, 2.3], 1.5)
