"""Where to start: random candidates with their weights solved, halved by short polishes of few samples.

From one random start 2 to 8 of 100 fits succeed. A film of another thickness and index often has nearly
the right lobes, for those are where the light is: the next round keeps the lobes of the best minima and
draws the fringes anew. Of 100 surfaces of ten free numbers (`benchmarks/brdf_recovery.py`) one round of
8192 candidates finds 93 to 97, rounds of 4096 find 99 in no more time.
"""

from __future__ import annotations

from logging import getLogger
from typing import NamedTuple

import numpy as np

from pellicle.fitting.brdf.problem import Problem, polished, scanned
from pellicle.fitting.spectra.search import Progress

log = getLogger(__name__)

SCAN_SAMPLES = 150
_CHUNK = 512
_SHORT = 25
"""Steps of a short polish."""
_LONG = 5000
"""Steps of the best one where its polish has not settled: a model that misses the samples by much may
crawl (2400 steps on a retroreflective tape, with an exponent at its bound)."""
_ROUNDS, _PARENTS = 4, 16
"""At most so many rounds, the later ones from the lobes of so many minima."""
_BETTER = 0.99
"""The last round is one that leaves more than this share of the best χ²."""
_FRINGES = ("thickness", "n")
_APART = 2.0
"""Starts are so far apart (nm): nearer ones fall into one minimum."""
_DISPERSION = 0.1
"""Candidates' indices of one medium differ by up to this from channel to channel."""


class Effort(NamedTuple):
    """How many candidates are tried, how many of them polished for a few steps, and how many to the end."""

    candidates: int
    short: int
    starts: int


THOROUGH, SMOOTH, FEW = Effort(4096, 64, 8), Effort(8192, 0, 16), Effort(512, 0, 8)
"""For a layer; for one without interference, whose misfit has no fringes; for three numbers."""


class Minima(NamedTuple):
    """Distinct local minima in the unit cube, best first."""

    units: np.ndarray
    chi2: np.ndarray
    converged: np.ndarray


def search(problem: Problem, effort: Effort, progress: Progress) -> Minima:
    """Rounds of candidates and short polishes on few samples, then a polish of the best of all."""
    few = problem._replace(data=thin(problem))
    units, chi2 = _scan(few, candidates(problem, effort.candidates), progress)
    log.info("scan: %d random candidates; the best has χ² %.4g on a few samples", len(units), chi2.min())
    if effort.short:
        units, chi2 = _short(problem, few, units, chi2, effort.short, progress)
        for again in range(1, _ROUNDS if problem.thickness is not None else 1):
            parents = _best(problem, units, chi2, _PARENTS)
            drawn = _other_fringes(problem, parents, candidates(problem, effort.candidates, again))
            found = _short(problem, few, *_scan(few, drawn, progress), effort.short, progress)
            done = found[1].min() > _BETTER * chi2.min()
            units, chi2 = np.vstack([units, found[0]]), np.concatenate([chi2, found[1]])
            log.info("scan: fringes drawn anew, %d polished a little; χ² %.4g", len(found[1]), chi2.min())
            if done:
                break
    return polish(problem, _best(problem, units, chi2, effort.starts), effort, progress)


def _scan(few: Problem, units: np.ndarray, progress: Progress) -> tuple[np.ndarray, np.ndarray]:
    """Candidates with their weights beside them, and their χ²."""
    chi2, weights = np.empty(len(units)), np.empty((len(units), np.size(few.most)))
    for first in range(0, len(units), _CHUNK):
        part = slice(first, first + _CHUNK)
        padded = np.resize(units[part], (_CHUNK, units.shape[1]))
        found = scanned(*few.program, padded)
        count = len(units[part])
        chi2[part], weights[part] = (np.asarray(x)[:count] for x in found)
        progress("scan", min(first + _CHUNK, len(units)), len(units))
    return np.hstack([units, weights]), chi2


def _short(
    problem: Problem, few: Problem, units: np.ndarray, chi2: np.ndarray, most: int, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """The best `most` a few steps on, and their χ²; one without a number is the worst."""
    starts = _best(problem, units, chi2, most)
    progress("short polish", 0, len(starts))
    units, chi2, _ = (np.asarray(x) for x in polished(*few.program, starts, _SHORT))
    return units, np.where(np.isfinite(chi2), chi2, np.inf)


def _other_fringes(problem: Problem, parents: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """`drawn` with everything but thickness and index taken from the parents, each in its turn."""
    keys = problem.form.coordinates.keys
    lobes = [at for at, key in enumerate(keys) if key not in _FRINGES]
    drawn[:, lobes] = np.resize(parents, (len(drawn), parents.shape[1]))[:, lobes]
    return drawn


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


def settle(problem: Problem, minima: Minima, progress: Progress) -> Minima:
    """The same minima with the best one polished until it converges, where it has not."""
    if minima.converged[0] or not np.isfinite(minima.chi2[0]):
        return minima
    progress("long polish", 0, 1)
    found = polished(*problem.program, minima.units[:1], _LONG)
    better = (np.concatenate([new, old[1:]]) for new, old in zip(found, minima, strict=True))
    return Minima(*better)


def candidates(problem: Problem, count: int, seed: int = 0) -> np.ndarray:
    """Random points (count, coordinates) of the unit cube, the same at every call of one seed.

    Channels of one key vary together: a medium's index is nearly one number.
    """
    rng = np.random.default_rng(seed)
    c = problem.form.coordinates
    units = rng.random((count, len(c.names)))
    spans = np.asarray(problem.box.upper) - np.asarray(problem.box.lower)
    for at, (key, channel) in enumerate(zip(c.keys, c.channels, strict=True)):
        if channel:
            first = c.keys.index(key)
            shift = _DISPERSION / spans[at] * (2 * units[:, at] - 1)
            units[:, at] = np.clip(units[:, first] + shift, 0, 1)
    if c.tilt is not None and c.folded:
        units[:, c.tilt[1]] **= 2  # even in y, as where it is searched itself
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
