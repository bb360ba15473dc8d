"""Hoisted coefficients keep their values, and are stored once instead of recomputed at each point."""

from __future__ import annotations

import jax
import numpy as np

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


def test_hoisted_coefficients_are_stored():
    """Only a value that is computed outside the grid's loop takes memory of its own."""
    row, column = np.ones((1, 50)), np.ones((200, 1))

    def temporary_bytes(hoist):
        def grid(row, column):
            power = row
            for _ in range(20):
                power = power * row + 1.0
            return hoist(power, column * row) * column

        return jax.jit(grid).lower(row, column).compile().memory_analysis().temp_size_in_bytes

    assert temporary_bytes(lambda x, _: x) < row.nbytes
    assert temporary_bytes(hoist) >= row.nbytes


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


def test_stored_values_are_computed_once_for_all_their_uses():
    x = np.ones(200)

    def temporary_bytes(stored):
        def both(x):
            power = x
            for _ in range(20):
                power = power * x + 1.0
            power = stored(power)
            return power + x, power * x

        return jax.jit(both).lower(x).compile().memory_analysis().temp_size_in_bytes

    assert temporary_bytes(lambda x: x) < x.nbytes
    assert temporary_bytes(stored) >= x.nbytes
