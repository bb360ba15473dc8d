"""Errors against lmfit and SciPy, and the films that the data do not see."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import lmfit
import numpy as np
import pytest
from scipy import stats
from scipy.optimize import curve_fit

import pellicle as pl
from pellicle.fitting.covariance import errors, scaled
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.targets import measured as as_numbers
from pellicle.simulation.functions import reflectance
from pellicle.simulation.spectra import simulate_signal

CAUCHY = (pl.Free(1.3, 1.7), pl.Free(0.0, 2e4))
TRUTH = (1.45, 4000.0, 480.0)  # A, B, thickness


@pytest.fixture(scope="module")
def model():
    @jax.jit
    def model(nm, d, a, b):
        return reflectance(nm, d, a + b / nm**2, 3.9 + 0.02j)

    return lambda nm, *p: np.asarray(model(jnp.asarray(nm), *map(jnp.asarray, p)))


@pytest.fixture
def scene(film):
    """A scene of which everything else is known: its errors are those of the noise."""
    return replace(film(material=pl.dispersion.Cauchy(*CAUCHY)), uncertainty=pl.Uncertainty.none())


def covariance(fit):
    stderr = np.array([fit[name].stderr for name in fit.correlation_names])
    return fit.correlation_names, fit.correlation * np.outer(stderr, stderr)


def ordered(names):
    return [names.index(name) for name in ("thickness", "A", "B")]


@pytest.mark.slow  # compiles for 3 s; tests/fitting/test_nist.py has certified deviations
def test_absolute_sigma_against_scipy(scene, measured, model):
    data = measured(scene, *TRUTH, sigma=True)
    fit = pl.fit(data, scene)
    p0 = [fit[name].value for name in ("thickness", "A", "B")]
    # steps of its own finite differences would cost three digits: give it units of order one
    best, theirs = curve_fit(
        lambda nm, d, a, b: model(nm, 100 * d, a, 1e4 * b),
        data.wavelength,
        data.values,
        [p0[0] / 100, p0[1], p0[2] / 1e4],
        sigma=data.sigma,
        absolute_sigma=True,
        xtol=1e-12,
        ftol=1e-12,
    )
    unit = np.array([100, 1, 1e4])
    names, ours = covariance(fit)
    take = ordered(names)
    np.testing.assert_allclose(ours[np.ix_(take, take)], theirs * np.outer(unit, unit), rtol=1e-3)
    np.testing.assert_allclose(best * unit, p0, rtol=1e-5)
    assert fit.status == "converged"
    assert fit.chi2_reduced == pytest.approx(1, abs=0.3)


def test_relative_sigma_against_lmfit(scene, measured, model):
    """σ from the residuals; where correlation counts, errors grow by its root, and Student's t has them."""
    data = measured(scene, *TRUTH)
    fit = pl.fit(data, scene)
    start = lmfit.Parameters()
    for name, unit in (("thickness", 100), ("A", 1), ("B", 1e4)):
        start.add(name, fit[name].value / unit)
    theirs = lmfit.minimize(
        lambda p: model(data.wavelength, 100 * p["thickness"], p["A"] + 0, 1e4 * p["B"]) - data.values, start
    )
    share = fit.effective_points / len(data)
    assert share > 0.7  # white noise, as far as 128 points can tell
    widened = stats.t.isf(0.025, (len(data) - 3) * share) / stats.norm.isf(0.025)
    for name, unit in (("thickness", 100), ("A", 1), ("B", 1e4)):
        expected = theirs.params[name].stderr * unit / np.sqrt(share)
        assert fit[name].stderr_noise == pytest.approx(expected, rel=1e-3), name
        assert fit[name].coverage_factor == pytest.approx(stats.norm.isf(0.025) * widened, rel=1e-3)
    names = list(fit.correlation_names)
    found = fit.correlation[names.index("thickness"), names.index("A")]
    assert found == pytest.approx(theirs.params["thickness"].correl["A"], abs=1e-3)


def test_a_film_that_is_everywhere_opaque(film, measured):
    """Not even the thinnest that the bounds allow lets light through: any value fits as well."""
    scene = film(pl.Free(1000, 4000), "Au")
    fit = pl.fit(measured(scene, 2000.0, noise=0.005, sigma=True), scene)
    assert fit.status == "not-identifiable"
    assert fit["thickness"].stderr == float("inf")
    assert fit["thickness"].lower_limit is None
    assert "may be anything between 1000 and 4000 nm" in fit.verdict


def test_a_strong_correlation_gives_a_warning(film, measured):
    scene = film(pl.Free(1, 60), pl.dispersion.Constant(pl.Free(1.2, 1.8)))
    fit = pl.fit(measured(scene, 1.46, 15.0, noise=1e-3, sigma=True), scene)
    names = list(fit.correlation_names)
    assert abs(fit.correlation[names.index("n"), names.index("thickness")]) > 0.99
    assert any(warning.startswith("n and thickness are strongly correlated") for warning in fit.warnings)


def test_index_errors_follow_from_the_covariance(scene, measured):
    """Errors of n(λ) = A + B/λ²."""
    fit = pl.fit(measured(scene, *TRUTH, sigma=True), scene)
    names, matrix = covariance(fit)
    a, b = names.index("A"), names.index("B")
    u = 1 / fit.curve.wavelength**2
    expected = np.sqrt(matrix[a, a] + 2 * u * matrix[a, b] + u**2 * matrix[b, b])
    np.testing.assert_allclose(fit.curve.n_stderr, expected, rtol=1e-6)
    np.testing.assert_array_equal(fit.curve.k_stderr, 0)


def test_a_direction_that_the_data_do_not_see_keeps_its_variance(film, measured):
    """The covariance itself, before any profile: a pseudo-inverse would drop the direction and say 0."""
    scene = film(pl.Free(1, 4000), "Au")
    data = measured(scene, 3000.0, noise=0.005, sigma=True)
    problem = make(as_numbers(data, scene))
    unit = np.array([3000.0 / 4000])
    at = problem.views[0].local(problem.values(unit))
    assert errors(scaled(problem, unit, [at], [1.0])).stderr[0] > 1e6


def test_a_lower_limit_is_where_chi2_has_risen_by_2_71(film, measured):
    """A 95 % limit; at half of it the film is far out."""
    scene = film(pl.Free(1, 1000), "Au")
    data = measured(scene, 500.0, noise=0.005, sigma=True)
    fit = pl.fit(data, scene)

    def rise(thickness):
        model = simulate_signal(film(thickness, "Au"), data.wavelength).clean
        chi2 = np.sum(((data.values - model) / data.sigma) ** 2)
        return chi2 - fit.chi2_reduced * (len(data) - 1)

    limit = fit["thickness"].lower_limit
    assert rise(limit) == pytest.approx(2.71, abs=0.05)
    assert rise(limit / 2) > 30
