"""Ψ and Δ against an independent transfer matrix, in the convention of instruments."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.optics import ellipsometry
from pellicle.optics.coherent import responses
from pellicle.optics.ellipsometry import mueller, normalised, normalised_mueller, stokes
from pellicle.optics.pair import to_complex

from ..by_tmm import films

WAVELENGTH = 600.0


@jax.jit
@jax.vmap
def psi_delta(depth, index, substrate, angle):
    return pl.ellipsometry(WAVELENGTH, depth, list(index), substrate, angle=angle)


def truth(depth, index, substrate, angle) -> complex:
    s, p = (films(x, WAVELENGTH, [1.0, *index, substrate], depth, angle, "r")[0] for x in "sp")
    return np.conj(p / s)


@pytest.mark.parametrize("layers", [1, 2, 5, pytest.param(12, marks=pytest.mark.slow)])
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


def test_normal_incidence_cannot_tell_s_from_p():
    psi, delta = pl.ellipsometry(550.0, 100.0, 1.46, 4.07 + 0.03j, angle=0.0)
    assert (float(psi), float(delta)) == pytest.approx((45.0, 180.0), abs=1e-9)


def test_where_nothing_is_reflected_the_sphere_has_no_point():
    """No layer, no boundary: all three are 0 and no derivative is NaN."""
    nothing = ellipsometry.Stokes(*jnp.zeros(4))
    assert [float(x) for x in ellipsometry.normalised(nothing)] == [0.0, 0.0, 0.0]
    slope = jax.grad(lambda d: sum(pl.ellipsometry(550.0, d, 1.0, 1.0, angle=30.0)))(10.0)
    assert np.isfinite(float(slope))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_where_nothing_is_reflected_both_angles_are_0(dtype):
    both = lambda n, c, s: jnp.stack(ellipsometry.psi_delta(n, c, s))  # noqa: E731
    point = (dtype(0), dtype(0), dtype(0))
    assert both(*point).tolist() == [0.0, 0.0]
    for jacobian in (jax.jacfwd, jax.jacrev):
        assert np.all(np.isfinite(jax.jit(jacobian(both, argnums=(0, 1, 2)))(*point)))


def test_delta_never_reaches_360():
    """−1e-17 degrees and a whole turn round to 360."""
    _, delta = ellipsometry.psi_delta(0.0, 1.0, np.float64(-1e-19))
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
        np.testing.assert_allclose(jax.jit(jacobian(point))(rs, rp), slope, rtol=1e-5)


ANALYSER = np.array([5.0, 30.0, 45.0, 80.0])[:, None]
PSI, DELTA = np.meshgrid([0.5, 20.0, 44.0, 89.0], [0.0, 40.0, 135.0, 300.0])


def test_alpha_and_beta_are_what_a_turning_analyser_sees():
    """By Jones vectors, and by the formulas that hold tangents; twice over gives N and C back."""
    tan_psi, delta = np.tan(np.deg2rad(PSI.ravel())), np.deg2rad(DELTA.ravel())
    n, c = np.cos(2 * np.arctan(tan_psi)), np.sin(2 * np.arctan(tan_psi)) * np.cos(delta)
    alpha, beta = ellipsometry.alpha_beta(n, c, ANALYSER)

    still = np.deg2rad(ANALYSER)
    turn = np.linspace(0, np.pi, 16, endpoint=False)[:, None, None]
    field = tan_psi * np.exp(1j * delta) * np.cos(still) * np.cos(turn) + np.sin(still) * np.sin(turn)
    seen = np.abs(field) ** 2
    wave = np.mean(seen * np.exp(2j * turn), axis=0) / np.mean(seen, axis=0) * 2
    np.testing.assert_allclose(alpha, wave.real, atol=1e-13)
    np.testing.assert_allclose(beta, wave.imag, atol=1e-13)

    both = tan_psi**2 + np.tan(still) ** 2
    np.testing.assert_allclose(alpha, (tan_psi**2 - np.tan(still) ** 2) / both, atol=1e-13)
    np.testing.assert_allclose(beta, 2 * tan_psi * np.cos(delta) * np.tan(still) / both, atol=1e-13)
    back = ellipsometry.alpha_beta(alpha, beta, ANALYSER)
    np.testing.assert_allclose(back, np.broadcast_arrays(n, c, alpha)[:2], atol=1e-12)


@pytest.mark.parametrize(("n", "alpha"), [(1.0, -1.0), (-1.0, 1.0)])
def test_alpha_and_beta_at_the_poles(n, alpha):
    """Where tan Ψ is 0 or infinite values and derivatives are finite."""
    a, b = ellipsometry.alpha_beta(n, 0.0, 30.0)
    assert float(a) == pytest.approx(alpha)
    assert float(b) == 0
    of_alpha, of_beta = jax.jacfwd(ellipsometry.alpha_beta, argnums=(0, 1, 2))(n, 0.0, 30.0)
    # dα/dN = −sin² 2A/(1 − N cos 2A)², dβ/dC = sin 2A/(1 − N cos 2A), and α stays when A turns
    over = 1 - 0.5 * n
    np.testing.assert_allclose(of_alpha, [-0.75 / over**2, 0.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(of_beta, [0.0, np.sqrt(0.75) / over, 0.0], atol=1e-14)


# S₁ = |E_p|² − |E_s|², S₂ = 2 Re(E_p conj E_s), S₃ = 2 Im(E_p conj E_s)
PAULI = [np.eye(2), np.diag([1, -1]), np.array([[0, 1], [1, 0]]), np.array([[0, 1j], [-1j, 0]])]


@pytest.fixture(scope="module")
def jones():
    rng = np.random.default_rng(7)
    return rng.normal(size=(5, 2, 2)) + 1j * rng.normal(size=(5, 2, 2))


def test_definition(jones):
    expected = [
        [[0.5 * np.trace(out @ j @ into @ j.conj().T).real for into in PAULI] for out in PAULI] for j in jones
    ]
    np.testing.assert_allclose(mueller(jones), expected, rtol=0, atol=1e-14)


def test_isotropic_sample():
    s, p = responses(1.0, [1.6 + 0.1j], 3.9 + 0.02j, [np.asarray(1.2)], np.asarray(1.1))
    n, c, sine = normalised(stokes(s, p))
    rs, rp = (to_complex(x.reflected) / to_complex(x.denominator) for x in (s, p))
    found = normalised_mueller(mueller(np.diag([rp, rs])))
    expected = [[1, -n, 0, 0], [-n, 1, 0, 0], [0, 0, c, sine], [0, 0, -sine, c]]
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_dark_sample_has_finite_slopes():
    def first_row(scale):
        return normalised_mueller(mueller(scale * np.eye(2, dtype=complex)))[0].sum()

    assert first_row(0.0) == 0
    assert np.isfinite(jax.jit(jax.grad(first_row))(0.0))
    np.testing.assert_allclose(first_row(1e-100), 1)
