"""Local minima of a problem: polished in lanes of one compiled program, made distinct, sorted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from logging import getLogger

import numpy as np

from pellicle.effects.averaging import rays_of_axes
from pellicle.fitting.coordinates import widened
from pellicle.fitting.evaluation import Until, polish
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress, quiet

log = getLogger(__name__)

SLOTS = 64
"""Starts that one call of the solver takes."""
STEPS = 100
"""Most steps of one polish."""
_WORK = 2048
"""Data values that are evaluated in one step of the solver, about: lanes of many points are few."""
_SHARED_LANES = 2
"""Lanes of a program that solves several problems, of few points and of many."""
MOST = 16
"""Most minima that are kept."""
_MOST_ROUNDS = 50
"""Polishes of the best minima where the best of all has not settled: some valleys take thousands of steps (an
oscillator's parameters; 2400 on a retroreflective tape, with an exponent at its bound)."""
_GAIN = 1e-6
"""Least relative improvement of the best deviance for which another round is worth its time."""


@dataclass(frozen=True)
class Scan:
    """Deviance of each view at a coarse design of the other parameters, against thickness (nm).

    `deviance` (design, thickness, views) is above that at the best minimum.
    """

    thickness: np.ndarray
    deviance: np.ndarray


@dataclass(frozen=True)
class Minima:
    """Distinct local minima, best first: `units` (minima, parameters) in the unit cube, their deviance, and
    whether the solver settled."""

    units: np.ndarray
    deviance: np.ndarray
    converged: np.ndarray
    scan: Scan | None = None


def solve(
    problem: Problem,
    starts: np.ndarray,
    *,
    fixed: tuple[int, np.ndarray] | None = None,
    steps: int = STEPS,
    atol: float = 0.0,
    coarse: float = 0.0,
    progress: Progress = quiet,
) -> Minima:
    """The local minimum below each start (starts, parameters), in their order.

    `fixed` is the position of a parameter and its value in each start, in the coordinate's unit. A start has
    settled where the deviance would fall by less than `atol`², or by less than the share `coarse` of its
    distance to the best of all. Starts are padded to `SLOTS`, so that one compiled program serves any number.
    """
    box, shape = problem.box, np.shape(starts)
    lower, upper = (np.array(np.broadcast_to(side, shape), dtype=float) for side in (box.lower, box.upper))
    if fixed is not None:
        lower[:, fixed[0]] = upper[:, fixed[0]] = fixed[1]
    rows = max(sum(view.rows * rays_of_axes(view.plan) for view in problem.views), 1)
    family = problem.solved_together
    width = max(member.size for member in family)
    lanes = int(np.clip(2 ** int(np.log2(_WORK / rows)), 2, MOST)) if len(family) == 1 else _SHARED_LANES
    which, pieces = np.int64(family.index(problem.member)), []
    progress("polish", 0, len(starts))
    for first in range(0, len(starts), SLOTS):
        low, high, units = (_padded(x[first : first + SLOTS]) for x in (lower, upper, starts))
        count = min(SLOTS, len(starts) - first)
        until = Until(np.int64(count), np.int64(steps), np.float64(atol), np.float64(coarse), which)
        own = box._replace(lower=low, upper=high).extended(width)
        polished = polish((family, lanes), problem.arrays, own, widened(units, width), until)
        log.debug("polish: %d starts in %d lanes, %d evaluations", count, lanes, polished.steps[:count].sum())
        pieces.append([np.asarray(column)[:count] for column in polished[:3]])
        progress("polish", min(first + SLOTS, len(starts)), len(starts))
    units, deviance, converged = (np.concatenate(column) for column in zip(*pieces, strict=True))
    units = units[:, : len(problem.parameters)]
    return Minima(units, np.where(np.isfinite(deviance), deviance, np.inf), converged)


def deviance_at(problem: Problem, units: np.ndarray) -> np.ndarray:
    """Deviance of all views and priors at points (points, parameters) of the unit cube.

    By the program of `solve`, whose first step evaluates its starts: a fit has compiled it already.
    """
    return solve(problem, units, steps=1).deviance


def _padded(rows: np.ndarray) -> np.ndarray:
    return np.concatenate([rows, np.repeat(rows[-1:], SLOTS - len(rows), axis=0)])


def minima(
    problem: Problem,
    starts: np.ndarray,
    progress: Progress = quiet,
    *,
    most: int = MOST,
    followed: int = MOST,
    coarse: float = 0.0,
) -> Minima:
    """The distinct local minima below `starts` (starts, parameters), best first.

    While the best has not settled, the best `followed` minima are polished again; none where that is 0.
    """
    return settled(problem, solve(problem, starts, coarse=coarse, progress=progress), most, followed, coarse)


def settled(
    problem: Problem, polished: Minima, most: int = MOST, followed: int = MOST, coarse: float = 0.0
) -> Minima:
    """The distinct ones of polished minima, best first; the best of them polished on as in `minima`."""
    units, deviance, converged = (
        np.array(x) for x in (polished.units, polished.deviance, polished.converged)
    )
    for _ in range(_MOST_ROUNDS if followed else 0):
        best = np.argsort(deviance, kind="stable")[:followed]
        before = deviance[best[0]]
        if converged[best[0]] or not np.isfinite(before):
            break
        again = solve(problem, units[best], coarse=coarse)
        units[best], deviance[best], converged[best] = again.units, again.deviance, again.converged
        if before - deviance.min() <= _GAIN * abs(before) and not converged[np.argmin(deviance)]:
            break
    return distinct(problem, Minima(units, deviance, converged), most)


def distinct(problem: Problem, minima: Minima, most: int) -> Minima:
    """At most `most` minima, best first, those of one place once."""
    order, units = np.argsort(minima.deviance, kind="stable"), minima.units
    columns = zip(problem.parameters, units.T, strict=True)
    resolution = np.stack([p.resolutions_at(column) for p, column in columns], axis=1)
    kept: list[int] = []
    for i in order[np.isfinite(minima.deviance[order])].tolist():
        if (np.abs(units[i] - units[kept]) > resolution[i]).any(axis=1).all():
            kept.append(i)
        if len(kept) == most:
            break
    kept = kept or [int(order[0])]
    return replace(
        minima, units=minima.units[kept], deviance=minima.deviance[kept], converged=minima.converged[kept]
    )
