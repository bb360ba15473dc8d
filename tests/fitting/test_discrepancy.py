"""Discrepancies of linear problems, against generalised least squares with explicit covariances."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from pellicle.fitting.covariance import Scaled
from pellicle.fitting.discrepancy import bulk, discrepancy, improbable
from pellicle.fitting.linear_system import HALF_NORMAL, Effect, Evidence

X = np.linspace(-1, 1, 200)
SIGMA = 0.01


LINE = np.stack([np.ones_like(X), X], axis=1)
"""Slopes of a straight line, (points, 2)."""
NAMES = ("level", "slope")
BEND = 0.05 * (2 * X**2 - 1)


def evidence(residual, *effects, least=1.0, correlation=lambda rest: 1.0):
    """Residuals (points, channels) of a line that is the same in all channels."""
    sigma = np.full(residual.shape, SIGMA)
    jacobian = np.repeat(LINE[:, None], residual.shape[1], axis=1)
    return Evidence(residual, jacobian, sigma, SIGMA, 1 / sigma, effects, correlation, least)


def problem(residual, *effects, **options):
    """A straight line of two parameters with wide bounds, at the middle of them."""
    one = evidence(residual[:, None], *effects, **options)
    scaled = Scaled(np.vstack([LINE / SIGMA, np.zeros((2, 2))]), np.eye(2), NAMES)
    return discrepancy([one], scaled, np.full(2, 0.5)), LINE


def effect(change, size=1.0, **more):
    return Effect("effect", size, "nm", change[:, None], **more)


def without_line(rest):
    """As the residuals of a best fit are."""
    return rest - np.polyval(np.polyfit(X, rest, 1), X)


def noise(seed=0):
    return without_line(np.random.default_rng(seed).normal(0, SIGMA, X.size))


def test_generalised_least_squares_with_the_effect_in_the_covariance():
    change = 0.03 * np.exp(X)
    residual = noise() + 0.8 * without_line(change)
    found, jacobian = problem(residual, effect(change))
    inverse = np.linalg.inv(SIGMA**2 * np.eye(X.size) + np.outer(change, change))
    covariance = np.linalg.inv(jacobian.T @ inverse @ jacobian)
    np.testing.assert_allclose(found.errors.covariance, covariance, rtol=1e-6)
    np.testing.assert_allclose(found.shift, covariance @ jacobian.T @ inverse @ residual, rtol=1e-3)
    np.testing.assert_allclose(found.variance, np.diag(covariance) + found.shift**2)


def test_a_prior_that_pulls_the_fit_is_no_discrepancy():
    """At the best fit under a prior the residuals are not free of the line, and the shift is zero."""
    mean, weight = np.array([0.004, 0.0]), np.array([1500.0, 0.0])
    measured = np.random.default_rng(0).normal(0, SIGMA, X.size)
    normal = LINE.T @ LINE / SIGMA**2 + np.diag(weight**2)
    best = np.linalg.solve(normal, LINE.T @ measured / SIGMA**2 + weight**2 * mean)
    scaled = Scaled(np.vstack([LINE / SIGMA, np.diag(weight)]), np.eye(2), NAMES, weight * (best - mean))
    found = discrepancy([evidence((measured - LINE @ best)[:, None])], scaled, np.full(2, 0.5))
    assert abs(best[0] - np.mean(measured)) > 1e-3
    np.testing.assert_allclose(found.shift, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.errors.covariance, np.linalg.inv(normal), rtol=1e-6, atol=1e-20)


def test_an_effect_that_nobody_allows_for_moves_the_parameters():
    change = 0.03 * np.exp(X)
    found, _ = problem(noise(), effect(change))
    [row] = found.contributions
    slope, level = -np.polyfit(X, change, 1)
    np.testing.assert_allclose(row.changes, [level, slope], rtol=1e-6)


def test_what_an_effect_carries_goes_from_the_variance_where_it_is_known():
    """One effect that residuals see in part, and one that they do not."""
    level, bend = effect(np.full(X.size, 0.002)), Effect("bend", 1.0, "nm", (BEND + 0.01)[:, None])
    both, _ = problem(noise(), level, bend)
    for known, other in ((level, bend), (bend, level)):
        [row] = [row for row in both.contributions if row.effect.name == known.name]
        alone, _ = problem(noise(), other)
        lost = both.errors.variance - alone.errors.variance
        np.testing.assert_allclose(row.carries, lost, rtol=1e-5, atol=1e-12)


def test_an_effect_is_found_at_its_size_and_share():
    structure = without_line(BEND)
    found, _ = problem(noise() + 2 * structure, effect(BEND, size=3.0))
    [row] = found.contributions
    assert row.alone == pytest.approx(6.0, rel=0.05)
    total = np.sum((noise() + 2 * structure) ** 2)
    assert row.explains == pytest.approx(1 - np.sum(noise() ** 2) / total, abs=0.01)
    assert found.remaining[0].ratio == pytest.approx(1.0, abs=0.2)
    assert not found.implausible


def test_effects_far_beyond_their_sizes_are_implausible():
    found, _ = problem(noise() + 10 * BEND, effect(BEND))
    assert found.implausible


def test_a_width_cannot_be_negative():
    for kind in ({"power": 2}, {"positive": True}):
        found, _ = problem(noise() - BEND, effect(BEND, **kind))
        assert found.contributions[0].amount == 0.0
        assert found.remaining[0].ratio > 2


def test_a_parameter_does_not_leave_its_bounds():
    """A residual that asks for a level far above the upper end of the box."""
    found, _ = problem(noise() + 5.0, effect(0.01 * X**2))
    assert found.shift[0] == pytest.approx(0.5)


def test_what_remains_widens_the_error_by_its_size_and_correlation():
    plain, _ = problem(noise())
    assert plain.remaining[0].variance == 1.0  # noise by chance
    wave = 3 * SIGMA * np.sqrt(2) * np.cos(8 * np.pi * X)
    wide, _ = problem(without_line(wave), correlation=lambda rest: 7.0)
    assert wide.remaining[0].variance == pytest.approx(9 * 7, rel=0.05)
    ratio = wide.errors.stderr / plain.errors.stderr
    np.testing.assert_allclose(ratio, np.sqrt(wide.remaining[0].variance), rtol=1e-6)
    assert wide.evidence_share == pytest.approx(1 / wide.remaining[0].variance)
    assert plain.evidence_share == 1.0


def test_outliers_hardly_count():
    """Three of 20 standard deviations: 7 without Huber's loss."""
    spiked = noise()
    spiked[[20, 90, 150]] += 0.2
    assert problem(spiked)[0].remaining[0].variance < 3


def test_a_channel_that_is_wrong_as_a_whole_is_no_outlier():
    """As C, but not N and S, where Δ is 180 degrees less than the file has it; in pixels of noise alone, with
    a smooth wave in the second channel, and with more noise there."""
    rest = np.random.default_rng(4).normal(0, 1, (3, 400, 3))
    rest[1, :, 1] += 80 * np.cos(np.arange(400) / 9)
    rest[2, :, 1] *= 50
    noise = np.array([1.0, 1.0, np.sqrt((1 + 1 + 50**2) / 3)])  # of the channels, root mean square
    # the median absolute value of a cosine is 0.707; that of normal noise is 0.6745 standard deviations
    wave, most = 80 * np.sqrt(0.5) / 0.6745, np.median(np.abs(rest[2])) / 0.6745
    assert bulk(rest, noise) == pytest.approx([1.0, wave, most], rel=0.1)


def test_effects_of_the_sample_are_shared_by_its_data():
    """Twice the same data: one shared effect is known better than two of their own."""

    def both(shared):
        one = evidence(noise()[:, None], effect(0.03 * np.exp(X), shared=shared))
        rows = np.vstack([LINE / SIGMA, LINE / SIGMA, np.zeros((2, 2))])
        return discrepancy([one, one], Scaled(rows, np.eye(2), NAMES), np.full(2, 0.5))

    assert len(both(True).contributions) == 1
    assert len(both(False).contributions) == 2
    assert np.all(both(True).errors.stderr > both(False).errors.stderr)


def test_the_amount_of_a_width():
    one = Effect("spread", 2.0, "nm", np.zeros((1, 1)), power=2)
    assert one.amount(1 / HALF_NORMAL) == pytest.approx(2.0)
    assert dataclasses.replace(one, power=1).amount(0.5) == 1.0


@pytest.mark.parametrize("count", [1, 5, 12, 30])
def test_the_threshold_of_the_implausible(count):
    assert improbable(count) == pytest.approx(chi2.isf(1e-3, count), rel=0.04)


@pytest.mark.parametrize(("least", "expected"), [(1.0, 1.0), (10.0, 10.0)])
def test_small_residuals_are_correlated_only_by_their_own_size(least, expected):
    """A tenth of σ, of which 50 points count as one: a factor of 0.5 on σ², less than that of the noise."""
    found, _ = problem(0.1 * noise(), least=least, correlation=lambda rest: 50.0)
    assert found.remaining[0].variance == pytest.approx(expected)
    large, _ = problem(2 * noise(), least=least, correlation=lambda rest: 50.0)
    assert large.remaining[0].variance == pytest.approx(200.0, rel=0.3)
