"""Limits of parameters by profile likelihood, of one fit or of many.

A standard error approximates χ² by a parabola. Where that fails (a film too thick to see through, an
extinction next to 0, a curved valley) the parameter is fixed at one value after the other, all others are
fitted again, and the limit is where χ² has risen by its 95 % threshold (bounded likelihood: W. Rolke,
A. López and J. Conrad, 2005, Nucl. Instrum. Methods A 551, 493).

The way to a limit is that of one parameter, a generator of values; the fits at these values are made for all
parameters and all fits that need them at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.covariance import UNSEEN
from pellicle.fitting.parameter import ON_BOUND
from pellicle.fitting.status import RIVAL

ONE_SIDED, TWO_SIDED = 2.71, 3.84
"""χ² above the best at a 95 % limit, where one side is bounded and where both are."""
OPEN = RIVAL
"""A side is open where the misfit never rises by this, which would rule out a rival."""
PLATEAU, LEVEL = 10.0, 1.0
"""A side is open, too, where the outer half of the misfit is below `PLATEAU` and level within `LEVEL`. An
absorbing film looks the same at any large thickness, and noise favours one of many by that much."""
REACH = 2.0
"""Standard errors at which the parabola is compared with the misfit, and within which a bound matters."""
FLAT, CURVED = 0.5, 4.0
"""The misfit at that reach as a share of the parabola's: outside of these a profile is made."""
NEAR = 1e-3
"""A best thickness this close (nm) to a bound rests on it; the side is open if the misfit is flat there."""
STEEP = 3.3
"""A limit nearer than this many standard errors to a bound on which the best value rests: the misfit rises
from there, as it would not for a parameter that the data do not see."""
STEPS = 7
"""Values on each side of the best one at which a profile is computed, unless it has risen enough before."""
_EXACT = 2e-3
"""Share of the interval in which a limit lies that its error may be."""
_MOST_STEPS = 100
"""Steps of a search for a limit, at most."""


class Limits(NamedTuple):
    """Standard errors (..., parameters), infinite where a side is open that physics does not close, and 95 %
    limits where only one side is bounded, NaN where there are none."""

    stderr: Any
    lower: Any = math.nan
    upper: Any = math.nan


class Neighbourhood(NamedTuple):
    """χ² around the best points of fits, above some constant; it counts points as the covariance does.

    `best` (fits, parameters), between `lower` and `upper` (parameters,), and `covariance` (fits, parameters,
    parameters) are in the parameters' own units. `natural` (parameters, 2) says of each lower and upper bound
    whether physics sets it. `misfit(which, at)` returns χ² of the fits `which` at `at` (which, candidates,
    parameters). `profile(which, axis, values, starts)` returns the least χ² (which,) with the parameter
    `axis` (which,) fixed at `values` (which,) and the others fitted from `starts` (which, starts,
    parameters), and the points (which, parameters) where it is. `others` (fits, any, parameters) are further
    minima from which a profile may be reached.
    """

    best: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    covariance: np.ndarray
    natural: np.ndarray
    misfit: Callable[[np.ndarray, np.ndarray], np.ndarray]
    profile: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    others: np.ndarray

    @property
    def stderr(self) -> np.ndarray:
        return np.sqrt(np.einsum("pii->pi", self.covariance))

    def parabolic(self, which: np.ndarray) -> np.ndarray:
        """Parameters (which, parameters) along whose axis the misfit is near the parabola of the covariance,
        `REACH` standard errors to both sides, with the others where the covariance expects them."""
        best, stderr = self.best[which], self.stderr[which]
        along = REACH * self.covariance[which] / stderr[:, :, None]
        ends = np.concatenate([best[:, None] + along, best[:, None] - along], axis=1)
        ends = np.clip(ends, self.lower, self.upper)
        misfit = self.misfit(which, np.concatenate([best[:, None], ends], axis=1))
        shape = len(best), 2, best.shape[1]
        rise = (misfit[:, 1:] - misfit[:, :1]).reshape(shape)
        own = np.einsum("psii->psi", (ends - best[:, None]).reshape(*shape, shape[2]))
        # fewer standard errors where a bound is nearer
        moved = np.abs(own) / stderr[:, None]
        share = rise / np.maximum(moved, 1e-100) ** 2
        return ~np.any((moved > 0.5) & ((share < FLAT) | (share > CURVED)), axis=1)


def by_curvature(stderr: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Standard errors (..., parameters), infinite where the data add nothing to the bounds (parameters,)."""
    return np.where(stderr <= UNSEEN * (upper - lower), stderr, np.inf)


def limits(
    around: Neighbourhood, flat: Mapping[int, np.ndarray] | None = None, usable: np.ndarray | None = None
) -> Limits:
    """Limits of each parameter of each fit.

    `flat` are the `flat_sides` (fits, 2) of scanned parameters. Fits that are not `usable` (fits,) have
    errors by the covariance alone.
    """
    sd, shape = around.stderr, around.best.shape
    result = Limits(by_curvature(sd, around.lower, around.upper), *np.full((2, *shape), np.nan))
    which = np.arange(len(sd)) if usable is None else np.flatnonzero(usable)
    if not len(which):
        return result
    doubted = np.isinf(result.stderr[which]) | ~around.parabolic(which)
    searches = []
    for axis, natural in enumerate(around.natural):
        ends = np.array([around.lower[axis], around.upper[axis]])
        near = np.abs(around.best[which, axis, None] - ends) < REACH * sd[which, axis, None]
        beside = near & natural
        open_ = flat[axis][which] if flat and axis in flat else np.zeros(near.shape, bool)
        for i in np.flatnonzero(beside.any(axis=1) | doubted[:, axis] | open_.any(axis=1)).tolist():
            one = _OneParameter(around, int(which[i]), axis)
            way = (
                one.beside(float(ends[np.argmax(beside[i])]))
                if beside[i].any()
                else one.profiled(tuple(open_[i].tolist()), tuple(natural.tolist()))
            )
            searches.append(_Search(one, way))
    for search, deviance in zip(searches, _run(around, searches), strict=True):
        at = search.parameter.fit, search.parameter.axis
        for column, number in zip(result, deviance, strict=True):
            column[at] = number
    return result


def interval(around: Neighbourhood, axis: int) -> tuple[float, float]:
    """The 95 % interval of one parameter of one fit by profile likelihood, whatever its status.

    An end is the bound where the misfit never rises on the way to it.
    """
    one = _OneParameter(around, 0, axis)
    [ends] = _run(around, [_Search(one, one.interval())])
    return ends


class _Side(NamedTuple):
    """Interval in which the misfit crosses a level: a value inside and a value outside."""

    inside: float
    outside: float


class _Answer(NamedTuple):
    """The fit with the parameter fixed at one value."""

    deviance: float
    point: np.ndarray


class _Search(NamedTuple):
    """The way to the limits of a parameter, a generator of values at which it is to be fixed."""

    parameter: _OneParameter
    way: Generator[list[float], None, Any]


def _run(around: Neighbourhood, searches: Sequence[_Search]) -> list[Any]:
    """Results of searches, whose values are fitted together."""
    results: dict[int, Any] = {}
    while len(results) < len(searches):
        jobs: list[tuple[_OneParameter, float]] = []
        for i, (parameter, way) in enumerate(searches):
            if i in results:
                continue
            try:
                jobs += [(parameter, value) for value in next(way)]
            except StopIteration as end:
                results[i] = end.value
        if jobs:
            which, axis = (np.array([getattr(p, name) for p, _ in jobs]) for name in ("fit", "axis"))
            starts = np.array([[*p.ahead(value), *around.others[p.fit]] for p, value in jobs])
            deviance, points = around.profile(which, axis, np.array([value for _, value in jobs]), starts)
            for (parameter, value), *answer in zip(jobs, deviance.tolist(), points, strict=True):
                parameter.known[value] = _Answer(*answer)
    return [results[i] for i in range(len(searches))]


_Values = Generator[list[float], None, Any]
"""A way yields values of the parameter, at which the others are then fitted, and returns what it finds."""


class _OneParameter:
    """The profile likelihood of one parameter of one fit: its best value, its bounds, its standard error `sd`
    by the parabola."""

    def __init__(self, around: Neighbourhood, fit: int, axis: int):
        self.fit, self.axis, self.ends = fit, axis, (around.lower, around.upper)
        self.best, self.value = around.best[fit], float(around.best[fit, axis])
        self.lower, self.upper = float(around.lower[axis]), float(around.upper[axis])
        covariance = around.covariance[fit, axis]
        self.sd = float(np.sqrt(covariance[axis]))
        # where the covariance expects the others
        self.along = covariance / covariance[axis]
        self.known: dict[float, _Answer] = {}

    @property
    def error(self) -> float:
        """The standard error, infinite where it says no more than the bounds."""
        return self.sd if self.sd <= UNSEEN * (self.upper - self.lower) else np.inf

    def rise(self, values: Sequence[float]) -> _Values:
        """χ² above the best with the parameter fixed at each value and all others fitted again.

        The others start from the answer at the nearest value so far, there and moved along the line through
        the two nearest on its side, and at further minima.
        """
        if not self.known:
            yield [self.value]
        if missing := [value for value in values if value not in self.known]:
            yield missing
        best = self.known[self.value].deviance
        return [max(self.known[value].deviance - best, 0.0) for value in values]

    def ahead(self, value: float) -> tuple[np.ndarray, np.ndarray]:
        """Two starts for a fit with the parameter at `value`, by what is known nearer to the best one."""
        if not self.known:
            return self.best, self.best
        side = [v for v in self.known if (v - self.value) * (value - self.value) >= 0]
        near, *rest = sorted(side, key=lambda v: abs(v - value))
        point = self.known[near].point
        if rest and rest[0] != near:
            slope = (point - self.known[rest[0]].point) / (near - rest[0])
        else:
            slope = self.along
        return np.clip(point + (value - near) * slope, *self.ends), point

    def interval(self) -> _Values:
        """The 95 % interval."""
        bounds = [self.lower, self.upper]
        sides = yield from self.sides(bounds, TWO_SIDED)
        result = []
        for bound, side in zip(bounds, sides, strict=True):
            result.append(bound if side is None else (yield from self.crossing(side, TWO_SIDED)))
        return tuple(result)

    def beside(self, end: float) -> _Values:
        """Limits where the best value may as well be `end`, a bound that physics sets."""
        below = end == self.lower
        [side] = yield from self.sides([self.upper if below else self.lower], ONE_SIDED)
        [rise] = yield from self.rise([end])
        if rise > ONE_SIDED:
            return Limits(self.error)
        if side is None:
            return Limits(np.inf)
        limit = yield from self.crossing(side, ONE_SIDED)
        return Limits(self.error, upper=limit) if below else Limits(self.error, limit)

    def profiled(self, flat: tuple[bool, ...], natural: tuple[bool, ...]) -> _Values:
        """Limits where the misfit is no parabola; `flat` are sides known to be open, and an open side with a
        `natural` bound is closed by physics."""
        sides = yield from self.sides([self.lower, self.upper], OPEN)
        below, above = (None if known else side for known, side in zip(flat, sides, strict=True))
        if below is not None and above is not None:
            low = yield from self.crossing(below, TWO_SIDED)
            high = yield from self.crossing(above, TWO_SIDED)
            return Limits((high - low) / (2 * TWO_SIDED**0.5))
        lower = math.nan if below is None else (yield from self.crossing(below, ONE_SIDED))
        upper = math.nan if above is None else (yield from self.crossing(above, ONE_SIDED))
        limit = upper if below is None else lower
        closed = natural[0] or below is not None, natural[1] or above is not None
        if all(closed) and not math.isnan(limit):
            return Limits(self.error, lower, upper)
        margin = min(self.value - self.lower, self.upper - self.value)
        rests = margin <= ON_BOUND * (self.upper - self.lower)
        if rests and abs(limit - self.value) < STEEP * self.error and not any(flat):
            return Limits(self.error)  # the data push against that bound: they see the parameter well enough
        return Limits(np.inf, lower, upper)

    def sides(self, bounds: Sequence[float], level: float) -> _Values:
        """Interval in which the misfit crosses `level` on the way to each bound, None where it never does.

        It is computed at values from the best one outwards, each so many times further away than the last.
        """
        ways = {}
        for bound in bounds:
            room = bound - self.value
            first = min(ONE_SIDED**0.5 * self.sd / max(abs(room), 1e-300), 0.3)
            ways[bound] = (self.value + room * np.geomspace(max(first, 1e-6), 1.0, STEPS)).tolist()
        inside, result = dict.fromkeys(bounds, self.value), dict.fromkeys(bounds)
        for step in range(STEPS):
            going = [bound for bound in bounds if result[bound] is None]
            values = [ways[bound][step] for bound in going]
            rises = yield from self.rise(values)
            for bound, value, rise in zip(going, values, rises, strict=True):
                if rise > level:
                    result[bound] = _Side(inside[bound], value)
                elif rise < ONE_SIDED:
                    inside[bound] = value
        return [result[bound] for bound in bounds]

    def crossing(self, side: _Side, level: float) -> _Values:
        """Value at which the misfit reaches `level`: its root grows nearly linearly.

        **Source:** R. Brent, 1973, Algorithms for minimization without derivatives, chapter 4.
        """

        def above(value: float) -> _Values:
            [rise] = yield from self.rise([value])
            return (rise / level) ** 0.5 - 1

        delta = 0.5 * _EXACT * abs(side.outside - side.inside)
        before, now = side
        f_before, f_now = (yield from above(before)), (yield from above(now))
        across, f_across, last, step = before, f_before, now - before, now - before
        for _ in range(_MOST_STEPS):
            if np.sign(f_before) != np.sign(f_now):
                across, f_across, last, step = before, f_before, now - before, now - before
            if abs(f_across) < abs(f_now):
                before, now, across = now, across, now
                f_before, f_now, f_across = f_now, f_across, f_now
            half = 0.5 * (across - now)
            if f_now == 0 or abs(half) < delta:
                break
            last, step = _brent_step((before, now, across), (f_before, f_now, f_across), last, step, delta)
            before, f_before = now, f_now
            now += step if abs(step) > delta else float(np.copysign(delta, half))
            f_now = yield from above(now)
        return now


def _brent_step(
    x: tuple[float, float, float], f: tuple[float, float, float], last: float, step: float, delta: float
) -> tuple[float, float]:
    """The step before and the next step from the middle one of three points towards a root: by inverse
    quadratic interpolation where that is short enough, else to half the interval."""
    (before, now, across), (f_before, f_now, f_across), half = x, f, 0.5 * (x[2] - x[1])
    if abs(last) > delta and abs(f_now) < abs(f_before):
        if before == across:
            trial = -f_now * (now - before) / (f_now - f_before)
        else:
            left, right = (f_before - f_now) / (before - now), (f_across - f_now) / (across - now)
            trial = -f_now * (f_across * right - f_before * left) / (right * left * (f_across - f_before))
        if 2 * abs(trial) < min(abs(last), 3 * abs(half) - delta):
            return step, trial
    return half, half


def flat_sides(thickness: np.ndarray, rise: np.ndarray, value: np.ndarray) -> np.ndarray:
    """On which sides (fits, 2) of the best thickness (fits,) the misfit (fits, nodes) at the thicknesses
    (nodes,) of a scan never rises, or only to a plateau."""
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
    """True (fits,) where the misfit on a `side` never rises, or its `far` half is a plateau."""
    highest = np.max(np.where(side, rise, -np.inf), axis=1)
    top = np.max(np.where(far, rise, -np.inf), axis=1)
    foot = np.min(np.where(far, rise, np.inf), axis=1)
    plateau = (far.sum(axis=1) > 1) & (top < PLATEAU) & (top - foot < LEVEL)
    return (highest < OPEN) | plateau
