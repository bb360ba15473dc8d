"""Errors against lmfit and SciPy, and the films that the data do not see."""

from dataclasses import replace

import jax
import lmfit
import numpy as np
import pytest
from scipy import stats

import pellicle as pl
from pellicle.fitting.covariance import Scaled, errors, scaled
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.problem import measured as as_numbers
from pellicle.simulation.functions import reflectance
from pellicle.simulation.spectra import simulate_signal

CAUCHY = (pl.Free(1.3, 1.7), pl.Free(0.0, 2e4))
TRUTH = (1.45, 4000.0, 480.0)  # A, B, thickness


@pytest.fixture
def scene(film):
    """A scene of which everything else is known: its errors are those of the noise."""
    return replace(film(material=pl.dispersion.Cauchy(*CAUCHY)), uncertainty=pl.Uncertainty.none())


def covariance(fit):
    stderr = np.array([fit[name].stderr for name in fit.correlation_names])
    return fit.correlation_names, fit.correlation * np.outer(stderr, stderr)


UNITS = {"thickness": 100, "A": 1, "B": 1e4}
"""Steps of lmfit's finite differences would cost three digits: they are of numbers of order one."""


@pytest.mark.parametrize("given", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_errors_against_lmfit(scene, measured, given):
    """σ given, or from residuals, whose correlation widens errors by its root, and Student's t has them."""
    data = measured(scene, *TRUTH, sigma=given)
    fit = pl.fit(data, scene)
    model = jax.jit(lambda d, a, b: reflectance(data.wavelength, d, a + b / data.wavelength**2, 3.9 + 0.02j))
    start, sigma = lmfit.Parameters(), data.sigma if given else 1.0
    for name, unit in UNITS.items():
        start.add(name, fit[name].value / unit)
    theirs = lmfit.minimize(
        lambda p: (np.asarray(model(*(p[x] * unit for x, unit in UNITS.items()))) - data.values) / sigma,
        start,
        scale_covar=not given,
    )
    share = 1.0 if given else fit.effective_points / len(data)
    assert share > 0.7  # white noise, as far as 128 points can tell
    z = stats.norm.isf(0.025)
    coverage = z if given else stats.t.isf(0.025, (len(data) - 3) * share)
    for name, unit in UNITS.items():
        assert fit[name].value == pytest.approx(theirs.params[name].value * unit, rel=1e-5)
        expected = theirs.params[name].stderr * unit / np.sqrt(share)
        assert fit[name].stderr_noise == pytest.approx(expected, rel=1e-3), name
        assert fit[name].coverage_factor == pytest.approx(coverage, rel=1e-3)
    names = list(fit.correlation_names)
    found = fit.correlation[names.index("thickness"), names.index("A")]
    assert found == pytest.approx(theirs.params["thickness"].correl["A"], abs=1e-3)
    assert fit.status == "converged"


@pytest.mark.slow  # compiles for 4 s; test_identifiability.py has the words
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


@pytest.mark.slow
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


# residuals that stand for the noise of their points: the sandwich estimator
X = np.linspace(0.0, 1.0, 40)


DESIGN = np.stack([np.ones(40), X, np.exp(-((X - 0.5) ** 2) / 0.05)], axis=1)


def _scaled(design):
    """A Jacobian with rows of priors that say nothing."""
    return Scaled(np.vstack([design, 1e-9 * np.eye(3)]), np.eye(3), ("a", "b", "c"))


def test_one_channel_agrees_with_hc3_written_out():
    residual = np.random.default_rng(0).standard_normal(40) * (1 + 5 * X)
    bread = np.linalg.inv(DESIGN.T @ DESIGN)
    leverage = np.diag(DESIGN @ bread @ DESIGN.T)
    expected = bread @ DESIGN.T @ np.diag((residual / (1 - leverage)) ** 2) @ DESIGN @ bread
    influence = (bread @ DESIGN.T) ** 2
    freedom = influence.sum(axis=1) ** 2 / (influence**2).sum(axis=1)  # Satterthwaite's
    wider = stats.t.ppf(stats.norm.cdf(1), freedom)
    found = errors(_scaled(DESIGN), {0: residual[:, None]})
    np.testing.assert_allclose(found.covariance, expected * np.outer(wider, wider), rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(found.by_curvature, bread, rtol=1e-9, atol=1e-12)


def test_correlated_channels_count_together():
    """The same samples three times over in channels that err alike are no more than once."""
    residual = np.random.default_rng(0).standard_normal(40)[:, None]
    once = errors(_scaled(DESIGN), {0: residual})
    thrice = errors(_scaled(np.repeat(DESIGN, 3, axis=0)), {0: np.repeat(residual, 3, axis=1)})
    np.testing.assert_allclose(thrice.covariance, once.covariance, rtol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_errors_of_data_without_noise_are_finite(seed):
    """Of simulated samples: they shrink with the residuals, below the rounding of the leverages."""
    residual = np.random.default_rng(seed).standard_normal((40, 1))
    bounds_alone = _scaled(DESIGN)._replace(jacobian=np.vstack([DESIGN, np.zeros((3, 3))]))
    expected = 1e-10 * errors(bounds_alone, {0: residual}).stderr
    found = errors(bounds_alone, {0: 1e-10 * residual}).stderr
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_z_under_uneven_noise_is_that_of_a_normal_distribution():
    """2000 data sets whose noise is ten times larger in the peak; with one noise for all, z of c is 1.4."""
    rng = np.random.default_rng(0)
    sigma, pinv, z, plain = 0.1 + DESIGN[:, 2], np.linalg.pinv(DESIGN), [], []
    for _ in range(2000):
        noise = sigma * rng.standard_normal(40)
        found = pinv @ noise
        residual = noise - DESIGN @ found
        scale = np.sqrt(np.sum(residual**2) / 37)
        result = errors(_scaled(DESIGN / scale), {0: residual[:, None] / scale})
        z.append(found / result.stderr)
        plain.append(found / np.sqrt(np.diag(result.by_curvature)))
    assert np.sqrt(np.mean(np.square(plain), axis=0))[2] > 1.25
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(z), axis=0)), 1.0, atol=0.15)


def test_only_views_without_a_noise_of_their_own_are_changed():
    """Rows of a second view keep their weights."""
    design = np.vstack([DESIGN, 100 * DESIGN])
    found = errors(_scaled(design), {0: 3 * np.random.default_rng(0).standard_normal((40, 1))})
    expected = np.linalg.inv(DESIGN.T @ DESIGN) / 10001
    assert np.diag(found.covariance) == pytest.approx(np.diag(expected), rel=0.01)
