"""How far a parameter may go before the misfit rises: limits by profile likelihood.

A standard error pictures χ² as a parabola. Where that picture fails (a film too thick to see through, an
extinction next to 0, a curved valley) the parameter is held at one value after the other, all others are
fitted again, and the limit is where χ² has risen by as much as 95 % demand (bounded likelihood: W. Rolke,
A. López and J. Conrad, 2005, Nucl. Instrum. Methods A 551, 493).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pellicle.fitting.problem import Problem, View, thin
from pellicle.fitting.result import Profile
from pellicle.fitting.search import SCAN_POINTS, held, quiet, scanned
from pellicle.fitting.status import RIVAL
from pellicle.fitting.uncertainty import UNSEEN
from pellicle.fitting.weigh import Met, Weighed

ONE_SIDED, TWO_SIDED = 2.71, 3.84
"""χ² above the best at a 95 % limit: where one side is bounded, and where both are."""
_OPEN = RIVAL
"""A side where the misfit never rises by as much as would rule a rival out is open."""
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


def limits(weighed: Weighed, covariance: np.ndarray, seen: Profile | None) -> list[Limits]:
    """Limits of each nonlinear parameter, in the order of the problem's.

    `covariance` has these parameters first; `seen` is the search's scan of the thickness.
    """
    problem, best = _as_in_covariance(weighed), weighed.minima.units[0]
    doubted, values = _doubted(problem, best, covariance), problem.box.values(best)
    stderr = np.sqrt(np.diag(covariance))
    found = []
    for i, p in enumerate(problem.parameters):
        at = _Best(float(values[i]), p.lower, p.upper, float(stderr[i]))
        rise = _rise(problem, best, covariance, i)
        flat = _flat(seen, at.value) if seen is not None and i == problem.thickness_axis else (False, False)
        if p.natural_lower and at.value - at.lower < _REACH * at.sd:
            found.append(_beside_zero(rise, at))
        elif doubted[i] or any(flat):
            found.append(_profiled(rise, at, flat))
        else:
            found.append(Limits(at.error))
    return found


def interval(weighed: Weighed, covariance: np.ndarray, which: int) -> tuple[float, float]:
    """The 95 % interval of one nonlinear parameter by profile likelihood, whatever its status.

    An end is the bound where the misfit never rises on the way to it.
    """
    problem, best = _as_in_covariance(weighed), weighed.minima.units[0]
    p = problem.parameters[which]
    value, sd = float(problem.box.values(best)[which]), float(np.sqrt(covariance[which, which]))
    rise = _rise(problem, best, covariance, which)
    bounds = [p.lower, p.upper]
    sides = _sides(rise, _Best(value, p.lower, p.upper, sd), bounds, TWO_SIDED)
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


def _as_in_covariance(weighed: Weighed) -> Problem:
    """The problem with each point counting for as much as it does in the covariance."""
    views = zip(weighed.problem.views, weighed.met, strict=True)
    return weighed.problem._replace(views=tuple(_counted(view, met) for view, met in views))


def _counted(view: View, met: Met) -> View:
    return view._replace(data=view.data._replace(temper=np.float64(1 / met.variance)))


def _doubted(problem: Problem, best: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Which parameters the parabola may have wrong, (parameters,), by a look along the axis of each.

    Two standard errors out, with the others where the covariance expects them, it says 4.
    """
    box, count = problem.box, len(best)
    span, stderr = box.upper - box.lower, np.sqrt(np.diag(covariance))[:count]
    along = _REACH * covariance[:count, :count] / stderr[:, None] / span
    ends = np.clip(best + np.concatenate([along, -along]), 0.0, 1.0)
    thinned = problem._replace(views=tuple(thin(view, SCAN_POINTS) for view in problem.views))
    evidence = scanned(thinned, np.concatenate([best[None], ends]), quiet).sum(-1)
    own = np.concatenate([np.diag(half - best) for half in np.split(ends, 2)])
    moved = np.abs(own) * np.tile(span / stderr, 2)
    share = (evidence[1:] - evidence[0]) / np.maximum(moved, 1e-100) ** 2
    wrong = (moved > 0.5) & ((share < _FLAT) | (share > _CURVED))
    return (stderr > UNSEEN * span) | wrong.reshape(2, count).any(axis=0)


def _rise(problem: Problem, best: np.ndarray, covariance: np.ndarray, which: int) -> Rise:
    """The profile of one parameter: the others start at their best values, and where the covariance
    expects them, which follows a valley."""
    box, count = problem.box, len(best)
    slope = covariance[which, :count] / covariance[which, which] / (box.upper - box.lower)
    value = box.values(best)[which]

    def rise(values: np.ndarray) -> np.ndarray:
        values = np.append(values, value)
        moved = np.clip(best + (values - value)[:, None] * slope, 0.0, 1.0)
        starts = np.stack([moved, np.broadcast_to(best, moved.shape)], axis=1)
        found = held(problem, which, values, starts)
        return np.maximum(found[:-1] - found[-1], 0.0)

    return rise


def _beside_zero(rise: Rise, at: _Best) -> Limits:
    """Of a parameter that physics bounds from below, where its best value may as well be that bound."""
    [side] = _sides(rise, at, [at.upper], ONE_SIDED)
    zero = rise(np.array([at.lower]))[0]
    if zero > ONE_SIDED:
        return Limits(at.error)
    return Limits(np.inf) if side is None else Limits(at.error, None, _crossing(rise, side, ONE_SIDED))


def _profiled(rise: Rise, at: _Best, flat: tuple[bool, bool]) -> Limits:
    """Of a parameter whose misfit is no parabola; `flat` are sides known to be open."""
    found = _sides(rise, at, [at.lower, at.upper], _OPEN)
    below, above = (None if known else side for known, side in zip(flat, found, strict=True))
    if below is not None and above is not None:
        low, high = (_crossing(rise, side, TWO_SIDED) for side in (below, above))
        return Limits((high - low) / (2 * TWO_SIDED**0.5))
    lower, upper = (None if side is None else _crossing(rise, side, ONE_SIDED) for side in (below, above))
    limit = upper if lower is None else lower
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
