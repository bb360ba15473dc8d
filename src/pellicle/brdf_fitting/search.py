"""Where to start: random candidates with their weights solved, halved by short polishes of few samples.

From one random start 2 to 8 of 100 fits succeed. Polishing the best 8 of 4096 candidates finds 17 of 25
surfaces of ten free numbers (200 samples in a plane, noise 1 %), the best 24 of 16 384 finds 21; 25
short steps of 128, and a full polish of the best 8 of these, 24, in less time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pellicle.brdf_fitting.problem import Problem, polished, scanned
from pellicle.fitting.search import Progress

SCAN_SAMPLES = 150
_CHUNK = 512
_SHORT = 25
"""Steps of a short polish."""
_APART = 2.0
"""Starts are so far apart (nm): nearer ones fall into one minimum."""
_DISPERSION = 0.1
"""Candidates' indices of one medium differ by up to this from channel to channel."""


class Effort(NamedTuple):
    """How many candidates are tried, how many of them polished for a few steps, and how many to the end."""

    candidates: int
    short: int
    starts: int


THOROUGH, SMOOTH, FEW = Effort(8192, 128, 8), Effort(8192, 0, 16), Effort(512, 0, 8)
"""For a layer; for one without interference, whose misfit has no fringes; for three numbers."""


class Minima(NamedTuple):
    """Distinct local minima in the unit cube, best first."""

    units: np.ndarray
    chi2: np.ndarray
    converged: np.ndarray


def search(problem: Problem, effort: Effort, progress: Progress) -> Minima:
    """Scan; polish the best that differ in thickness, shortly and on few samples, then the best of these."""
    form, _, *rest = problem.program
    units = candidates(problem, effort.candidates)
    few = thin(problem)
    chi2, weights = np.empty(len(units)), np.empty((len(units), np.size(problem.most)))
    for first in range(0, len(units), _CHUNK):
        part = slice(first, first + _CHUNK)
        padded = np.resize(units[part], (_CHUNK, units.shape[1]))
        found = scanned(form, few, *rest, padded)
        count = len(units[part])
        chi2[part], weights[part] = (np.asarray(x)[:count] for x in found)
        progress("scan", min(first + _CHUNK, len(units)), len(units))
    units = np.hstack([units, weights])
    if effort.short:
        starts = _best(problem, units, chi2, effort.short)
        progress("short polish", 0, len(starts))
        units, chi2, _ = (np.asarray(x) for x in polished(form, few, *rest, starts, _SHORT))
    return polish(problem, _best(problem, units, chi2, effort.starts), effort, progress)


def polish(problem: Problem, starts: np.ndarray, effort: Effort, progress: Progress) -> Minima:
    """The distinct minima below `starts`, best first; there are at most `effort.starts` of them."""
    progress("polish", 0, len(starts))
    lanes = np.concatenate([starts, np.repeat(starts[-1:], effort.starts - len(starts), axis=0)])
    units, chi2, converged = (np.asarray(x)[: len(starts)] for x in polished(*problem.program, lanes))
    chi2 = np.where(np.isfinite(chi2), chi2, np.inf)
    kept: list[int] = []
    for at in np.argsort(chi2, kind="stable"):
        if all(apart(problem, units[at], units[other]) for other in kept):
            kept.append(int(at))
    progress("polish", len(starts), len(starts))
    return Minima(units[kept], chi2[kept], converged[kept])


def candidates(problem: Problem, count: int) -> np.ndarray:
    """Random points (count, coordinates) of the unit cube, the same at every call.

    Channels of one key vary together: a medium's index is nearly one number.
    """
    rng = np.random.default_rng(0)
    c = problem.form.coordinates
    units = rng.random((count, len(c.names)))
    spans = np.asarray(problem.box.upper) - np.asarray(problem.box.lower)
    for at, (key, channel) in enumerate(zip(c.keys, c.channels, strict=True)):
        if channel:
            first = c.keys.index(key)
            shift = _DISPERSION / spans[at] * (2 * units[:, at] - 1)
            units[:, at] = np.clip(units[:, first] + shift, 0, 1)
    return units


def thin(problem: Problem):
    """The problem's data at `SCAN_SAMPLES` samples, spread evenly over their values; few are repeated."""
    data = problem.data
    seen = np.flatnonzero(np.any(data.weight > 0, axis=1))
    order = seen[np.argsort(data.values[seen].mean(axis=1), kind="stable")]
    chosen = np.sort(order[np.linspace(0, len(seen) - 1, SCAN_SAMPLES).round().astype(int)])
    return data._replace(
        i=data.i[chosen], o=data.o[chosen], values=data.values[chosen], weight=data.weight[chosen]
    )


def _best(problem: Problem, units: np.ndarray, chi2: np.ndarray, most: int) -> np.ndarray:
    """The best `most` whose thicknesses are `_APART`, filled up with the next best."""
    ranked = units[np.argsort(np.where(np.isfinite(chi2), chi2, np.inf), kind="stable")]
    axis = problem.thickness
    if axis is None:
        return ranked[:most]
    depth = ranked[:, axis] * float(problem.box.upper[axis] - problem.box.lower[axis])
    chosen: list[int] = []
    for at in range(len(ranked)):
        if len(chosen) < most and np.all(np.abs(depth[at] - depth[chosen]) >= _APART):
            chosen.append(at)
    rest = [at for at in range(len(ranked)) if at not in chosen] if len(chosen) < most else []
    return ranked[[*chosen, *rest[: most - len(chosen)]]]


def apart(problem: Problem, a: np.ndarray, b: np.ndarray) -> bool:
    """Two minima, not one: thickness by a nanometre, or any coordinate by 2 % of its range."""
    difference = np.abs(a - b)[: len(problem.form.coordinates.names)]
    limit = np.full(len(difference), 0.02)
    if problem.thickness is not None:
        axis = problem.thickness
        limit[axis] = 1.0 / float(problem.box.upper[axis] - problem.box.lower[axis])
    return bool(np.any(difference > limit))
