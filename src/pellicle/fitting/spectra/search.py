"""Where to start: interference makes the misfit multi-modal, so the whole range is scanned first.

A single start finds the right thickness in one case of ten. The scan's thickness step resolves the
shortest fringe, the other parameters take a few values each, and only *local minima in thickness*
go on to the solver: otherwise the best starts are all neighbours.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from pellicle.fitting.spectra import logging
from pellicle.fitting.spectra.evaluation import evidences, polish
from pellicle.fitting.spectra.parameters import Parameter
from pellicle.fitting.spectra.problem import Problem, thin

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much is done and how much there is."""


def quiet(what: str, done: int, total: int) -> None:
    """Progress that nobody watches."""


SCAN_POINTS = 448
"""Wavelengths used while scanning: enough for four samples in a fringe of 5 µm at index 2."""
_CHUNK = 256
LANES = 16
_MOST_STEPS = 4000
_MOST_DESIGNS = 1200
_MORE_ROUNDS = 8
"""So often the best minima go on from where they stopped, while the best of all has not settled: where many
numbers trade (an oscillator's), some crawl."""


@dataclass(frozen=True)
class Scan:
    """The misfit of each view at a coarse design of the other parameters, against thickness (nm).

    `evidence` (design, thickness, views) is above that at the best minimum.
    """

    thickness: np.ndarray
    evidence: np.ndarray


@dataclass(frozen=True)
class Minima:
    """Polished local minima, best first, in the unit cube."""

    units: np.ndarray
    evidence: np.ndarray
    converged: np.ndarray
    scan: Scan | None


def search(problem: Problem, progress: Progress) -> Minima:
    """Scan the box, polish the best distinct local minima, sort them."""
    thinned = problem._replace(views=tuple(thin(view, SCAN_POINTS) for view in problem.views))
    depth = problem.thickness_axis
    grid = _thickness_grid(problem)
    design = _design(problem)
    units = np.repeat(design, max(len(grid), 1), axis=0)
    logging.of_scan(problem, len(grid), len(design))
    if depth is not None:
        units[:, depth] = np.tile(grid, len(design))
    table = scanned(thinned, units, progress).reshape(len(design), max(len(grid), 1), -1)
    batches = 1 if len(design) == 1 else 3 if len(problem.parameters) < 4 else 6
    starts = units[_local_minima(table.sum(-1), most=batches * LANES)]
    minima = polished(problem, starts, progress)
    logging.of_minima(problem, len(starts), minima.units, minima.converged)
    if depth is None:
        return minima
    p = problem.parameters[depth]
    seen = np.concatenate([scanned(thinned, minima.units[:1], quiet), table.reshape(len(units), -1)])
    lowest = seen[np.argmin(seen.sum(-1))]
    return replace(minima, scan=Scan(p.lower + grid * (p.upper - p.lower), table - lowest))


def polished(problem: Problem, starts: np.ndarray, progress: Progress) -> Minima:
    """The distinct local minima reached from `starts`, best first."""
    bounds, solve = (problem.box.lower, problem.box.upper), solver(problem)
    units, evidence, converged = in_lanes(solve, bounds, starts, progress)
    order = np.argsort(evidence, kind="stable")
    for _ in range(_MORE_ROUNDS):
        if converged[order[0]]:
            break
        best = order[:LANES]
        units[best], evidence[best], converged[best] = in_lanes(solve, bounds, units[best], progress)
        order = np.argsort(evidence, kind="stable")
    kept: list[int] = []
    for i in order:
        if np.isfinite(evidence[i]) and all(_apart(problem, units[i], units[j]) for j in kept):
            kept.append(int(i))
    kept = (kept or [int(order[0])])[:LANES]
    return Minima(units[kept], evidence[kept], converged[kept], None)


def _apart(problem: Problem, a: np.ndarray, b: np.ndarray) -> bool:
    """Two minima, not one: thickness by half a nanometre and 0.2 %, or others by 2 % of their range."""
    for p, x, y in zip(problem.parameters, a, b, strict=True):
        span = p.upper - p.lower
        value = abs(p.lower + x * span)
        tolerance = max(0.5, 0.002 * value) / span if p.key == "thickness" else 0.02
        if abs(x - y) > tolerance:
            return True
    return False


def _thickness_grid(problem: Problem) -> np.ndarray:
    """Positions in 0..1 no further apart than λ_min/(8 n_max): an eighth of the shortest fringe's period
    in optical thickness, as n_max is the largest that the bounds allow."""
    if problem.thickness_axis is None:
        return np.zeros(0)
    p = problem.parameters[problem.thickness_axis]
    step = problem.shortest / 8
    count = int(np.clip(np.ceil((p.upper - p.lower) / step) + 1, 9, _MOST_STEPS))
    return np.linspace(0.0, 1.0, count)


def _design(problem: Problem) -> np.ndarray:
    """A few values of every parameter but the scanned thickness, as points of the unit cube."""
    levels = [_levels(p, problem) for p in problem.parameters]
    if problem.thickness_axis is not None:
        levels[problem.thickness_axis] = np.zeros(1)
    groups: dict[str, list[int]] = {}
    for i, p in enumerate(problem.parameters):
        groups.setdefault(p.together, []).append(i)
    free = [levels[members[0]] for members in groups.values()]
    while np.prod([len(level) for level in free]) > _MOST_DESIGNS:
        longest = max(range(len(free)), key=lambda i: len(free[i]))
        free[longest] = _even(len(free[longest]) - 1)
    design = np.array(list(itertools.product(*free))).reshape(-1, len(free))
    found = np.empty((len(design), len(levels)))
    for column, members in zip(design.T, groups.values(), strict=True):
        found[:, members] = column[:, None]
    return found


def _even(count: int) -> np.ndarray:
    return (np.arange(count) + 0.5) / count


def _levels(p: Parameter, problem: Problem) -> np.ndarray:
    if not p.searched:
        return np.array([(p.value - p.lower) / (p.upper - p.lower)])
    if p.key == "k":
        return np.array([0.001, 0.01, 0.05, 0.15, 0.4])
    if p.levels is not None:
        return _even(p.levels)
    count = np.ceil((p.upper - p.lower) / 0.2)
    if p.key == "B":
        count = np.ceil(_dispersion_fringes(p, problem))
    if p.key == "thickness":
        step = problem.shortest / 4
        return _even(int(np.clip(np.ceil((p.upper - p.lower) / step), 3, 24)))
    return _even(int(np.clip(count, 3, 8)))


def _dispersion_fringes(p: Parameter, problem: Problem) -> float:
    """By how many fringes the ends of the spectra part over the bounds of Cauchy's B."""
    thickest = max([q.upper for q in problem.parameters if q.key == "thickness"], default=1000.0)
    wavelengths = [view.scene.light.wavelength for view in problem.views]
    blue, red = min(nm.min() for nm in wavelengths), max(nm.max() for nm in wavelengths)
    return 2 * min(thickest, 2000.0) / blue * (p.upper - p.lower) * (1 / blue**2 - 1 / red**2)


def scanned(problem: Problem, units: np.ndarray, progress: Progress) -> np.ndarray:
    """Evidence of every candidate in each view, in chunks of one shape: one program, and room for Ctrl-C."""
    found = np.empty((len(units), len(problem.views)))
    for first in range(0, len(units), _CHUNK):
        chunk = units[first : first + _CHUNK]
        padded = np.concatenate([chunk, np.repeat(chunk[-1:], _CHUNK - len(chunk), axis=0)])
        for column, view in zip(found.T, problem.views, strict=True):
            evidence = evidences(*view.program, padded[:, list(view.takes)]).evidence
            column[first : first + _CHUNK] = np.asarray(evidence)[: len(chunk)]
        progress("scan", min(first + _CHUNK, len(units)), len(units))
    return np.where(np.isfinite(found), found, np.inf)


def _local_minima(table: np.ndarray, most: int) -> np.ndarray:
    """Flat indices of the lowest local minima along the thickness axis of (design, thickness)."""
    wall = np.full((len(table), 1), np.inf)
    left, right = np.hstack([wall, table[:, :-1]]), np.hstack([table[:, 1:], wall])
    lowest = np.flatnonzero(((table <= left) & (table <= right)).ravel())
    return lowest[np.argsort(table.ravel()[lowest])][:most]


Solve = Callable[[np.ndarray, np.ndarray, np.ndarray], Sequence[Any]]
"""(lower, upper, starts), each (lanes, parameters) → (points in the unit cube, misfits, converged)."""


def held(
    solve: Solve, bounds: tuple[np.ndarray, np.ndarray], which: int, values: np.ndarray, starts: np.ndarray
) -> np.ndarray:
    """The least misfit, (values,), with one parameter held at each value and the others polished.

    `starts` (values, starts, parameters) are in the unit cube between the `bounds`.
    """
    at = np.repeat(values, starts.shape[1])
    _, misfit, _ = in_lanes(solve, bounds, starts.reshape(len(at), -1), quiet, (which, at))
    return misfit.reshape(len(values), -1).min(axis=1)


def in_lanes(
    solve: Solve,
    bounds: tuple[np.ndarray, np.ndarray],
    starts: np.ndarray,
    progress: Progress,
    hold: tuple[int, np.ndarray] | None = None,
):
    """Minima below the starts, in lanes of one shape: one program. `hold` fixes one parameter of each."""
    lower, upper = (np.tile(side, (len(starts), 1)) for side in bounds)
    if hold is not None:
        lower[:, hold[0]] = upper[:, hold[0]] = hold[1]
    pieces = []
    for first in range(0, len(starts), LANES):
        lanes = [_padded(x[first : first + LANES]) for x in (lower, upper, starts)]
        pieces.append([np.asarray(column)[: len(starts) - first] for column in solve(*lanes)])
        progress("polish", min(first + LANES, len(starts)), len(starts))
    units, misfit, converged = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return units, np.where(np.isfinite(misfit), misfit, np.inf), converged


def solver(problem: Problem) -> Solve:
    """The polish of a problem of spectra."""
    looks, scenes, data, box = problem.program

    def solve(lower: np.ndarray, upper: np.ndarray, units: np.ndarray) -> Sequence[Any]:
        return jax.device_get(polish(looks, scenes, data, box._replace(lower=lower, upper=upper), units))

    return solve


def _padded(lanes: np.ndarray) -> np.ndarray:
    return np.concatenate([lanes, np.repeat(lanes[-1:], LANES - len(lanes), axis=0)])
