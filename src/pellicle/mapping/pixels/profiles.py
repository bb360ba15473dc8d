"""Limits of pixels by profile likelihood, where the misfit around a minimum is no parabola.

`fitting.profile_likelihood` for many pixels: which sides of a best value are open, and standard errors from
where the misfit has risen by its 95 % threshold on both sides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pellicle.fitting.covariance import UNSEEN
from pellicle.fitting.profile_likelihood import (
    CURVED,
    FLAT,
    LEVEL,
    NEAR,
    ONE_SIDED,
    OPEN,
    PLATEAU,
    REACH,
    STEEP,
    STEPS,
    TWO_SIDED,
)

_ROOTS = 6
"""Steps of the search for a limit between a value inside and one outside."""


class Around(NamedTuple):
    """The misfit around the minima of pixels.

    `best` (pixels, parameters) in the parameters' own units between `lower` and `upper` (parameters,), with
    `covariance` (pixels, parameters, parameters) by the curvature; `natural` (parameters, 2) says of each
    bound whether physics sets it. `misfit(which, at)` returns χ² of the pixels `which` at `at` (which,
    candidates, parameters); `refitted(which, axis, at)` the least χ² with parameter `axis` (which,) held
    where `at` (which, parameters) has it and the others refitted from there, and the values then.
    """

    best: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    covariance: np.ndarray
    natural: np.ndarray
    misfit: Callable[[np.ndarray, np.ndarray], np.ndarray]
    refitted: Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

    @property
    def sd(self) -> np.ndarray:
        """Standard errors (pixels, parameters) by the curvature."""
        return np.sqrt(np.einsum("pii->pi", self.covariance))


def by_curvature(around: Around) -> np.ndarray:
    """Standard errors (pixels, parameters) by the covariance, infinite where the data add nothing to the
    bounds."""
    sd = around.sd
    return np.where(sd <= UNSEEN * (around.upper - around.lower), sd, np.inf)


def flat_sides(thickness: np.ndarray, rise: np.ndarray, value: np.ndarray) -> np.ndarray:
    """On which sides (pixels, 2) of the best thickness (pixels,) the misfit (pixels, nodes) at the nodes of a
    scan never rises, or only to a plateau."""
    close, nodes = rise < ONE_SIDED, np.arange(len(thickness))
    thinner = (thickness < value[:, None] - NEAR).sum(axis=1)
    thicker = (thickness > value[:, None] + NEAR).sum(axis=1)
    first = len(thickness) - thicker
    below = _open(rise, nodes < thinner[:, None], nodes < (thinner - thinner // 2)[:, None])
    above = _open(rise, nodes >= first[:, None], nodes >= (first + thicker // 2)[:, None])
    next_up = close[np.arange(len(value)), np.minimum(first, len(thickness) - 1)]
    next_down = close[np.arange(len(value)), np.maximum(thinner - 1, 0)]
    below = np.where(thinner > 0, below, next_up | (thicker == 0))
    above = np.where(thicker > 0, above, next_down | (thinner == 0))
    return np.stack([below, above], axis=1)


def _open(rise: np.ndarray, side: np.ndarray, far: np.ndarray) -> np.ndarray:
    """True where the misfit on a `side` never rises, or its `far` half is a plateau."""
    highest = np.max(np.where(side, rise, -np.inf), axis=1)
    top = np.max(np.where(far, rise, -np.inf), axis=1)
    foot = np.min(np.where(far, rise, np.inf), axis=1)
    plateau = (far.sum(axis=1) > 1) & (top < PLATEAU) & (top - foot < LEVEL)
    return (highest < OPEN) | plateau


def errors(around: Around, flat: dict[int, np.ndarray], usable: np.ndarray) -> np.ndarray:
    """Standard errors (pixels, parameters), infinite where a side is open that physics does not close.

    `flat` are the `flat_sides` (pixels, 2) of scanned parameters. Pixels that are not `usable` have errors by
    the covariance alone.
    """
    sd, span, seen = around.sd, around.upper - around.lower, by_curvature(around)
    result = seen.copy()
    who = np.flatnonzero(usable)
    if not len(who):
        return result
    doubted = (sd[who] > UNSEEN * span) | _not_parabolic(around, who, sd[who])
    for axis in range(len(span)):
        sides = flat[axis][who] if axis in flat else np.zeros((len(who), 2), bool)
        bounds = np.array([around.lower[axis], around.upper[axis]])
        near = np.abs(bounds - around.best[who, axis, None]) < REACH * sd[who, axis, None]
        beside = np.any(near & around.natural[axis], axis=1)
        jobs = np.flatnonzero(~beside & (doubted[:, axis] | sides.any(axis=1)))
        if len(jobs):
            result[who[jobs], axis] = _profiled(around, who[jobs], axis, sides[jobs], seen[who[jobs], axis])
    return result


def _not_parabolic(around: Around, who: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Parameters (pixels, parameters) along whose axis the misfit is far from the parabola."""
    best, covariance = around.best[who], around.covariance[who]
    along = REACH * covariance / sd[:, :, None]
    ends = np.concatenate([best[:, None] + along, best[:, None] - along], axis=1)
    ends = np.clip(ends, around.lower, around.upper)
    misfit = around.misfit(who, np.concatenate([best[:, None], ends], axis=1))
    count = best.shape[1]
    rise = (misfit[:, 1:] - misfit[:, :1]).reshape(len(who), 2, count)
    own = np.einsum("psii->psi", (ends - best[:, None]).reshape(len(who), 2, count, count))
    moved = np.abs(own) / sd[:, None]
    share = rise / np.maximum(moved, 1e-100) ** 2
    return np.any((moved > 0.5) & ((share < FLAT) | (share > CURVED)), axis=1)


def _profiled(around: Around, who: np.ndarray, axis: int, flat: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Standard errors (pixels,) of one parameter by its profile."""
    crossings = [_Crossing(around, who, axis, side, ~flat[:, i]) for i, side in enumerate((-1, 1))]
    closed = np.stack([crossing.closed for crossing in crossings], axis=1)
    both, result = closed.all(axis=1), np.full(len(who), np.inf)
    ends = [crossing.value(np.where(both, TWO_SIDED, ONE_SIDED)) for crossing in crossings]
    result[both] = (ends[1] - ends[0])[both] / (2 * TWO_SIDED**0.5)
    value, low, high = around.best[who, axis], around.lower[axis], around.upper[axis]
    one = closed.any(axis=1) & ~both
    limit = np.where(closed[:, 1], ends[1], ends[0])
    rests = np.minimum(value - low, high - value) <= 1e-6 * (high - low)
    steep = rests & (np.abs(limit - value) < STEEP * error) & ~flat.any(axis=1)
    natural = (closed | around.natural[axis]).all(axis=1)
    return np.where(one & (natural | steep), error, result)


class _Crossing:
    """Search for the point where a parameter's profile rises on one side (−1 or 1), for `wanted` pixels."""

    def __init__(self, around: Around, who: np.ndarray, axis: int, side: int, wanted: np.ndarray):
        self._around, self._who, self._axis = around, who, axis
        best = around.best[who]
        bound = around.lower[axis] if side < 0 else around.upper[axis]
        room = bound - best[:, axis]
        sd = np.sqrt(around.covariance[who, axis, axis])
        first = np.clip(ONE_SIDED**0.5 * sd / np.maximum(np.abs(room), 1e-200), 1e-6, 0.3)
        slope = around.covariance[who, axis] / around.covariance[who, axis, axis][:, None]
        self._floor, _ = around.refitted(who, np.full(len(who), axis), best)
        self._inside, self._outside = best.copy(), best.copy()
        self._low, self._high = np.zeros(len(who)), np.zeros(len(who))
        self.closed, near = np.zeros(len(who), bool), best.copy()
        for step in range(STEPS):
            todo = np.flatnonzero(wanted & ~self.closed & (np.abs(room) > 0))
            if not len(todo):
                break
            value = best[todo, axis] + room[todo] * first[todo] ** (1 - step / (STEPS - 1))
            start = near[todo] + (value - near[todo, axis])[:, None] * slope[todo]
            rise, at = self._rise(todo, value, start)
            moved = at[:, axis] - near[todo, axis]
            slope[todo] = (at - near[todo]) / np.where(moved, moved, 1.0)[:, None]
            near[todo] = at
            over, under = rise > OPEN, rise < ONE_SIDED
            self.closed[todo[over]] = True
            self._outside[todo[over]], self._high[todo[over]] = at[over], rise[over]
            self._inside[todo[under]], self._low[todo[under]] = at[under], rise[under]

    def _rise(self, rows: np.ndarray, value: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        start = np.clip(start, self._around.lower, self._around.upper)
        start[:, self._axis] = value
        misfit, at = self._around.refitted(self._who[rows], np.full(len(rows), self._axis), start)
        return np.maximum(misfit - self._floor[rows], 0.0), at

    def value(self, level: np.ndarray) -> np.ndarray:
        """The value (pixels,) at which the misfit reaches a level (pixels,): its root grows nearly
        linearly."""
        rows = np.flatnonzero(self.closed)
        one, other = self._inside[rows].copy(), self._outside[rows].copy()
        low, high = ((x[rows] / level[rows]) ** 0.5 - 1 for x in (self._low, self._high))
        for _ in range(_ROOTS if len(rows) else 0):
            share = np.clip(low / np.where(low == high, 1.0, low - high), 0.02, 0.98)[:, None]
            middle = one + share * (other - one)
            rise, middle = self._rise(rows, middle[:, self._axis].copy(), middle)
            now = (rise / level[rows]) ** 0.5 - 1
            below = now < 0
            one[below], low[below] = middle[below], now[below]
            other[~below], high[~below] = middle[~below], now[~below]
        result = np.full(len(self._who), np.nan)
        share = np.clip(low / np.where(low == high, 1.0, low - high), 0.0, 1.0)[:, None]
        result[rows] = (one + share * (other - one))[:, self._axis]
        return result


def resampled(grid: np.ndarray, thickness: np.ndarray, profile: np.ndarray) -> np.ndarray:
    """A scan (pixels, nodes) against thickness at the values of another grid, linearly."""
    at = np.clip(np.searchsorted(thickness, grid) - 1, 0, len(thickness) - 2)
    share = np.clip((grid - thickness[at]) / (thickness[at + 1] - thickness[at]), 0.0, 1.0)
    return profile[:, at] * (1 - share) + profile[:, at + 1] * share


def natural_bounds(natural: Sequence[tuple[bool, bool]]) -> np.ndarray:
    """Return (parameters, 2), True where physics sets the lower and the upper bound."""
    return np.reshape(natural, (-1, 2)).astype(bool)
