"""Search for minima of a surface: random candidates with weights solved, halved by short polishes.

From one random start 2 to 8 of 100 fits succeed. A film of another thickness and index often has nearly
the right lobes, for those are where the light is: the next round keeps the lobes of the best minima and
draws the fringes anew. Of 100 surfaces of ten free numbers (`benchmarks/brdf_recovery.py`) one round of
8192 candidates finds 93 to 97, rounds of 4096 find 99 in no more time.
"""

import itertools
from dataclasses import replace
from functools import partial
from logging import getLogger
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.brdf.problem import linear_count
from pellicle.fitting.brdf.view import BLOCK, SLOPES, Samples
from pellicle.fitting.coordinates import Box, widened
from pellicle.fitting.minima import Minima, minima, solve
from pellicle.fitting.positive_definite import solve_positive
from pellicle.fitting.problem import Member, Problem
from pellicle.fitting.progress import Progress
from pellicle.programs.cache import in_chunks, kept

log = getLogger(__name__)

_CHUNK = 512
_SHORT = 25
"""Steps of a short polish."""
_ROUNDS, _PARENTS = 4, 16
"""At most so many rounds, the later ones from the lobes of so many minima."""
_BETTER = 0.99
"""The last round is one that leaves more than this share of the best χ²."""
_FRINGES = ("thickness", "n")
_COARSE = 1e-3
"""For fits of which the best minimum alone counts."""
_APART = 2.0
"""Starts are so far apart (nm): nearer ones fall into one minimum."""
_DISPERSION = 0.1
"""Candidates' indices of one medium differ by up to this from channel to channel."""


class Effort(NamedTuple):
    """Numbers of candidates, of those polished for a few steps, and of those polished to the end.

    A polish ends where it promises less than the share `coarse` of its distance to the best of all.
    """

    candidates: int
    short: int
    starts: int
    coarse: float = 0.0


THOROUGH, SMOOTH, FEW = Effort(4096, 64, 8), Effort(8192, 0, 16, _COARSE), Effort(512, 0, 8, _COARSE)
"""For a layer; for one without interference, whose misfit has no fringes; for three numbers."""


def search(problem: Problem, effort: Effort, progress: Progress) -> Minima:
    """Rounds of candidates and short polishes on few samples, then a polish of the best of all."""
    few = _thinned(problem)
    units, chi2 = _scan(few, candidates(problem, effort.candidates), progress)
    log.info("scan: %d random candidates; the best has χ² %.4g on a few samples", len(units), chi2.min())
    if effort.short:
        units, chi2 = _short(problem, few, units, chi2, effort.short, progress)
        for again in range(1, _ROUNDS if problem.thickness_axis is not None else 1):
            parents = _best(problem, units, chi2, _PARENTS)
            drawn = candidates(problem, effort.candidates, again)
            # everything but thickness and index comes from the parents, each in its turn
            lobes = [at for at in range(drawn.shape[1]) if problem.parameters[at].key not in _FRINGES]
            drawn[:, lobes] = np.resize(parents, (len(drawn), parents.shape[1]))[:, lobes]
            new_units, new_chi2 = _short(problem, few, *_scan(few, drawn, progress), effort.short, progress)
            done = new_chi2.min() > _BETTER * chi2.min()
            units, chi2 = np.vstack([units, new_units]), np.concatenate([chi2, new_chi2])
            log.info("scan: fringes drawn anew, %d polished a little; χ² %.4g", len(new_chi2), chi2.min())
            if done:
                break
    starts = _best(problem, units, chi2, effort.starts)
    return minima(problem, starts, progress, most=effort.starts, followed=0, coarse=effort.coarse)


def _scan(few: Problem, units: np.ndarray, progress: Progress) -> tuple[np.ndarray, np.ndarray]:
    """Candidates with their weights beside them, and their χ²."""
    [view] = few.views
    family = few.solved_together
    width = max(_form(member).nonlinear for member in family)
    most = max(member.size for member in family)
    which, samples = np.int64(family.index(few.member)), view.data.first_block()
    done = itertools.count(0, _CHUNK)
    progress("scan", next(done), len(units))

    def chunk(part: np.ndarray) -> Candidates:
        result = scan(family, which, samples, view.fixed, few.box.extended(most), part)
        progress("scan", min(next(done), len(units)), len(units))
        return result

    scanned = in_chunks(chunk, widened(units, width), _CHUNK)
    count = len(few.parameters) - units.shape[1]
    return np.hstack([units, scanned.weights[:, :count]]), scanned.chi2


def _short(
    problem: Problem, few: Problem, units: np.ndarray, chi2: np.ndarray, most: int, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """The best `most` after a few steps of the solver, and their χ²."""
    starts = _best(problem, units, chi2, most)
    progress("short polish", 0, len(starts))
    result = solve(few, starts, steps=_SHORT)
    return result.units, result.deviance


def candidates(problem: Problem, count: int, seed: int = 0) -> np.ndarray:
    """Random points (count, nonlinear parameters) of the unit cube, the same at every call of one seed.

    Channels of one key vary together: a medium's index is nearly one number.
    """
    rng = np.random.default_rng(seed)
    size = len(problem.parameters) - linear_count(problem)
    units = rng.random((count, size))
    form, spans = problem.views[0].form, np.asarray(problem.box.upper) - np.asarray(problem.box.lower)
    for at, (key, channel) in enumerate(zip(form.keys[:size], form.channels[:size], strict=True)):
        if channel:
            shift = _DISPERSION / spans[at] * (2 * units[:, at] - 1)
            units[:, at] = np.clip(units[:, form.keys.index(key)] + shift, 0, 1)
    if problem.coordinates.tilt is not None and problem.coordinates.folded:
        units[:, problem.coordinates.tilt[1]] **= 2  # even in y, as where it is searched itself
    return units


def _thinned(problem: Problem) -> Problem:
    """The problem with one view of `BLOCK` samples, spread evenly over the values of all views; where
    there are fewer, some are repeated. One view with no more, padding included, stays: it needs no program
    of its own."""
    if len(problem.views) == 1 and len(problem.views[0].data.values) <= BLOCK:
        return problem
    [first, *others] = problem.views
    columns = zip(*(view.data[:5] for view in problem.views), strict=True)
    every = Samples(*map(np.concatenate, columns))
    weighted = np.flatnonzero(np.any(every.weight > 0, axis=1))
    order = weighted[np.argsort(every.values[weighted].mean(axis=1), kind="stable")]
    chosen = np.sort(order[np.linspace(0, len(weighted) - 1, BLOCK).round().astype(int)])
    if not others:  # the others follow without weight, so that the program is that of all samples
        left = np.setdiff1d(np.arange(len(every.values)), chosen)[: len(every.values) - len(chosen)]
        every.weight[left], chosen = 0.0, np.concatenate([chosen, left])
    picked = Samples(*(column[chosen] for column in every[:5]))
    view = replace(first, data=picked, rows=BLOCK, stated=picked.weight)
    family = tuple(m._replace(static=(m.static[0], m.static[1][:1])) for m in problem.family)
    return problem._replace(views=(view,), family=family)


def _best(problem: Problem, units: np.ndarray, chi2: np.ndarray, most: int) -> np.ndarray:
    """The best `most` whose thicknesses are `_APART`, filled up with the next best."""
    ranked = units[np.argsort(np.where(np.isfinite(chi2), chi2, np.inf), kind="stable")]
    axis = problem.thickness_axis
    if axis is None:
        return ranked[:most]
    depth = ranked[:, axis] * float(problem.box.upper[axis] - problem.box.lower[axis])
    chosen: list[int] = []
    for at in range(len(ranked)):
        if len(chosen) < most and np.all(np.abs(depth[at] - depth[chosen]) >= _APART):
            chosen.append(at)
    others = np.setdiff1d(np.arange(len(ranked)), chosen)
    return ranked[[*chosen, *others[: most - len(chosen)]]]


class Candidates(NamedTuple):
    """χ² of each candidate, and its weights in the unit cube (candidates, weights)."""

    chi2: Any
    weights: Any


def _form(member: Member) -> Any:
    """The form of its one view."""
    return member.static[1][0][0]


@kept
def scan(
    family: tuple[Member, ...], member: Any, samples: Samples, fixed: dict[str, Any], box: Box, units: Any
) -> Candidates:
    """χ² and weights of candidates `units` (candidates, nonlinear parameters) in the unit cube.

    Those of one `member` of the family, with columns and weights that others have more at the end.
    """
    most = max(each.size - _form(each).nonlinear for each in family)

    def of(each, units):
        own, count = box.of_first(each.size), _form(each).nonlinear

        def one(unit):
            if count == each.size:
                values = each.static[0].values(own, unit)
                return Candidates(_form(each).explain((samples, fixed), values).deviance, jnp.zeros(most))
            found = solve_weights(each, samples, fixed, own, unit)
            return found._replace(weights=jnp.pad(found.weights, (0, most - len(found.weights))))

        return jax.vmap(one)(units[:, :count])

    return jax.lax.switch(member, [partial(of, each) for each in family], units)


def solve_weights(member: Member, samples: Samples, fixed: dict[str, Any], box: Box, unit: Any) -> Candidates:
    """The best weights, in the unit cube, for nonlinear parameters at `unit`, and χ² with them.

    They are exact where residuals are linear in them; else residuals are linearised at the data.
    """
    coordinates, form = member.static[0], _form(member)
    first = len(unit)
    size = len(form.keys) - first
    by_channel = form.channels[first] is not None
    groups = samples.values.shape[1] if by_channel else 1
    count = size // groups
    at_zero = coordinates.values(box, jnp.concatenate([unit, jnp.zeros(size)]))

    def at(weights):
        values = at_zero.at[first:].set(jnp.repeat(weights, groups))
        return form.evaluate(form.numbers(values, fixed), samples.i, samples.o)

    # a BRDF is affine in its weights: what does not depend on them is evaluated once, here and for χ²
    nothing, *each = jax.vmap(at)(jnp.concatenate([jnp.zeros((1, count)), jnp.eye(count)]))
    columns = jnp.stack(each) - nothing
    change = samples.weight * SLOPES[form.residual](samples.values, samples.i[:, 2:3], samples.floor)
    weighted = columns * change
    normal = jnp.einsum("knc,lnc->ckl", weighted, weighted)
    right = jnp.einsum("knc,nc->ck", weighted, (samples.values - nothing) * change)
    if not by_channel:
        normal, right = normal.sum(0, keepdims=True), right.sum(0, keepdims=True)
    lower, upper = (side[first:].reshape(count, groups) for side in (box.lower, box.upper))
    weights = jnp.clip(jax.vmap(_nonnegative)(normal, right).T, lower, upper)
    residual = form.compare(samples, nothing + jnp.sum(weights[:, None] * columns, axis=0))
    chi2 = jnp.sum(residual**2) * samples.independent_fraction
    return Candidates(chi2, ((weights - lower) / (upper - lower)).reshape(-1))


def _nonnegative(normal: Any, right: Any) -> Any:
    """min wᵀNw − 2 wᵀr over w ≥ 0, exactly: the best of all sets of weights that are not 0."""
    scale = jnp.sqrt(jnp.maximum(jnp.diag(normal), 1e-300))
    matrix, vector = normal / jnp.outer(scale, scale), right / scale

    def solved(chosen):
        part = jnp.where(chosen[:, None] & chosen, matrix, 0) + jnp.diag(jnp.where(chosen, 1e-12, 1.0))
        w, _ = solve_positive(part, jnp.where(chosen, vector, 0))
        return w, jnp.where(jnp.all(w >= 0), w @ matrix @ w - 2 * w @ vector, jnp.inf)

    every = jnp.array(list(itertools.product((False, True), repeat=len(vector))))
    candidates, costs = jax.vmap(solved)(every)
    return candidates[jnp.argmin(costs)] / scale
