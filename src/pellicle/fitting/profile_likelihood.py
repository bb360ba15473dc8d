"""Limits of parameters by profile likelihood.

A standard error approximates χ² by a parabola. Where that fails (a film too thick to see through, an
extinction next to 0, a curved valley) the parameter is fixed at one value after the other, all others are
fitted again, and the limit is where χ² has risen by its 95 % threshold (bounded likelihood: W. Rolke,
A. López and J. Conrad, 2005, Nucl. Instrum. Methods A 551, 493).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pellicle.fitting.covariance import UNSEEN
from pellicle.fitting.neighbourhood import Neighbourhood
from pellicle.fitting.result import Profile
from pellicle.fitting.status import RIVAL

ONE_SIDED, TWO_SIDED = 2.71, 3.84
"""χ² above the best at a 95 % limit, where one side is bounded and where both are."""
_OPEN = RIVAL
"""A side is open where the misfit never rises by this, which would rule out a rival."""
_REACH = 2.0
"""Standard errors at which the parabola is compared with the misfit, and within which a bound matters."""
_FLAT, _CURVED = 0.5, 4.0
"""The misfit at that reach as a share of the parabola's: outside of these a profile is made."""
_NEAR = 1e-3
"""A best thickness this close (nm) to a bound rests on it; the side is open if the misfit is flat there."""
_STEEP = 3.3
"""A limit nearer than this many standard errors to a bound on which the best value rests: the misfit rises
from there, as it would not for a parameter that the data do not see."""
_STEPS = 7
"""Values on each side of the best one at which a profile is looked at, and again around a limit."""

Rise = Callable[[np.ndarray], np.ndarray]
"""χ² above the best where the parameter is held at each value and all others are fitted again."""


class Limits(NamedTuple):
    """A standard error, infinite where a side is open that physics does not close, and 95 % limits where
    only one side is bounded."""

    stderr: float
    lower: float | None = None
    upper: float | None = None


def limits(around: Neighbourhood, scans: Mapping[int, Profile] | None = None) -> list[Limits]:
    """Limits of each parameter; `scans` are scans of the misfit against some of them."""
    doubted, scans = _doubted(around), scans or {}
    result = []
    for i, natural in enumerate(around.natural):
        at, rise = _best(around, i), _rise(around, i)
        flat = _flat(scans[i], at.value) if i in scans else (False, False)
        ends = [end for end, is_one in zip((at.lower, at.upper), natural, strict=True) if is_one]
        beside = next((end for end in ends if abs(at.value - end) < _REACH * at.sd), None)
        if beside is not None:
            result.append(_beside(rise, at, beside))
        elif doubted[i] or any(flat):
            result.append(_profiled(rise, at, flat, natural))
        else:
            result.append(Limits(at.error))
    return result


def interval(around: Neighbourhood, which: int) -> tuple[float, float]:
    """The 95 % interval of one parameter by profile likelihood, whatever its status.

    An end is the bound where the misfit never rises on the way to it.
    """
    at, rise = _best(around, which), _rise(around, which)
    bounds = [at.lower, at.upper]
    sides = _sides(rise, at, bounds, TWO_SIDED)
    low, high = (
        bound if side is None else _crossing(rise, side, TWO_SIDED)
        for bound, side in zip(bounds, sides, strict=True)
    )
    return low, high


class _Best(NamedTuple):
    """A parameter's best value, its bounds and its standard error by the parabola."""

    value: float
    lower: float
    upper: float
    sd: float

    @property
    def error(self) -> float:
        """The standard error, infinite where it says no more than the bounds."""
        return self.sd if self.sd <= UNSEEN * (self.upper - self.lower) else np.inf

    @property
    def rests(self) -> bool:
        """Whether the best value is one of the bounds."""
        return min(self.value - self.lower, self.upper - self.value) <= 1e-6 * (self.upper - self.lower)


class _Side(NamedTuple):
    """Where the misfit has not ruled a value out yet, and where it has."""

    inside: float
    outside: float


def _best(around: Neighbourhood, which: int) -> _Best:
    lower, upper = float(around.lower[which]), float(around.upper[which])
    return _Best(float(around.values[which]), lower, upper, float(around.stderr[which]))


def _doubted(around: Neighbourhood) -> np.ndarray:
    """Which parameters the parabola may have wrong, (parameters,), by a look along the axis of each.

    Two standard errors out, with the others where the covariance expects them, it says 4.
    """
    best, span, stderr = around.best, around.upper - around.lower, around.stderr
    along = _REACH * around.covariance / stderr[:, None] / span
    ends = np.clip(best + np.concatenate([along, -along]), 0.0, 1.0)
    misfit = around.misfit(np.concatenate([best[None], ends]))
    own = np.concatenate([np.diag(half - best) for half in np.split(ends, 2)])
    moved = np.abs(own) * np.tile(span / stderr, 2)
    share = (misfit[1:] - misfit[0]) / np.maximum(moved, 1e-100) ** 2
    wrong = (moved > 0.5) & ((share < _FLAT) | (share > _CURVED))
    return (stderr > UNSEEN * span) | wrong.reshape(2, len(best)).any(axis=0)


def _rise(around: Neighbourhood, which: int) -> Rise:
    """The profile of one parameter: the others start at their best values, where the covariance expects
    them, along a curved valley, and at further minima."""
    covariance, best = around.covariance, around.best
    slope = covariance[which] / covariance[which, which] / (around.upper - around.lower)
    value = around.values[which]

    def rise(values: np.ndarray) -> np.ndarray:
        values = np.append(values, value)
        moved = np.clip(best + (values - value)[:, None] * slope, 0.0, 1.0)
        starts = np.stack([moved, *(np.broadcast_to(x, moved.shape) for x in (best, *around.others))], axis=1)
        found = around.profile(which, values, starts)
        return np.maximum(found[:-1] - found[-1], 0.0)

    return rise


def _beside(rise: Rise, at: _Best, end: float) -> Limits:
    """Of a parameter that physics bounds, where its best value may as well be that bound."""
    below = end == at.lower
    [side] = _sides(rise, at, [at.upper if below else at.lower], ONE_SIDED)
    if rise(np.array([end]))[0] > ONE_SIDED:
        return Limits(at.error)
    if side is None:
        return Limits(np.inf)
    limit = _crossing(rise, side, ONE_SIDED)
    return Limits(at.error, None, limit) if below else Limits(at.error, limit, None)


def _profiled(rise: Rise, at: _Best, flat: tuple[bool, bool], natural: tuple[bool, bool]) -> Limits:
    """Of a parameter whose misfit is no parabola; `flat` are sides known to be open, and an open side with a
    `natural` bound is closed by physics."""
    found = _sides(rise, at, [at.lower, at.upper], _OPEN)
    below, above = (None if known else side for known, side in zip(flat, found, strict=True))
    if below is not None and above is not None:
        low, high = (_crossing(rise, side, TWO_SIDED) for side in (below, above))
        return Limits((high - low) / (2 * TWO_SIDED**0.5))
    lower, upper = (None if side is None else _crossing(rise, side, ONE_SIDED) for side in (below, above))
    limit = upper if lower is None else lower
    closed = natural[0] or below is not None, natural[1] or above is not None
    if all(closed) and limit is not None:
        return Limits(at.error, lower, upper)
    if at.rests and limit is not None and abs(limit - at.value) < _STEEP * at.error and not any(flat):
        return Limits(at.error)  # the data push against that bound: they see the parameter well enough
    return Limits(np.inf, lower, upper)


def _sides(rise: Rise, at: _Best, bounds: Sequence[float], level: float) -> list[_Side | None]:
    """On the way to each bound where the misfit rises above `level`, None where it never does."""
    ways = [_way(at, bound) for bound in bounds]
    above = np.split(rise(np.concatenate(ways)), len(ways))
    return [_side(at.value, way, found, level) for way, found in zip(ways, above, strict=True)]


def _way(at: _Best, bound: float) -> np.ndarray:
    """Values from the best one to a bound, each so many times further away than the last."""
    room = bound - at.value
    first = min(ONE_SIDED**0.5 * at.sd / max(abs(room), 1e-300), 0.3)
    return at.value + room * np.geomspace(max(first, 1e-6), 1.0, _STEPS)


def _side(value: float, way: np.ndarray, found: np.ndarray, level: float) -> _Side | None:
    if not (found > level).any():
        return None
    first = int(np.argmax(found > level))
    near = [value, *way[:first][found[:first] < ONE_SIDED]]
    return _Side(float(near[-1]), float(way[first]))


def _crossing(rise: Rise, side: _Side, level: float) -> float:
    """Where the misfit reaches `level`: between two of several values its root is straight enough."""
    values = np.linspace(side.inside, side.outside, _STEPS + 1)
    root = np.sqrt(rise(values)) / level**0.5
    last = max(int(np.argmax(root > 1)), 1)
    near, far = root[last - 1 : last + 1]
    share = np.clip((1 - near) / max(far - near, 1e-12), 0.0, 1.0)
    return float(values[last - 1] + (values[last] - values[last - 1]) * share)


def _flat(scan: Profile, best: float) -> tuple[bool, bool]:
    """On which sides of the best thickness the search never saw the misfit rise."""
    close, level = scan.delta_chi2 < ONE_SIDED, scan.delta_chi2 < _OPEN
    left, right = scan.thickness < best - _NEAR, scan.thickness > best + _NEAR
    below = level[left].all() if left.any() else close[right][:1].all()
    above = level[right].all() if right.any() else close[left][-1:].all()
    return bool(below), bool(above)
