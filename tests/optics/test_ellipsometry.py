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


def test_random_stacks():
    rng = np.random.default_rng(0)
    for _ in range(200):
        index = [complex(rng.uniform(1.2, 3), rng.choice([0.0, rng.uniform(0, 2)])) for _ in range(2)]
        depth, substrate = rng.uniform(1, 300, 2), complex(rng.uniform(1, 4), rng.uniform(0, 3))
        angle = rng.uniform(10, 80)
        psi, delta = psi_delta(depth, jnp.array(index), substrate, angle)
        rho = np.tan(np.deg2rad(float(psi))) * np.exp(1j * np.deg2rad(float(delta)))
        expected = truth(depth, index, substrate, angle)
        assert abs(rho - expected) < 1e-12 * (1 + abs(expected))


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
