"""Covariance where residuals stand for the noise of their points: the sandwich estimator."""

import numpy as np
import pytest
from scipy.stats import norm, t

from pellicle.fitting.covariance import Scaled, errors

X = np.linspace(0.0, 1.0, 40)
DESIGN = np.stack([np.ones(40), X, np.exp(-((X - 0.5) ** 2) / 0.05)], axis=1)
NAMES = ("a", "b", "c")


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def _scaled(design):
    """A Jacobian with rows of priors that say nothing."""
    return Scaled(np.vstack([design, 1e-9 * np.eye(3)]), np.eye(3), NAMES)


def test_one_channel_agrees_with_hc3_written_out(rng):
    residual = rng.standard_normal(40) * (1 + 5 * X)
    bread = np.linalg.inv(DESIGN.T @ DESIGN)
    leverage = np.diag(DESIGN @ bread @ DESIGN.T)
    expected = bread @ DESIGN.T @ np.diag((residual / (1 - leverage)) ** 2) @ DESIGN @ bread
    influence = (bread @ DESIGN.T) ** 2
    freedom = influence.sum(axis=1) ** 2 / (influence**2).sum(axis=1)  # Satterthwaite's
    wider = t.ppf(norm.cdf(1), freedom)
    found = errors(_scaled(DESIGN), {0: residual[:, None]})
    np.testing.assert_allclose(found.covariance, expected * np.outer(wider, wider), rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(found.by_curvature, bread, rtol=1e-9, atol=1e-12)


def test_correlated_channels_count_together(rng):
    """The same samples three times over in channels that err alike are no more than once."""
    residual = rng.standard_normal(40)[:, None]
    once = errors(_scaled(DESIGN), {0: residual})
    thrice = errors(_scaled(np.repeat(DESIGN, 3, axis=0)), {0: np.repeat(residual, 3, axis=1)})
    np.testing.assert_allclose(thrice.covariance, once.covariance, rtol=1e-6)


def test_z_under_uneven_noise_is_that_of_a_normal_distribution(rng):
    """2000 data sets whose noise is ten times larger in the peak; with one noise for all, z of c is 1.4."""
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


def test_only_views_without_a_noise_of_their_own_are_changed(rng):
    """Rows of a second view keep their weights."""
    design = np.vstack([DESIGN, 100 * DESIGN])
    found = errors(_scaled(design), {0: 3 * rng.standard_normal((40, 1))})
    expected = np.linalg.inv(DESIGN.T @ DESIGN) / 10001
    assert np.diag(found.covariance) == pytest.approx(np.diag(expected), rel=0.01)
