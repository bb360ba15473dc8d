"""Search for minima of several samples with shared numbers: each sample by itself, then all together.

The thicknesses of several samples span too many candidates for one scan. With the shared numbers given, each
sample has a misfit of its own: the minima of every sample propose shared numbers, at which the thickness of
each other sample is scanned; the sums that are least are polished with all numbers free.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pellicle.fitting.coordinates import Box
from pellicle.fitting.evaluation import scanned
from pellicle.fitting.film.problem import shortest_wavelength
from pellicle.fitting.minima import Minima, minima
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress

_PROPOSED, _OWN = 6, 3
"""Minima of a sample whose shared numbers are tried in all, and whose own are tried in it."""
_ORDERS, _POLISHED = 4, 24
"""Orders of a sample that are tried at given shared numbers, and sums that are polished."""
_COARSE = 1e-3
"""Share of its distance to the best deviance within which a minimum is computed."""
_MOST = 2000
"""Most thicknesses of one scan."""


class SamplePart(NamedTuple):
    """The problem of one sample, and the positions of its parameters among all."""

    problem: Problem
    takes: tuple[int, ...]


def sample_parts(problem: Problem) -> list[SamplePart]:
    """The problem of each sample: views that no free thickness connects are of several samples.

    One where fewer than two samples have a free thickness.
    """
    groups: list[tuple[set[int], list[int]]] = []
    for number, view in enumerate(problem.views):
        depths = {i for i in view.takes if problem.parameters[i].key == "thickness"}
        own = [group for group in groups if group[0] & depths]
        members = sorted([number, *(i for group in own for i in group[1])])
        groups = [group for group in groups if group not in own]
        groups.append((depths.union(*(group[0] for group in own)), members))
    if sum(bool(depths) for depths, _ in groups) < 2:
        return [SamplePart(problem, tuple(range(len(problem.parameters))))]
    return [_part(problem, members) for _, members in groups]


def _part(problem: Problem, members: list[int]) -> SamplePart:
    takes = tuple(dict.fromkeys(i for number in members for i in problem.views[number].takes))
    place = {i: at for at, i in enumerate(takes)}
    views = [problem.views[number] for number in members]
    views = [replace(view, takes=tuple(place[i] for i in view.takes)) for view in views]
    rows = Box(*(x[list(takes)] for x in problem.box[:5]), reach=problem.box.reach)
    parameters = tuple(problem.parameters[i] for i in takes)
    return SamplePart(problem._replace(views=tuple(views), parameters=parameters, box=rows), takes)


def search_samples(
    problem: Problem,
    parts: list[SamplePart],
    search: Callable[[Problem, Progress, bool], Minima],
    progress: Progress,
) -> Minima:
    """The distinct minima of a problem of several samples, best first; `search` is that of one of them."""
    found = [search(part.problem, progress, True) for part in parts]
    best = np.full(len(problem.parameters), 0.5)
    for part, own in reversed([*zip(parts, found, strict=True)]):
        best[list(part.takes)] = own.units[0]
    proposals = []
    for part, own in zip(parts, found, strict=True):
        for unit in own.units[:_PROPOSED]:
            one = best.copy()
            one[list(part.takes)] = unit
            proposals.append(one)
    starts = _starts(problem, parts, found, np.array(proposals))
    polished = minima(problem, starts[:_POLISHED], progress, coarse=_COARSE)
    # other orders of each sample, at the best shared numbers
    more = _starts(problem, parts, found, polished.units[:1])
    return minima(problem, np.concatenate([polished.units, more[:_POLISHED]]), progress, coarse=_COARSE)


def _starts(
    problem: Problem, parts: list[SamplePart], found: list[Minima], proposals: np.ndarray
) -> np.ndarray:
    """Starts (starts, parameters) with the shared numbers of proposals (proposals, parameters), the least sum
    of deviances first: the best of each sample, and with another order of one of them."""
    counts = np.zeros(len(problem.parameters), int)
    for part in parts:
        counts[list(part.takes)] += 1
    each = [
        _orders(part, own, proposals[:, list(part.takes)], counts[list(part.takes)] > 1)
        for part, own in zip(parts, found, strict=True)
    ]
    starts, sums = [], []
    for row in range(len(proposals)):
        sample_rows = [own[row] for own in each]
        base, total = proposals[row].copy(), sum(own[1][0] for own in sample_rows)
        for part, (units, _) in zip(parts, sample_rows, strict=True):
            base[list(part.takes)] = units[0]
        starts.append(base)
        sums.append(total)
        for part, (units, deviance) in zip(parts, sample_rows, strict=True):
            for unit, own in zip(units[1:], deviance[1:], strict=True):
                other = base.copy()
                other[list(part.takes)] = unit
                starts.append(other)
                sums.append(total + own - deviance[0])
    return np.array(starts)[np.argsort(sums, kind="stable")]


def _orders(
    part: SamplePart, own: Minima, proposals: np.ndarray, keep: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The best points (orders, parameters) of a sample, and their deviance, at the shared numbers of each of
    its `proposals` (proposals, parameters): those that `keep` marks are as there, the thickness is scanned,
    and others are those of its minima."""
    depth, problem = part.problem.thickness_axis, part.problem.thinned()
    grid = np.zeros(1)
    if depth is not None and not keep[depth]:
        p = part.problem.parameters[depth]
        count = int(np.clip(np.ceil((p.upper - p.lower) / (shortest_wavelength(part.problem) / 8)), 9, _MOST))
        grid = np.linspace(0.0, 1.0, count + 1)
    bases = own.units[:_OWN].copy()
    if len(grid) > 1:
        bases[:, depth] = 0.0
    bases = np.unique(np.where(keep, 0.0, bases), axis=0)
    scan = np.repeat(bases, len(grid), axis=0)
    if len(grid) > 1:
        scan[:, depth] = np.tile(grid, len(bases))
    tried = [
        np.concatenate([np.where(keep, at, np.concatenate([own.units, scan])), at[None]]) for at in proposals
    ]
    table = scanned(problem, np.concatenate(tried)).sum(axis=1).reshape(len(proposals), -1)
    step = 3 * grid[1] if len(grid) > 1 else None
    return [_best(units, row, depth, step) for units, row in zip(tried, table, strict=True)]


def _best(
    units: np.ndarray, deviance: np.ndarray, depth: int | None, apart: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """The `_ORDERS` least points of `units` (points, parameters), whose positions `depth` are `apart`; the
    least alone where no thickness is scanned."""
    order, kept = np.argsort(deviance, kind="stable"), list[int]()
    for i in order[np.isfinite(deviance[order])].tolist():
        if apart is None or all(abs(units[i, depth] - units[j, depth]) >= apart for j in kept):
            kept.append(i)
        if len(kept) == _ORDERS or apart is None:
            break
    kept = kept or [int(order[0])]
    return units[kept], deviance[kept]
