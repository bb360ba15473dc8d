"""Search for minima of a film: interference makes the misfit multi-modal, so the whole range is scanned.

A single start finds the right thickness in one case of ten. The scan's thickness step resolves the
shortest fringe, the other parameters take a few values each, and only *local minima in thickness*
go on to the solver: otherwise the best starts are all neighbours. The lowest are polished at once. Any
other thickness at which the misfit, least over the other parameters, has a local minimum is an interference
order of its own: it is polished too, unless it is further above the best minimum than polishing has lowered
any start by. The period of the fringes (`fringes.py`) proposes more.
"""

import itertools
from dataclasses import replace
from logging import getLogger
from typing import Any

import numpy as np

from pellicle.fitting.evaluation import scanned
from pellicle.fitting.film.fringes import proposed
from pellicle.fitting.film.problem import shortest_wavelength
from pellicle.fitting.film.sample_search import sample_parts, search_samples
from pellicle.fitting.minima import MOST, SLOTS, Minima, Scan, settled, solve
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress

log = getLogger(__name__)

_MOST_STEPS, _MOST_CANDIDATES = 4000, 400_000
"""Values of the thickness that are scanned at most: so many, or more while all candidates are not as many."""
_MOST_DESIGNS, _FEW_DESIGNS = 1200, 40
_COARSE = 1e-3
"""Share of its distance to the best deviance within which a minimum is computed at first; those that remain
are computed to the end when they are ranked."""
_REACH = 1.25
"""An order is polished unless ‖r‖ is above the best by so many times the largest fall by polishing."""
_CHANCE = 20.0
"""Δχ² in units of the noise that an order may be above the best and is polished in any case: three times
that of a rival, as correlated residuals count for less."""
_NEAR, _INDEX = 4, 0.4
"""Candidates that are polished near the thickness that the fringes suggest, and the difference of ln n up to
which they are near: from 1.3 to 2.0, or back."""
_NARROW = 0.05
_WIDTHS = {"bandwidth": 0.5, "thickness_spread": 4.0, "roughness": 1.0, "angle_spread": 0.5}
"""Position between its bounds at which a width starts that has no start of its own, and the largest value
there, in its unit: in the middle of wide bounds no fringe is left."""
_BROADER = (1.0, 8.0, 32.0)
"""Multiples of that value at which it starts: with fringes of another contrast than the data's the best order
is another one. Two of them are scanned; all are starts from the best minimum."""
_PERIOD = 0.08
"""Difference of ln thickness up to which a candidate is near what the period of the fringes suggests by the
index of the best minimum."""
_MOST_POLISHED = 2048
"""Starts after which no more are polished."""


def search(problem: Problem, progress: Progress, quick: bool = False) -> Minima:
    """Scan the box, polish the best distinct local minima, sort them; `quick` with few values of parameters
    other than the thickness, and the lowest orders alone."""
    if len(samples := sample_parts(problem)) > 1:
        return search_samples(problem, samples, search, progress)
    thinned, depth = problem.thinned(), problem.thickness_axis
    design = design_points(problem, _FEW_DESIGNS if quick else _MOST_DESIGNS)
    grid = thickness_grid(problem, len(design))
    units = np.repeat(design, max(len(grid), 1), axis=0)
    if depth is not None:
        units[:, depth] = np.tile(grid, len(design))
    table = scanned(thinned, units, progress).reshape(len(design), max(len(grid), 1), -1)
    total = table.sum(-1)
    batches = 1 if len(design) == 1 or quick else 3 if len(problem.parameters) < 4 else 6
    lowest = np.flatnonzero(_lowest_within(total, 1).ravel())
    lowest = lowest[np.argsort(total.ravel()[lowest])]
    first = np.union1d(lowest[: batches * MOST], _near_fringes(problem, units, lowest))
    most = len(first) if quick else _MOST_POLISHED
    polished, tried = _every_order(problem, units, total, first, progress, most)
    more = first[:0] if quick else _from_best(problem, polished, units, lowest)
    if len(more):
        polished, tried = _joined(polished, solve(problem, more, coarse=_COARSE)), tried + len(more)
    result = settled(problem, polished, coarse=_COARSE)
    best = zip(problem.parameters, problem.values(result.units[0]), strict=True)
    log.info(
        "polished: %d minima of the scan, %d of them distinct, %d converged; best: %s",
        tried,
        len(result.units),
        int(np.sum(result.converged)),
        ", ".join(f"{p.name} {value:.6g}" for p, value in best),
    )
    if depth is None:
        return result
    p = problem.parameters[depth]
    every = np.concatenate([scanned(thinned, result.units[:1]), table.reshape(len(units), -1)])
    best_of_scan = every[np.argmin(every.sum(-1))]
    return replace(result, scan=Scan(p.lower + grid * (p.upper - p.lower), table - best_of_scan))


def _lowest_within(values: np.ndarray, reach: int) -> np.ndarray:
    """Mask of the local minima of `values` (..., thickness) within `reach` steps on both sides."""
    lowest = np.ones(values.shape, bool)
    for step in range(1, reach + 1):
        lowest[..., step:] &= values[..., step:] <= values[..., :-step]
        lowest[..., :-step] &= values[..., :-step] <= values[..., step:]
    return lowest


def _near_fringes(problem: Problem, units: np.ndarray, lowest: np.ndarray) -> np.ndarray:
    """The first of the candidates `lowest` whose thickness is what the fringes suggest, by an index that may
    be wrong."""
    chosen, start = [], np.array([p.start for p in problem.parameters])
    for thickness in proposed(problem, start):
        depths = np.asarray(problem.values(units[lowest]))[:, problem.thickness_axis]
        chosen.append(lowest[np.abs(np.log(np.maximum(depths, 1e-9) / thickness)) < _INDEX][:_NEAR])
    return np.concatenate([lowest[:0], *chosen])


def _every_order(
    problem: Problem,
    units: np.ndarray,
    total: np.ndarray,
    first: np.ndarray,
    progress: Progress,
    most: int = _MOST_POLISHED,
) -> tuple[Minima, int]:
    """The candidates `first` polished, then those of all other orders that could be better, till there are
    `most`; and how many.

    `total` (design, thickness) are deviances of the candidates `units`. Residuals obey the triangle
    inequality, ‖r(polished)‖ ≥ ‖r(start)‖ − ‖change of the model‖: an order is excluded where the best
    deviance is out of reach by more than `_REACH` times the largest fall of ‖r‖ seen so far, and where noise
    of the size of the best residuals does not explain the difference.
    """
    independent = sum(view.independent * float(view.data.independent_fraction) for view in problem.views)
    deviance = total.ravel()
    polished = solve(problem, units[first], coarse=_COARSE, progress=progress)
    profile, row = total.min(axis=0), total.argmin(axis=0)
    # orders are at least four steps of the grid apart
    orders = np.flatnonzero(_lowest_within(profile, 2 if len(total) > 1 else 1))
    rest = np.setdiff1d(row[orders] * total.shape[1] + orders, first)
    rest, tried = rest[np.argsort(deviance[rest])], first
    while len(rest) and len(tried) < most:
        reached = _root(polished.deviance)
        fall = np.max(_root(deviance[tried]) - reached, where=np.isfinite(reached), initial=0.0)
        best = polished.deviance.min()
        level = best + _CHANCE * max(best / independent, 1.0)
        near = _root(deviance[rest]) - _REACH * fall < _root(level)
        now = rest[near][:SLOTS]
        if not len(now):
            break
        more = solve(problem, units[now], coarse=_COARSE, progress=progress)
        polished = _joined(polished, more)
        rest, tried = rest[~np.isin(rest, now)], np.concatenate([tried, now])
    return polished, len(tried)


def _joined(first: Minima, second: Minima) -> Minima:
    """The minima of both."""
    return Minima(
        np.concatenate([first.units, second.units]),
        np.concatenate([first.deviance, second.deviance]),
        np.concatenate([first.converged, second.converged]),
    )


def _from_best(problem: Problem, polished: Minima, units: np.ndarray, lowest: np.ndarray) -> np.ndarray:
    """Starts in the unit cube from the best minimum: with its widths narrow and broad, and with thicknesses
    of the candidates `lowest` near what the period of the fringes suggests by its index."""
    best = polished.units[np.argmin(polished.deviance)]
    axes = [i for i, p in enumerate(problem.parameters) if p.key in _WIDTHS]
    depth, values, starts = problem.thickness_axis, np.asarray(problem.values(best)), [best]
    for thickness in proposed(problem, values):
        depths = np.maximum(np.asarray(problem.values(units[lowest]))[:, depth], 1e-9)
        near = lowest[np.abs(np.log(depths / thickness)) < _PERIOD]
        if abs(np.log(values[depth] / thickness)) > _PERIOD:
            starts += [np.where(np.arange(len(best)) == depth, units[one], best) for one in near[:_NEAR]]
    levels = [_widths(problem.parameters[i]) for i in axes]
    result = np.repeat(starts, max(len(_BROADER) ** len(axes), 1), axis=0)
    result[:, axes] = np.tile(list(itertools.product(*levels)), (len(starts), 1))
    return result if axes else result[1:]


def _root(deviance: Any) -> Any:
    """‖r‖ of a deviance; evidence may take it below zero."""
    return np.sqrt(np.maximum(deviance, 0.0))


def thickness_grid(problem: Problem, choices: int) -> np.ndarray:
    """Positions in 0..1 no further apart than λ_min/(8 n_max): an eighth of the shortest fringe's period
    in optical thickness, as n_max is the largest that the bounds allow. Logs the size of the scan, with as
    many `choices` of the other parameters."""
    if problem.thickness_axis is None:
        log.info("scan: no thickness is free; %d starting points for the other parameters", choices)
        return np.zeros(0)
    p, shortest = problem.parameters[problem.thickness_axis], shortest_wavelength(problem)
    most = max(_MOST_STEPS, _MOST_CANDIDATES // choices)
    count = int(np.clip(np.ceil((p.upper - p.lower) / (shortest / 8)) + 1, 9, most))
    log.info(
        "scan: %d values of %s, %.3g nm apart (an eighth of the shortest wavelength in a layer, %.3g), "
        "with %d choice%s of the other parameters each: %d candidates",
        *(count, p.name, (p.upper - p.lower) / (count - 1), shortest),
        *(choices, "s" * (choices != 1), count * choices),
    )
    return np.linspace(0.0, 1.0, count)


def design_points(problem: Problem, most: int = _MOST_DESIGNS) -> np.ndarray:
    """A few values of every parameter but the scanned thickness, as points of the unit cube: `most` at most,
    about."""
    levels = [_levels(p, problem) for p in problem.parameters]
    if problem.thickness_axis is not None:
        levels[problem.thickness_axis] = np.zeros(1)
    groups: dict[str, list[int]] = {}
    for i, p in enumerate(problem.parameters):
        groups.setdefault(p.group, []).append(i)
    free = [levels[members[0]] for members in groups.values()]
    while np.prod([len(level) for level in free]) > max(most, 1):
        longest = max(range(len(free)), key=lambda i: len(free[i]))
        free[longest] = _even(len(free[longest]) - 1)
    design = np.array(list(itertools.product(*free))).reshape(-1, len(free))
    units = np.empty((len(design), len(levels)))
    for column, members in zip(design.T, groups.values(), strict=True):
        units[:, members] = column[:, None]
    return units


def _even(count: int) -> np.ndarray:
    return (np.arange(count) + 0.5) / count


def _by_decades(lower: float, upper: float, count: int) -> np.ndarray:
    """Positions in 0..1 whose values have one ratio, from a 20th of the range to near its end."""
    span = upper - lower
    return (np.geomspace(lower + span / 20, upper - span / 6, count) - lower) / span


def _widths(p: Parameter) -> np.ndarray:
    """Positions between its bounds at which a width starts, narrow ones first."""
    return np.minimum(1.0, min(_NARROW, _WIDTHS[p.key] / (p.upper - p.lower)) * np.array(_BROADER))


def _levels(p: Parameter, problem: Problem) -> np.ndarray:
    if not p.searched:
        start = (p.start - p.lower) / (p.upper - p.lower)
        return _widths(p)[:2] if p.key in _WIDTHS and start == 0.5 else np.array([start])
    if p.group.split(".")[-1] == "k":
        return np.array([0.001, 0.01, 0.05, 0.15, 0.4])
    if p.levels is not None and p.decades:
        return _by_decades(p.lower, p.upper, p.levels)
    if p.levels is not None:
        return _even(p.levels)
    count = np.ceil((p.upper - p.lower) / 0.2)
    if p.key == "B":
        # by how many fringes the ends of the spectra part over the bounds of Cauchy's B
        thickest = max([q.upper for q in problem.parameters if q.key == "thickness"], default=1000.0)
        wavelengths = [view.scene.light.wavelength for view in problem.views]
        blue, red = min(nm.min() for nm in wavelengths), max(nm.max() for nm in wavelengths)
        orders = 2 * min(thickest, 2000.0) / blue * (p.upper - p.lower) * (1 / blue**2 - 1 / red**2)
        count = np.ceil(orders)
    if p.key == "thickness":
        step = shortest_wavelength(problem) / 4
        return _even(int(np.clip(np.ceil((p.upper - p.lower) / step), 3, 24)))
    return _even(int(np.clip(count, 3, 8)))
