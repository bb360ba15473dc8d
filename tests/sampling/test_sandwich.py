"""Draws stretched to the covariance of the sandwich estimator, in two minima and beside a bound."""

import numpy as np

from pellicle.fitting.covariance import Errors
from pellicle.sampling.density import Modes, sandwich_stretch, unchanged

CENTRES = np.array([[0.3, 0.5], [0.7, 0.02]])
NARROW = 1e-4 * np.array([[1.0, 0.6], [0.6, 2.0]])
WIDE = 1e-4 * np.array([[4.0, 1.5], [1.5, 3.0]])
RANGES = np.diag([1000.0, 2.0])


def _stretch():
    modes = Modes(CENTRES, np.array([np.linalg.cholesky(NARROW)] * 2), np.array([0.8, 0.2]))
    errors = Errors(("thickness", "n"), RANGES @ WIDE @ RANGES, RANGES @ NARROW @ RANGES)
    return sandwich_stretch(errors, RANGES, modes)


def test_draws_of_each_minimum_get_the_covariance_of_the_fit():
    rng = np.random.default_rng(0)
    draws = CENTRES[0] + rng.standard_normal((50_000, 2)) @ np.linalg.cholesky(NARROW).T
    found = _stretch()(draws.reshape(500, 100, 2)).reshape(-1, 2)
    np.testing.assert_allclose(np.cov(found.T), WIDE, atol=0.02 * WIDE.max())
    np.testing.assert_allclose(found.mean(axis=0), CENTRES[0], atol=3e-4)


def test_draws_stay_within_the_bounds():
    draws = CENTRES[1] + np.array([[0.01, -0.019], [-0.02, -0.015], [0.02, 0.01]])
    found = _stretch()(draws)
    assert np.all((found >= 0) & (found <= 1))


def test_a_fit_with_a_given_noise_leaves_them():
    modes = Modes(CENTRES, np.array([np.linalg.cholesky(NARROW)] * 2), np.array([0.8, 0.2]))
    errors = Errors(("thickness", "n"), RANGES @ WIDE @ RANGES)
    assert sandwich_stretch(errors, RANGES, modes) is unchanged
