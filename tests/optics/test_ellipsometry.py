"""Ψ and Δ against an independent transfer matrix, in the convention of instruments."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.optics import ellipsometry

WAVELENGTH = 600.0


@jax.jit
@jax.vmap
def psi_delta(depth, index, substrate, angle):
    return pl.ellipsometry(WAVELENGTH, depth, list(index), substrate, angle=angle)


def truth(depth, index, substrate, angle) -> complex:
    r = {
        letter: tmm.coh_tmm(
            letter, [1.0, *index, substrate], [np.inf, *depth, np.inf], np.deg2rad(angle), WAVELENGTH
        )["r"]
        for letter in "sp"
    }
    return np.conj(r["p"] / r["s"])


@pytest.mark.parametrize("layers", [1, 2, 5, 12])
def test_random_stacks(layers):
    rng, count = np.random.default_rng(layers), 250
    index = rng.uniform(1.2, 3, (count, layers)) + 1j * rng.choice([0.0, 0.2, 2.0], (count, layers))
    depth = rng.uniform(0, 300, (count, layers))
    substrate = rng.uniform(1, 4, count) + 1j * rng.choice([0.0, 0.3, 3.0], count)
    angle = rng.uniform(10, 80, count)
    psi, delta = np.deg2rad(np.asarray(psi_delta(depth, index, substrate, angle)))
    expected = np.array([truth(*row) for row in zip(depth, index, substrate, angle, strict=True)])
    found = np.tan(psi) * np.exp(1j * delta)
    assert np.max(np.abs(found - expected) / (1 + np.abs(expected))) < 1e-11


def test_bare_silicon_at_small_angles_has_delta_near_180():
    psi, delta = pl.ellipsometry(550.0, 0.0, 1.46, 4.07 + 0.03j, angle=5.0)
    assert float(psi) == pytest.approx(45.0, abs=0.2)
    assert float(delta) == pytest.approx(180.0, abs=0.1)


def test_normal_incidence_cannot_tell_s_from_p():
    psi, delta = pl.ellipsometry(550.0, 100.0, 1.46, 4.07 + 0.03j, angle=0.0)
    assert (float(psi), float(delta)) == pytest.approx((45.0, 180.0), abs=1e-9)


def test_ranges_and_the_sphere():
    angles = jnp.linspace(1.0, 89.0, 23)
    psi, delta = pl.ellipsometry(550.0, 250.0, 1.46, 0.2 + 3.4j, angle=angles)
    assert bool(jnp.all((psi >= 0) & (psi <= 90) & (delta >= 0) & (delta < 360)))


def test_gradients_against_finite_differences():
    def both(thickness):
        return jnp.stack(pl.ellipsometry(550.0, thickness, 1.46, 4.07 + 0.03j, angle=70.0))

    slope = jax.jacfwd(both)(120.0)
    step = (both(120.0 + 1e-4) - both(120.0 - 1e-4)) / 2e-4
    np.testing.assert_allclose(slope, step, rtol=1e-6)


def test_where_nothing_is_reflected_the_sphere_has_no_point():
    """No layer, no boundary: all three are 0 and no derivative is NaN."""
    nothing = ellipsometry.Stokes(*jnp.zeros(4))
    assert [float(x) for x in ellipsometry.normalised(nothing)] == [0.0, 0.0, 0.0]
    slope = jax.grad(lambda d: sum(pl.ellipsometry(550.0, d, 1.0, 1.0, angle=30.0)))(10.0)
    assert np.isfinite(float(slope))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_where_nothing_is_reflected_both_angles_are_0(dtype):
    both = lambda n, c, s: jnp.stack(ellipsometry.angles(n, c, s))  # noqa: E731
    point = (dtype(0), dtype(0), dtype(0))
    assert both(*point).tolist() == [0.0, 0.0]
    for jacobian in (jax.jacfwd, jax.jacrev):
        assert np.all(np.isfinite(jacobian(both, argnums=(0, 1, 2))(*point)))


def test_delta_never_reaches_360():
    """−1e-17 degrees and a whole turn round to 360."""
    _, delta = ellipsometry.angles(0.0, 1.0, np.float64(-1e-19))
    assert 0 <= float(delta) < 360


@pytest.mark.parametrize(("dtype", "amplitude"), [(np.float32, 1e-13), (np.float64, 1e-100)])
def test_a_faint_reflection_keeps_its_place_on_the_sphere(dtype, amplitude):
    """The square of its intensity underflows, and no derivative is lost to that."""

    def point(rs, rp):
        given = ellipsometry.Stokes(rs * rs - rp * rp, 2 * rs * rp, 0 * rs, rs * rs + rp * rp)
        return jnp.stack(ellipsometry.normalised(given))

    rs, rp = dtype(2 * amplitude), dtype(amplitude)
    np.testing.assert_allclose(point(rs, rp), [0.6, 0.8, 0.0], rtol=1e-6)
    # N = (x² − 1)/(x² + 1) and C = 2x/(x² + 1) of x = r_s/r_p = 2
    slope = np.array([8 / 25, -6 / 25, 0.0]) / amplitude
    for jacobian in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(jacobian(point)(rs, rp), slope, rtol=1e-5)
