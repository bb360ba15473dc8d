"""What is held keeps its value, and is computed once."""

from __future__ import annotations

import re

import jax
import numpy as np

from pellicle.optics.hoisting import hoist
from pellicle.optics.pair import Pair


def test_hold_changes_nothing():
    z = Pair(np.array([0.0, -0.0, 1e-300, 0.1, -7.0, np.inf, np.nan]), None)
    held = hoist(z, np.zeros((8, 7)))
    assert held.im is None
    np.testing.assert_array_equal(held.re, z.re)
    np.testing.assert_array_equal(np.signbit(held.re), np.signbit(z.re))
    slope = jax.jvp(lambda x: hoist(x, np.zeros((8, 2))), (np.ones(2),), (np.full(2, 3.0),))[1]
    np.testing.assert_array_equal(slope, 3.0)


def test_what_is_held_is_computed_once():
    """A chain of products used at every point of a grid: a loop of its own, or part of the grid's."""

    def loops(hoist):
        def grid(row, column):
            power = row
            for _ in range(20):
                power = power * row + 1.0
            return hoist(power, column * row) * column

        program = jax.jit(grid).lower(np.ones((1, 50)), np.ones((200, 1))).compile()
        return len(re.findall(r" = \S+ fusion\(", program.as_text()))

    assert loops(lambda x, _: x) == 1
    assert loops(hoist) == 2
