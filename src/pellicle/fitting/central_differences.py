"""Slopes by central differences: first answers of programs that take seconds to compile.

NumPy evaluates a formula at points on both sides of each parameter, which compiles nothing. Its slopes have
some ten digits: an answer moves by less than 1e-6 of a standard error.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

_LEAST, _ENOUGH = 1e-7, 1e-6
"""Change of a function, as a share of its size, below which rounding errors show in its slope, and that which
a longer step aims at."""
_LONGER = 1e4
"""Factor by which a step grows at most: what no longer step shows is no slope."""

Function = Callable[[np.ndarray], tuple[np.ndarray, ...]]
"""Points (points, parameters) → arrays (points, ...)."""


class Slopes(NamedTuple):
    """Arrays (points, ...) of a function at points, and their slopes (points, ..., parameters)."""

    values: tuple[np.ndarray, ...]
    slopes: tuple[np.ndarray, ...]


def steps_within(at: np.ndarray, step: np.ndarray, lower: Any, upper: Any) -> tuple[np.ndarray, np.ndarray]:
    """Distances of two points from each number: one step to either side, or one and two from a wall."""
    low, high = at - step < lower, at + step > upper
    return np.where(high, -step, step), np.where(low, 2 * step, np.where(high, -2 * step, -step))


def evaluations(parameters: int) -> int:
    """Number of points that the slopes at one point take."""
    return 2 * parameters + 1


def central_differences(function: Function, at: np.ndarray, distances: Sequence[np.ndarray]) -> Slopes:
    """Values and slopes at points `at` (points, parameters) by those at two `distances` of each parameter,
    exact for parabolas."""
    count, size = at.shape
    alone = np.eye(size)[:, None]
    each = [at[None], *(at + alone * distance for distance in distances)]
    found = function(np.concatenate(each).reshape(-1, size))
    first, second = distances
    near, far = second / (first * (second - first)), first / (second * (first - second))
    weights = -(near + far), near, far

    def slope(x: np.ndarray) -> np.ndarray:
        rows = x[:1], x[1 : size + 1], x[size + 1 :]
        own = (w.T.reshape(size, count, *[1] * (x.ndim - 2)) for w in weights)
        total: Any = sum(w * row for w, row in zip(own, rows, strict=True))
        return np.moveaxis(total, 0, -1)

    arrays = [x.reshape(2 * size + 1, count, *x.shape[1:]) for x in found]
    return Slopes(tuple(x[0] for x in arrays), tuple(map(slope, arrays)))


def around(function: Function, at: np.ndarray, step: np.ndarray) -> Slopes:
    """Values and slopes at one point (parameters,), without the axis of points.

    A step is lengthened until the first array changes by more than rounding errors. A number that is not
    negative stays so: thicknesses and extinctions have a wall at zero.
    """
    wall = np.where(at >= 0, 0.0, -np.inf)

    def with_steps(step: np.ndarray) -> Slopes:
        steps = steps_within(at, step, wall, np.inf)
        found = central_differences(function, at[None], [x[None] for x in steps])
        return Slopes(*(tuple(x[0] for x in arrays) for arrays in found))

    found = with_steps(step)
    size = np.max(np.abs(found.values[0]))
    change = np.max(np.abs(found.slopes[0].reshape(-1, len(at))), axis=0) * step
    if np.all(change >= _LEAST * size):
        return found
    longer = np.clip(_ENOUGH * size / np.maximum(change, 1e-300), 1.0, _LONGER)
    return with_steps(np.where(change < _LEAST * size, longer * step, step))
