"""Search of a structure's best numbers: a scan of its thicknesses, then Levenberg-Marquardt steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pellicle.identification.problem import Attempt, Problem
from pellicle.identification.signal_view import MANY
from pellicle.identification.structure import Structure

ROUNDS, _TRIED = 25, 4
"""Steps of a polish, most of which need 6 to 12, and those from each of several starts."""
_SCANNED = 2
"""Layers of a scan."""
_ENOUGH, _FAILURES = 1e-4, 4
"""Relative fall of χ² below which a polish ends, and steps without a fall that it takes."""
_RIVAL = 20.0
"""χ² above the best up to which another minimum of a structure is a rival: twice what excludes it, and what
effects of the sample make up for."""
THICK = 20_000.0
"""Largest thickness (nm) that is tried."""


def thickness_grid(problem: Problem) -> np.ndarray:
    """Thicknesses (nm) of a scan, a fifth of the closest fringe's period apart and closer where thin."""
    shortest = min(view.spectrum.wavelength[0] for view in problem.views)
    most = problem.thickest
    step = max(shortest / 30, most / 4000)
    return np.union1d(np.geomspace(1.0, min(300.0, most), 40), np.arange(2.0, most, step))


def scan(
    problem: Problem, indices: Sequence[list[np.ndarray]], depth: np.ndarray, shift: float = 0.0
) -> np.ndarray:
    """χ² (rows,) of layers with thicknesses `depth` (rows, layers); `indices` are theirs in each view.

    An index is (padded points,), the same for all rows; `shift` (degrees) is added to the angle of incidence.
    """
    costs = []
    for first in range(0, len(depth), MANY):
        rows = depth[first : first + MANY]
        values = []
        for view, own in zip(problem.views, indices, strict=True):
            media = [np.ones_like(own[0])] * (_SCANNED - len(own)) + own
            index = np.broadcast_to(np.stack(media), (len(rows), _SCANNED, view.wavelength.size))
            values.append(view.simulate(index, np.pad(rows, ((0, 0), (_SCANNED - len(own), 0))), shift))
        costs.append(problem.metric.costs(np.concatenate(values, axis=1) - problem.data))
    return np.concatenate(costs)


def minima(costs: np.ndarray, most: int) -> np.ndarray:
    """Positions of the lowest local minima of `costs` along a grid."""
    edge = np.concatenate([[np.inf], costs, [np.inf]])
    low = np.flatnonzero((edge[1:-1] <= edge[:-2]) & (edge[1:-1] <= edge[2:]))
    return low[np.argsort(costs[low])][:most]


def polished(problem: Problem, structure: Structure, starts: Sequence[np.ndarray]) -> Attempt:
    """The best minimum from several starts (numbers,) each."""
    return rivals(problem, structure, starts)[0]


def rivals(problem: Problem, structure: Structure, starts: Sequence[np.ndarray]) -> list[Attempt]:
    """Distinct minima from several starts (numbers,) each, the best and those nearly as good: a few steps
    from all, then more from these."""

    def at(_: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return problem.linearised(structure, x)

    x, bounds = np.stack(starts), (structure.lower, structure.upper)
    if len(x) > 1:
        x = _distinct(structure, descended(problem, at, x, bounds, _TRIED), 2 * _RIVAL).x
    found = _distinct(structure, descended(problem, at, x, bounds, ROUNDS), _RIVAL)
    return [
        Attempt(structure, x, y, slopes.T, float(cost)) for x, y, slopes, cost in zip(*found, strict=True)
    ]


def _distinct(structure: Structure, found: Descent, most: float) -> Descent:
    """Rows up to `most` of χ² above the best, the best first, without those of nearly equal thicknesses."""
    kept: list[int] = []
    depth = structure.thicknesses(found.x)
    for i in np.argsort(found.cost):
        near = [np.all(np.abs(depth[i] - depth[j]) < 3.0 + 0.03 * depth[j]) for j in kept]
        if not any(near) and (not kept or found.cost[i] < found.cost[kept[0]] + most):
            kept.append(int(i))
    return Descent(*(rows[kept] for rows in found))


class Descent(NamedTuple):
    """Rows of numbers at the end of steps: values (rows, values), slopes (rows, numbers, values), χ²."""

    x: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    cost: np.ndarray


def descended(
    problem: Problem,
    at: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    x: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    rounds: int,
    prior: np.ndarray | float = 0.0,
) -> Descent:
    """Bounded Levenberg-Marquardt steps from many rows of numbers `x` (rows, numbers) at once.

    `at(rows, x)` returns the values and slopes of these rows; each step evaluates a point of every row that
    still falls. `prior` is the inverse variance of numbers around 0, (rows or 1, numbers).
    """
    data, metric = problem.data, problem.metric
    lower, upper, prior = (np.broadcast_to(b, x.shape) for b in (*bounds, prior))
    span, unit = np.where(upper > lower, upper - lower, 1.0), np.eye(x.shape[1])
    x = np.clip(x, lower, upper)
    trial, best = x.copy(), np.full(len(x), np.inf)
    damping, failed = np.full(len(x), 5e-3), np.zeros(len(x), int)
    values, slopes = np.zeros((len(x), data.size)), np.zeros((*x.shape, data.size))
    normal, gradient, rows = np.zeros((*x.shape, len(unit))), np.zeros(x.shape), np.arange(len(x))
    for _ in range(rounds + 1):
        new, by = at(rows, trial)
        left = data - new
        cost = metric.costs(left) + np.sum(prior[rows] * trial**2, axis=1)
        better = cost < best[rows]
        done = better & (best[rows] - cost < _ENOUGH * np.minimum(best[rows], 1e300))
        on = rows[better]
        x[on], values[on], slopes[on], best[on] = trial[better], new[better], by[better], cost[better]
        own, pull = metric.grams(slopes[on] * span[on][..., None], left[better])
        pinned = prior[on] * span[on]
        normal[on] = own + (pinned * span[on])[:, None] * unit
        gradient[on] = pull - pinned * x[on]
        failed[rows] = np.where(better, 0, failed[rows] + 1)
        damping[rows] = np.where(better, np.maximum(damping[rows] / 5, 1e-9), damping[rows] * 8)
        # a number at its bound that would leave it stays
        free = ~((x <= lower) & (gradient < 0) | (x >= upper) & (gradient > 0) | (lower == upper))
        rows = rows[~done & (failed[rows] <= _FAILURES) & free[rows].any(axis=1)]
        if not rows.size:
            break
        held = ~free[rows]
        matrix = normal[rows] * ~(held[:, :, None] | held[:, None])
        diagonal = np.einsum("rii->ri", matrix)
        diagonal = diagonal + 1e-9 * diagonal.sum(axis=1, keepdims=True) + 1e-12
        matrix = matrix + (damping[rows, None] * diagonal + held)[..., None] * unit
        step = np.linalg.solve(matrix, (gradient[rows] * ~held)[..., None])[..., 0]
        trial = np.clip(x[rows] + span[rows] * step, lower[rows], upper[rows])
    return Descent(x, values, slopes, best)
