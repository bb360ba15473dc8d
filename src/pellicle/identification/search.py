"""Search of a structure's best numbers: a scan of its thicknesses, then Levenberg-Marquardt steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pellicle.identification.problem import Attempt, Problem
from pellicle.identification.signal_view import MANY
from pellicle.identification.structure import Structure

ROUNDS, _TRIED = 25, 4
"""Steps of a polish, most of which need 6 to 12, and those from each of several starts."""
_SCANNED = 2
"""Layers of a scan."""
_ENOUGH = 1e-4
"""Relative fall of χ² below which a polish ends."""
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
    """The best minimum from several starts (numbers,) each: a few steps from all, then more from the best."""
    metric = problem.metric

    def at(x: np.ndarray) -> Attempt:
        values, slopes = problem.linearised(structure, x)
        cost = float(metric.costs((problem.data - values)[None])[0])
        return Attempt(structure, x, values, slopes, cost)

    first = [np.clip(np.asarray(x, float), structure.lower, structure.upper) for x in starts]
    if len(first) == 1:
        return _descended(problem, at, at(first[0]), ROUNDS)
    tried = [_descended(problem, at, at(x), _TRIED) for x in first]
    return _descended(problem, at, min(tried, key=lambda found: found.cost), ROUNDS)


def _descended(problem: Problem, at: Callable[[np.ndarray], Attempt], here: Attempt, rounds: int) -> Attempt:
    """Bounded Levenberg-Marquardt steps: each evaluates a point with its slopes in one call."""
    structure = here.structure
    lower, span, damping, failed = structure.lower, structure.upper - structure.lower, 1e-3, 0
    for _ in range(rounds):
        scaled, residual = here.slopes * span, problem.data - here.values
        gram = problem.metric.gram(scaled, np.concatenate([scaled, residual[:, None]], axis=1))
        normal, gradient = gram[:, :-1], gram[:, -1]
        # a number at its bound that would leave it stays
        unit = (here.x - lower) / span
        free = np.flatnonzero(~((unit <= 1e-9) & (gradient < 0)) & ~((unit >= 1 - 1e-9) & (gradient > 0)))
        if not free.size:
            break
        own, step = normal[np.ix_(free, free)], np.zeros(len(span))
        diagonal = np.diag(own) + 1e-9 * np.trace(own) + 1e-12
        step[free] = np.linalg.solve(own + damping * np.diag(diagonal), gradient[free])
        trial = at(np.clip(here.x + span * step, structure.lower, structure.upper))
        if trial.cost < here.cost:
            gain = (here.cost - trial.cost) / here.cost
            here, damping, failed = trial, max(damping / 5, 1e-9), 0
            if gain < _ENOUGH:
                break
        else:
            damping, failed = damping * 8, failed + 1
            if failed > 4:
                break
    return here
