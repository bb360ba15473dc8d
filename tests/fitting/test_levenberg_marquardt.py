"""The bounded solver against SciPy's, on films whose k may rest on zero, and at its own limits."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy.optimize import brentq
from scipy.optimize import least_squares as scipy_least_squares

from pellicle.fitting.optimistix_solver import BoundedLevenbergMarquardt
from pellicle.simulation.functions import reflectance

WAVELENGTH = np.linspace(400.0, 900.0, 64)
LOWER, UPPER = np.array([10.0, 1.2, 0.0]), np.array([1000.0, 2.6, 0.2])
SIGMA = 0.005
FITS = 24


def model(y):
    """Reflectance of a film of thickness, n and k (in units of the box) on silicon-like 3.9 + 0.02i."""
    d, n, k = jnp.asarray(LOWER, y.dtype) + y * jnp.asarray(UPPER - LOWER, y.dtype)
    return reflectance(jnp.asarray(WAVELENGTH, y.dtype), d, n + 1j * k, 3.9 + 0.02j)


def least_squares(residual, start, *, rtol=1e-8, steps=100):
    """The minimum in the unit box, and whether the solver has settled."""
    solution = optx.least_squares(
        lambda y, _: residual(y),
        BoundedLevenbergMarquardt(rtol, 0.0),
        start,
        options={"lower": 0.0, "upper": 1.0},
        max_steps=steps,
        throw=False,
    )
    return solution.value, solution.result == optx.RESULTS.successful


class Films(NamedTuple):
    data: np.ndarray  # (fits, wavelengths)
    start: np.ndarray  # (fits, 3) in the unit box


@pytest.fixture(scope="module")
def films() -> Films:
    """Films with k = 0 and noise, so that in about half of the fits k ends on its bound."""
    random = np.random.default_rng(0)
    truth = np.column_stack([random.uniform(0.05, 0.9, FITS), random.uniform(0.1, 0.9, FITS), np.zeros(FITS)])
    clean = np.asarray(jax.jit(jax.vmap(model))(truth))
    start = np.column_stack(
        [truth[:, 0] * random.uniform(0.99, 1.01, FITS), truth[:, 1], np.full(FITS, 0.05)]
    )
    return Films(clean + random.normal(0, SIGMA, clean.shape), start)


def residual(y, data):
    return (model(y) - data) / SIGMA


@pytest.fixture(scope="module")
def solved(films):
    """Ours for every film at once: (y, converged, χ²)."""
    y, converged = jax.jit(jax.vmap(lambda s, d: least_squares(lambda u: residual(u, d), s)))(
        films.start, films.data
    )
    chi2 = np.sum(np.asarray(jax.jit(jax.vmap(residual))(y, films.data)) ** 2, axis=1)
    return np.asarray(y), np.asarray(converged), chi2


@pytest.mark.slow  # compiles for 3 s; the NIST problems are others of known χ²
def test_the_same_chi2_as_scipy_with_k_on_its_bound_or_not(films, solved):
    y, converged, chi2 = solved
    function, slope = jax.jit(residual), jax.jit(jax.jacfwd(residual))
    strict = {"bounds": (0.0, 1.0), "xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-12}
    theirs = [
        scipy_least_squares(
            *(lambda u, d=d: np.asarray(function(u, d)), np.clip(start, 1e-9, 1 - 1e-9)),
            *(lambda u, d=d: np.asarray(slope(u, d)),),
            **strict,
        )
        for start, d in zip(films.start, films.data, strict=True)
    ]
    assert converged.all()
    active = y[:, 2] == 0
    assert 0.25 < active.mean() < 0.75  # both kinds were tried
    # n against d at constant n·d has minima of its own: the two may end in neighbouring ones, seldom
    same = np.abs(y[:, 0] - [fit.x[0] for fit in theirs]) < 1e-3
    assert same.mean() > 0.9
    np.testing.assert_allclose(chi2[same], np.array([2 * fit.cost for fit in theirs])[same], rtol=1e-4)
    # the interior-point method only nears a bound, ours is on it
    assert all(fit.x[2] < 1e-3 for fit in np.array(theirs)[active])


def test_an_active_bound_is_a_constrained_minimum(films, solved):
    """On the bound the gradient pushes outward, and in the other directions there is none."""
    y, _, _ = solved
    assert ((y >= 0) & (y <= 1)).all()
    slope = np.asarray(jax.jit(jax.vmap(jax.jacfwd(residual)))(y, films.data))
    gradient = 2 * np.einsum("fw,fwp->fp", np.asarray(jax.jit(jax.vmap(residual))(y, films.data)), slope)
    active = y[:, 2] == 0
    assert (gradient[active, 2] > 0).all()
    size = np.abs(slope).sum(axis=1)
    assert np.max(np.abs(gradient[:, :2]) / size[:, :2]) < 1e-3
    assert np.max(np.abs(gradient[~active, 2]) / size[~active, 2]) < 1e-3


@pytest.mark.parametrize(
    ("residual", "start", "expected"),
    [
        (lambda y: y - jnp.array([0.5, 2.0]), [-3.0, 7.0], [0.5, 1.0]),  # a start outside is brought in
        (lambda y: jnp.array([y[0] - 0.3, 0.0 * y[1]]), [0.9, 0.4], [0.3, 0.4]),  # one has no effect
        # the full step from 0.9 lands below zero, where there is no logarithm
        (lambda y: jnp.log(y - 0.05) - jnp.log(0.05), [0.9], [0.1]),
    ],
)
def test_minima_within_the_box(residual, start, expected):
    found, converged = least_squares(residual, jnp.array(start))
    assert converged
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_what_has_not_converged_is_reported(films):
    for residuals in (lambda y: y * jnp.nan, lambda y: jnp.where(y > 0.2, jnp.nan, y - 1.0)):
        assert not least_squares(residuals, jnp.array([0.5]))[1]
    start, data = jnp.asarray(films.start[0]), films.data[0]
    assert not least_squares(lambda y: residual(y, data), start, rtol=1e-12, steps=2)[1]


@pytest.mark.slow  # compiles for 2 s
def test_float32_stays_float32(films, solved):
    """Under x64, where Optimistix's own solver fails on float32."""
    y, _, _ = solved
    start = jnp.asarray(films.start[0], jnp.float32)
    data = jnp.asarray(films.data[0], jnp.float32)
    found, converged = least_squares(lambda u: residual(u, data), start, rtol=1e-4)
    assert found.dtype == jnp.float32
    assert converged
    np.testing.assert_allclose(found, y[0], atol=2e-3)


def test_large_residuals_at_the_minimum_do_not_slow_the_end():
    """x + 1 and λx² + x − 1 have their minimum at 0, where Gauss-Newton converges linearly with ratio λ:
    0.95²⁰ is 0.36 (K. Madsen, H. Nielsen and O. Tingleff, 2004, example 3.4)."""
    found, converged = least_squares(
        lambda y: jnp.concatenate([(y - 0.5) + 1, 0.95 * (y - 0.5) ** 2 + (y - 0.5) - 1]),
        jnp.array([0.9]),
        rtol=1e-10,
        steps=20,
    )
    assert converged
    np.testing.assert_allclose(found, 0.5, atol=1e-6)


def test_residuals_with_rounding_errors_settle_soon():
    """Residuals rounded to 1e-12, as differences of values ten thousand times as large are: no step near the
    minimum lowers χ² any more, and the last point has settled all the same."""

    def residual(y):
        exact = jnp.concatenate([jnp.sin(3 * y) - 0.6, 2 * y - 0.5, 1 - y])
        return exact + jax.lax.stop_gradient(jnp.round(exact * 1e12) / 1e12 - exact)

    found, converged = least_squares(residual, jnp.array([0.9]), rtol=1e-14, steps=18)
    assert converged
    # where Σ r r′ is zero
    best = brentq(lambda y: 3 * np.cos(3 * y) * (np.sin(3 * y) - 0.6) + 2 * (2 * y - 0.5) - (1 - y), 0, 1)
    np.testing.assert_allclose(found, best, atol=1e-5)
