"""Discrepancy of many pixels: what systematic effects and correlated residuals add to their errors.

`fitting.discrepancy` for many spectra of one kind at once, by normal equations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pellicle.fitting.discrepancy import (
    HALF_NORMAL,
    OUTLIER,
    Effect,
    Remaining,
    bulk,
    huber_roots,
    improbable,
    reduced_variance,
)
from pellicle.fitting.misfit import BETTER, BEYOND, DOUBTFUL, EXPLAINS
from pellicle.fitting.robust_losses import spread
from pellicle.mapping.pixels.covariance import Normal, held_within, inverse, solve

_ROUNDS = 4
_SETTLED = 1e-6
_WHATEVER = 1e-6
"""Prior of an effect that is looked for whatever its size: see `fitting.discrepancy`."""


@dataclass(frozen=True, eq=False)
class PixelEvidence:
    """Residuals of pixels and what may explain them: see `fitting.discrepancy.Evidence`.

    `residual` (pixels, rows, channels) and `columns` (pixels, columns, points), of parameters and nuisances
    in the steps of their covariance and then of effects, are in the unit of the data. `sigma` (pixels, rows,
    channels), `noise` (pixels,); `counted` (pixels,) is the median variance by which the fit counts points.
    `prior` (pixels, columns) are the weights of priors, `pull` (pixels, columns) distances from their means,
    `lower` and `upper` (pixels, columns) bounds. `known` is the number of parameters and nuisances, `middle`
    (pixels,) the median σ. With `short` the noise is at least `noise`, and `short(which)` is that which
    neighbouring points of some pixels show.
    """

    residual: np.ndarray
    columns: np.ndarray
    sigma: np.ndarray
    noise: np.ndarray
    counted: np.ndarray
    prior: np.ndarray
    pull: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    known: int
    correlation: Callable[[np.ndarray], np.ndarray]
    least: float
    uncertain: float
    middle: np.ndarray
    short: Callable[[np.ndarray], np.ndarray] | None = None

    def of(self, pixels: np.ndarray) -> PixelEvidence:
        """The evidence of some of the pixels."""
        arrays = {name: x[pixels] for name, x in vars(self).items() if isinstance(x, np.ndarray)}
        return replace(self, **arrays)


class PixelDiscrepancy(NamedTuple):
    """Errors of pixels with the effects allowed for: see `fitting.discrepancy.Discrepancy`.

    `covariance` (pixels, known, known) and `shift` (pixels, known) are in the steps of the columns; the
    numbers of `remaining` are arrays (pixels,). `noise` (pixels,) is that of the evidence, exact where it may
    matter.
    """

    covariance: np.ndarray
    shift: np.ndarray
    remaining: Remaining
    implausible: np.ndarray
    evidence_share: np.ndarray
    noise: np.ndarray


class _Balance(NamedTuple):
    """Systems with factors on σ² and weights that stand for the residuals which they leave."""

    data: np.ndarray
    gram: np.ndarray
    variance: np.ndarray
    roots: np.ndarray
    normal: Normal
    covariance: np.ndarray
    solution: np.ndarray
    rest: np.ndarray


def discrepancy(evidence: PixelEvidence) -> PixelDiscrepancy:
    """The discrepancy of each pixel."""
    state = _balanced(evidence)
    known, rest = evidence.known, state.rest.reshape(evidence.residual.shape)
    left, noise = rest * evidence.sigma, evidence.noise.copy()
    typical = bulk(left, noise)
    large = np.flatnonzero(typical > DOUBTFUL * noise)
    if evidence.short is not None and len(large):
        noise[large] = np.maximum(noise[large], evidence.short(large))
    weighted = np.sqrt(np.mean((_roots(rest) * rest) ** 2, axis=(1, 2)))
    sizes = state.solution[:, known:]
    # terms of a lamp that a pixel has too few fringes for are zero
    count = np.sum(np.einsum("pii->pi", state.gram)[:, known:] > 0, axis=1)
    each, which = np.unique(count, return_inverse=True)
    limit = np.array([improbable(n) for n in each.tolist()])[which]
    now = state.variance * evidence.middle**2
    return PixelDiscrepancy(
        covariance=state.covariance[:, :known, :known],
        shift=state.solution[:, :known],
        remaining=Remaining(typical / noise, typical, weighted, state.variance),
        implausible=(count > 0) & (np.sum(sizes**2, axis=1) > limit),
        evidence_share=np.minimum(1.0, evidence.counted / now),
        noise=noise,
    )


def other_material(evidence: PixelEvidence, effects: Sequence[Effect]) -> np.ndarray:
    """True (pixels,) where an index far from the given one explains the residuals as no effect of ordinary
    size does: see `fitting.misfit.other_material`."""
    one = np.broadcast_to(evidence.noise[:, None, None], evidence.sigma.shape)
    state = _balanced(replace(evidence, sigma=one, least=1.0))
    known, pixels = evidence.known, len(evidence.residual)
    data = (state.data * state.roots) / np.sqrt(state.variance)[:, None]
    power = np.sum(data**2, axis=1)
    priors = evidence.prior**2
    # without the priors of the sums of squares themselves
    gram = state.normal.matrix - priors[:, :, None] * np.eye(priors.shape[1])
    right = state.normal.right + evidence.prior * evidence.pull
    own = np.arange(known)
    best = solve(state.normal.matrix[:, :known, :known], state.normal.right[:, :known])
    before = power - 2 * np.sum(best * right[:, own], axis=1)
    before += np.einsum("pi,pij,pj->p", best, gram[:, :known, :known], best)
    explains, alone = np.zeros((2, pixels, len(effects)))
    for i in range(len(effects)):
        both = np.append(own, known + i)
        matrix = state.normal.matrix[:, both][:, :, both].copy()
        matrix[:, -1, -1] += _WHATEVER**2 - priors[:, known + i]
        normal = Normal(matrix, state.normal.right[:, both])
        bounds = evidence.lower[:, both], evidence.upper[:, both]
        x = held_within(solve(*normal), inverse(matrix), *bounds)
        after = power - 2 * np.sum(x * right[:, both], axis=1)
        after += np.einsum("pi,pij,pj->p", x, gram[:, both][:, :, both], x)
        explains[:, i] = 1 - after / np.maximum(before, 1e-300)
        alone[:, i] = x[:, -1]
    size = np.abs(_over_own_size(effects, alone))
    material = np.array([effect.material for effect in effects])
    usual = np.max(np.where(size <= BEYOND, explains, 0.0), axis=1, initial=0.0)
    best = np.max(np.where((size > BEYOND) & material, explains, -np.inf), axis=1, initial=-np.inf)
    return best > np.maximum(EXPLAINS, usual + BETTER)


def _roots(residual: np.ndarray) -> np.ndarray:
    """Square roots of Huber's weights; most pixels have no residual that counts less."""
    roots = np.ones(residual.shape)
    far = np.flatnonzero(np.max(np.abs(residual), axis=(1, 2)) > OUTLIER)
    if len(far):
        roots[far] = huber_roots(residual[far], spread(residual[far], (1, 2)))
    return roots


def _balanced(evidence: PixelEvidence) -> _Balance:
    """Factors and weights of each pixel: those whose factors have settled are not computed again."""
    shape = evidence.residual.shape
    pixels, columns = evidence.columns.shape[:2]
    inverse_sigma = (1 / evidence.sigma).reshape(pixels, -1)
    rows = evidence.columns * inverse_sigma[:, None]
    data = evidence.residual.reshape(pixels, -1) * inverse_sigma
    variance = np.full(pixels, max(1.0, evidence.least))
    roots = np.ones(data.shape)
    gram, against = rows @ np.swapaxes(rows, 1, 2), _times(rows, data)
    at, pulled = np.arange(columns), evidence.prior * evidence.pull
    every = slice(None)

    def system(which: np.ndarray | slice) -> Normal:
        matrix = gram[which] / variance[which][:, None, None]
        matrix[:, at, at] += evidence.prior[which] ** 2
        return Normal(matrix, against[which] / variance[which][:, None] - pulled[which])

    def solved(normal: Normal, covariance: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        free = np.einsum("pij,pj->pi", covariance, normal.right)
        return held_within(free, covariance, evidence.lower[which], evidence.upper[which])

    normal = system(every)
    covariance = inverse(normal.matrix)
    solution = solved(normal, covariance, every)
    rest = data - _times(np.swapaxes(rows, 1, 2), solution)
    todo = np.arange(pixels)
    for _ in range(_ROUNDS):
        left = rest[todo].reshape(-1, *shape[1:])
        now = _roots(left).reshape(len(todo), -1)
        robust = (now < 1).any(axis=1) | (roots[todo] < 1).any(axis=1)
        some = todo[robust]
        changed = np.zeros(len(todo), bool)
        changed[robust] = np.abs(now[robust] - roots[some]).max(axis=1, initial=0.0) > _SETTLED
        roots[todo] = now
        if len(some):
            weighted = rows[some] * (roots[some] ** 2)[:, None]
            gram[some] = weighted @ np.swapaxes(rows[some], 1, 2)
            against[some] = _times(weighted, data[some])
        used = np.einsum("pij,pij->p", covariance[todo], gram[todo]) / variance[todo]
        factor = reduced_variance(
            now.reshape(left.shape) * left, used, evidence.correlation, evidence.least, evidence.uncertain
        )
        changed |= np.abs(factor / variance[todo] - 1) > _SETTLED
        variance[todo] = factor
        todo = todo[changed]
        if not len(todo):
            break
        fresh = system(todo)
        normal.matrix[todo], normal.right[todo] = fresh
        covariance[todo] = inverse(fresh.matrix)
        solution[todo] = solved(fresh, covariance[todo], todo)
        rest[todo] = data[todo] - _times(np.swapaxes(rows[todo], 1, 2), solution[todo])
    return _Balance(data, gram, variance, roots, normal, covariance, solution, rest)


def _times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Product of a matrix and a vector of each pixel."""
    return (matrices @ vectors[..., None])[..., 0]


def _over_own_size(effects: Sequence[Effect], coefficients: np.ndarray) -> np.ndarray:
    """Sizes over their standard uncertainty at coefficients (pixels, effects): see `Effect.amount`."""
    square = np.array([effect.power == 2 for effect in effects])
    root = np.copysign(np.sqrt(HALF_NORMAL * np.abs(coefficients)), coefficients)
    return np.where(square, root, coefficients)
