"""Hoisted coefficients keep their values, and are stored once instead of recomputed at each point."""

import jax
import numpy as np
import pytest

from pellicle.optics.hoisting import hoist, stored
from pellicle.optics.pair import Pair


def test_hoisting_changes_no_value_and_no_slope():
    z = Pair(np.array([0.0, -0.0, 1e-300, 0.1, -7.0, np.inf, np.nan]), None)
    result = hoist(z, np.zeros((8, 7)))
    assert result.im is None
    np.testing.assert_array_equal(result.re, z.re)
    np.testing.assert_array_equal(np.signbit(result.re), np.signbit(z.re))
    slope = jax.jvp(lambda x: hoist(x, np.zeros((8, 2))), (np.ones(2),), (np.full(2, 3.0),))[1]
    np.testing.assert_array_equal(slope, 3.0)


def power(x):
    for _ in range(20):
        x = x * x + 1.0
    return x


def on_a_grid(keep):
    return lambda column, x: keep(power(x), column * x) * column


def in_two_results(keep):
    def results(column, x):
        kept = keep(power(x))
        return kept + x, kept * x

    return results


@pytest.mark.parametrize(("use", "keep"), [(on_a_grid, hoist), (in_two_results, stored)])
def test_kept_values_are_computed_once(use, keep):
    """Only a value that is computed outside the loop of its uses takes memory of its own."""
    column, x = np.ones((200, 1)), np.ones((1, 50))

    def temporary_bytes(keep):
        return jax.jit(use(keep)).lower(column, x).compile().memory_analysis().temp_size_in_bytes

    assert temporary_bytes(lambda x, *_: x) < x.nbytes <= temporary_bytes(keep)


def test_values_used_at_few_points_are_not_hoisted():
    x = np.ones(50)
    assert hoist(x, np.ones((7, 50))) is x


def test_storing_changes_no_value_and_no_slope():
    def function(x, y):
        a, b, c = stored((x, Pair(y, None), 2.0))
        assert b.im is None
        return a * b.re * c

    x, y = np.arange(3.0), np.arange(5.0, 8.0)
    value, slope = jax.jit(lambda x: jax.jvp(lambda x: function(x, y), (x,), (np.ones(3),)))(x)
    np.testing.assert_array_equal(value, 2 * x * y)
    np.testing.assert_array_equal(slope, 2 * y)
