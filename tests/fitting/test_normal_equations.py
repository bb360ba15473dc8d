"""Least squares of many fits by normal equations, against those of each by its rows."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pellicle.fitting.normal_equations import Normal, covariances, held_within, times


def test_solutions_stay_on_bounds():
    # without bounds (1, -1); with the second held at 0 the first solves 2 x = 1
    covariance = np.linalg.inv([[[2.0, 1.0], [1.0, 2.0]]])
    lower, upper = np.array([[-9.0, 0.0]]), np.full((1, 2), 9.0)
    found = held_within(np.array([[1.0, -1.0]]), covariance, lower, upper)
    assert found == pytest.approx(np.array([[0.5, 0.0]]))


def test_solutions_within_bounds_are_those_of_each_fit():
    """Of one bounded coefficient, where what is held is never let go."""
    rng = np.random.default_rng(0)
    rows, data = rng.normal(size=(50, 20, 6)) + rng.normal(size=(50, 20, 1)), rng.normal(size=(50, 20))
    lower, upper = np.tile([-np.inf] * 5 + [-0.1], (50, 1)), np.tile([np.inf] * 5 + [0.1], (50, 1))
    covariance = covariances(rows)
    free = times(covariance @ np.swapaxes(rows, 1, 2), data)
    found = held_within(free, covariance, lower, upper)
    expected = [lsq_linear(*one, (lower[0], upper[0]), tol=1e-14).x for one in zip(rows, data, strict=True)]
    assert found == pytest.approx(np.array(expected), abs=1e-6)
    assert np.any(found[:, 5] == 0.1)


@pytest.mark.parametrize("nearly", [1e-2, 1e-7, 0.0])
def test_columns_that_are_nearly_the_same(nearly):
    """Variances have all digits however alike the columns are, and are huge where they are the same."""
    rng = np.random.default_rng(1)
    rows, data = rng.normal(size=(3, 50, 2)), rng.normal(size=(3, 50))
    rows[1, :, 1] = rows[1, :, 0] + nearly * rows[1, :, 1]
    transposed = np.swapaxes(rows, 1, 2)
    normal = Normal(transposed @ rows, times(transposed, data), lambda fit: (rows[fit], data[fit]))
    solution, covariance = normal.solved()
    if not nearly:
        assert np.all(covariance[1].diagonal() > 1e20)
        assert np.sum(solution[1]) == pytest.approx(np.linalg.lstsq(rows[1, :, :1], data[1])[0][0])
        return
    root = np.linalg.inv(np.linalg.qr(rows)[1])
    assert covariance == pytest.approx(root @ np.swapaxes(root, 1, 2), rel=1e-5)
    expected = [np.linalg.lstsq(*one, rcond=None)[0] for one in zip(rows, data, strict=True)]
    assert solution == pytest.approx(np.array(expected), rel=1e-5)
