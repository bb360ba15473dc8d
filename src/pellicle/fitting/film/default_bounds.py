"""Default bounds of a fit of spectra: widened where the best fit rests on one and the data want it.

Nobody chose these bounds for the sample at hand. What lies beside them is searched, and where the data are
explained better there, the fit is done again within wider bounds.
"""

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from logging import getLogger
from typing import NamedTuple

import numpy as np

from pellicle.fitting.coordinates import box
from pellicle.fitting.film import residual_structure
from pellicle.fitting.film.parameters import bounds, with_bounds
from pellicle.fitting.film.problem import Target, make
from pellicle.fitting.film.search import search
from pellicle.fitting.minima import MOST, Minima, distinct, minima, solve
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress
from pellicle.fitting.reweighting import RankedMinima, rank
from pellicle.fitting.status import RIVAL

log = getLogger(__name__)

_ROUNDS = 3
"""Times that bounds are moved outwards, each time by the width of the range."""
_THIN = 0.05
"""Share of the range within which what was added needs no search of its own."""


class Wider(NamedTuple):
    """Default bounds that were widened, and what was done, in words.

    `parameters` are the problem's with their bounds; `values` (minima, parameters) are minima found within
    them, in the parameters' own units. `binding` names parameters that rest on a default bound and, within
    wider ones, on their end: those are then not used.
    """

    parameters: tuple[Parameter, ...]
    values: np.ndarray
    warnings: tuple[str, ...] = ()
    binding: frozenset[str] = frozenset()


def wider(
    spectra: Sequence[Target], ranked: RankedMinima, tolerance: float, loss: str, progress: Progress
) -> Wider:
    """Widen the default bounds on which the best fit rests, if χ² falls by more than a rival's distance."""
    old, now, gains = ranked.problem.parameters, ranked, 0.0
    for _ in range(_ROUNDS):
        before, values = now.problem.parameters, now.values
        moved = tuple(_moved(p, value) for p, value in zip(before, values.tolist(), strict=True))
        if moved == before:
            break
        problem = make(*measured_within(spectra, ranked, moved), tolerance=tolerance)
        starts = [np.asarray(now.problem.values(now.minima.units))]
        views = zip(now.problem.views, now.fits, strict=True)
        missed = any(residual_structure.missed(view, fit) for view, fit in views)
        # where noise alone is left, nothing far away can be better
        for beside in _slabs(problem, before) if missed else ():
            starts.append(np.asarray(beside.values(search(beside, progress).units)))
        again = rank(problem, minima(problem, _inside(problem, np.concatenate(starts))), loss)
        pinned = again.problem._replace(box=problem.box._replace(lower=values, upper=values))
        gain = float(solve(pinned, _inside(problem, values[None])).deviance[0] - again.minima.deviance[0])
        log.info("default bounds: χ² falls by %.3g within %s", gain, ", ".join(map(_range, moved)))
        if not gain > RIVAL:
            break
        now, gains = again, gains + gain
    parameters, values = now.problem.parameters, np.asarray(now.problem.values(now.minima.units))
    ends = [p.on_ends(value) for p, value in zip(parameters, values[0].tolist(), strict=True)]
    if any(
        (low and p.lower < before.lower) or (high and p.upper > before.upper)
        for before, p, (low, high) in zip(old, parameters, ends, strict=True)
    ):
        resting = [p for p, value in zip(old, ranked.values.tolist(), strict=True) if _moved(p, value) != p]
        words = tuple(
            f"the best fit rests on the default bounds of {p.name}, and within wider ones on their end"
            f" (Δχ² {gains:.3g}): the scene may be wrong"
            for p in resting
        )
        return Wider(old, ranked.values[None], words, frozenset(p.name for p in resting))
    words = tuple(
        f"the default bounds of {p.name} were widened from {_range(p)} to {_range(q)}: the best fit lay on"
        f" them (Δχ² {gains:.3g})"
        for p, q in zip(old, parameters, strict=True)
        if p != q
    )
    return Wider(parameters, values, words)


def _moved(p: Parameter, value: float) -> Parameter:
    """The parameter with its default bounds moved outwards where the value rests on one that can be.

    Both are moved: a film of an index below the bounds may at first be taken for one of an index above.
    """
    if p.limits is None:
        return p
    (low, high), (least, most), span = p.on_ends(value), p.limits, p.upper - p.lower
    if not (low and p.lower > least) and not (high and p.upper < most):
        return p
    return replace(p, lower=max(p.lower - span, least), upper=min(p.upper + span, most))


def _slabs(problem: Problem, before: Sequence[Parameter]) -> Iterator[Problem]:
    """Boxes beside that of a problem on each side of each parameter, with all of the others' bounds.

    Thin slabs are left out: what they contain is near the minima that rest on the bound.
    """
    for i, (p, q) in enumerate(zip(before, problem.parameters, strict=True)):
        for lower, upper in ((q.lower, p.lower), (p.upper, q.upper)):
            if upper - lower > _THIN * (p.upper - p.lower):
                part = replace(q, lower=lower, upper=upper)
                slab = (*problem.parameters[:i], part, *problem.parameters[i + 1 :])
                own = box(*bounds(slab), [p.prior for p in slab])
                yield problem._replace(parameters=slab, box=own)


def _inside(problem: Problem, values: np.ndarray) -> np.ndarray:
    """Values (..., parameters) in the problem's unit cube."""
    lower, upper = np.asarray(problem.box.lower), np.asarray(problem.box.upper)
    return np.clip((values - lower) / (upper - lower), 0.0, 1.0)


def measured_within(
    spectra: Sequence[Target], ranked: RankedMinima, parameters: tuple[Parameter, ...]
) -> list[Target]:
    """The spectra with scenes whose bounds are those of the parameters."""
    pairs = zip(spectra, ranked.problem.views, strict=True)
    return [
        each._replace(scene=with_bounds(each.scene, [parameters[i] for i in view.takes]))
        for each, view in pairs
    ]


def joined(problem: Problem, searched: Minima, values: np.ndarray) -> Minima:
    """The minima of a search and those below `values` (starts, parameters), best first."""
    below = minima(problem, _inside(problem, values))
    columns = ("units", "deviance", "converged")
    both = {name: np.concatenate([getattr(searched, name), getattr(below, name)]) for name in columns}
    return distinct(problem, replace(searched, **both), MOST)


def remarks(ranked: RankedMinima, binding: Container[str]) -> list[str]:
    """A sentence for each parameter that rests on a default bound, other than a zero that has a limit and
    `binding` ones."""
    sentences = []
    for p, value in zip(ranked.problem.parameters, ranked.values.tolist(), strict=True):
        low, high = p.on_ends(value)
        if p.limits is None or p.name in binding or not (low or high) or (low and p.natural[0]):
            continue
        bound = "a default bound: wider ones explain the data no better"
        if value in p.limits:
            bound = f"the {'least' if low else 'largest'} value that physics allows"
        sentences.append(f"{p.name} rests on {_amount(value, p)}, {bound}")
    return sentences


def _range(p: Parameter) -> str:
    return f"{p.lower:g} ... {_amount(p.upper, p)}"


def _amount(value: float, p: Parameter) -> str:
    return f"{value:g} {p.unit}".rstrip()
