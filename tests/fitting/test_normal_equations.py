"""Small least-squares problems, many at once or with signs, against each by its rows and by SciPy."""

import jax
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pellicle.fitting.normal_equations import Normal, covariances, held_within, times
from pellicle.fitting.positive_definite import nonnegative


def test_solutions_stay_on_bounds():
    # without bounds (1, -1); with the second held at 0 the first solves 2 x = 1
    covariance = np.linalg.inv([[[2.0, 1.0], [1.0, 2.0]]])
    lower, upper = np.array([[-9.0, 0.0]]), np.full((1, 2), 9.0)
    found = held_within(np.array([[1.0, -1.0]]), covariance, lower, upper)
    assert found == pytest.approx(np.array([[0.5, 0.0]]))


@pytest.mark.parametrize("bounded", [1, 4, 6])
def test_solutions_within_bounds_are_those_of_each_fit(bounded):
    """With several bounded coefficients some are held on the way that the solution lets go."""
    rng = np.random.default_rng(0)
    rows, data = rng.normal(size=(50, 20, 6)) + rng.normal(size=(50, 20, 1)), rng.normal(size=(50, 20))
    upper = np.tile([np.inf] * (6 - bounded) + [0.1] * bounded, (50, 1))
    lower = -upper
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


@pytest.mark.parametrize("bounded", [np.arange(7) >= 0, np.arange(7) >= 4, np.arange(7) < 0])
def test_signs_as_in_bounded_least_squares(bounded):
    random = np.random.default_rng(1)
    smooth = np.vander(np.linspace(-1, 1, 30), 7)  # columns that nearly depend on each other
    columns = smooth + 0.1 * random.standard_normal((200, 30, 7))
    values = random.standard_normal((200, 30))
    matrix, b = np.einsum("spi,spj->sij", columns, columns), np.einsum("spi,sp->si", columns, values)
    solve = jax.jit(jax.vmap(lambda matrix, b: nonnegative(matrix, b, bounded, 0.0)))
    inverses, found = map(np.asarray, solve(matrix, b))
    lower = np.where(bounded, 0.0, -np.inf)
    expected = [
        lsq_linear(x, y, (lower, np.inf), "bvls", tol=1e-15).x for x, y in zip(columns, values, strict=True)
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)
    for inverse, own, x in zip(inverses, matrix, found, strict=True):
        free = np.flatnonzero(~bounded | (x > 0))
        part = np.zeros((7, 7))
        part[np.ix_(free, free)] = np.linalg.inv(own[np.ix_(free, free)])
        np.testing.assert_allclose(inverse, part, rtol=1e-9, atol=1e-9 * np.max(np.abs(part)))


def test_a_variable_within_the_slack_stays_free():
    matrix, b = np.diag([1.0, 2.0]), np.array([-1e-7, 2.0])
    for slack, expected in ((1e-6, -1e-7), (1e-8, 0.0)):
        _, x = nonnegative(matrix, b, np.array([True, True]), slack)
        np.testing.assert_allclose(x, [expected, 1.0], rtol=1e-12)
