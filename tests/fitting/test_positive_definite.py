"""Small least-squares problems with signs, against SciPy's bounded least squares."""

import jax
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pellicle.fitting.positive_definite import nonnegative


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
