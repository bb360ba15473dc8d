"""Limits of parameters by profile likelihood.

A standard error approximates χ² by a parabola. Where that fails (a film too thick to see through, an
extinction next to 0, a curved valley) the parameter is fixed at one value after the other, all others are
fitted again, and the limit is where χ² has risen by its 95 % threshold (bounded likelihood: W. Rolke,
A. López and J. Conrad, 2005, Nucl. Instrum. Methods A 551, 493).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.covariance import UNSEEN
from pellicle.fitting.neighbourhood import Neighbourhood
from pellicle.fitting.result import Profile
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


class Limits(NamedTuple):
    """A standard error, infinite where a side is open that physics does not close, and 95 % limits where
    only one side is bounded."""

    stderr: float
    lower: float | None = None
    upper: float | None = None


def limits(around: Neighbourhood, scans: Mapping[int, Profile] | None = None) -> list[Limits]:
    """Limits of each parameter; `scans` are scans of the misfit against some of them."""
    moved, share = around.along_axes(REACH)
    wrong = (moved > 0.5) & ((share < FLAT) | (share > CURVED))
    doubted = (around.stderr > UNSEEN * (around.upper - around.lower)) | wrong.any(axis=0)
    scans, result = scans or {}, []
    for i, natural in enumerate(around.natural):
        one = _OneParameter(around, i)
        flat = one.flat_sides(scans[i]) if i in scans else (False, False)
        ends = [end for end, closed in zip((one.lower, one.upper), natural, strict=True) if closed]
        beside = next((end for end in ends if abs(one.value - end) < REACH * one.sd), None)
        if beside is not None:
            result.append(one.beside(beside))
        elif doubted[i] or any(flat):
            result.append(one.profiled(flat, natural))
        else:
            result.append(Limits(one.error))
    return result


def interval(around: Neighbourhood, which: int) -> tuple[float, float]:
    """The 95 % interval of one parameter by profile likelihood, whatever its status.

    An end is the bound where the misfit never rises on the way to it.
    """
    one = _OneParameter(around, which)
    bounds = [one.lower, one.upper]
    low, high = (
        bound if side is None else one.crossing(side, TWO_SIDED)
        for bound, side in zip(bounds, one.sides(bounds, TWO_SIDED), strict=True)
    )
    return low, high


class _Side(NamedTuple):
    """Interval in which the misfit crosses a level: a value inside and a value outside."""

    inside: float
    outside: float


class _Answer(NamedTuple):
    """The fit with the parameter fixed at one value."""

    deviance: float
    unit: np.ndarray


class _OneParameter:
    """The profile likelihood of one parameter: its best value, its bounds, its standard error `sd` by the
    parabola."""

    def __init__(self, around: Neighbourhood, which: int):
        self.around, self.which = around, which
        self.value, self.sd = float(around.values[which]), float(around.stderr[which])
        self.lower, self.upper = float(around.lower[which]), float(around.upper[which])
        # where the covariance expects the others
        slope = around.covariance[which] / around.covariance[which, which]
        self.along = slope / (around.upper - around.lower)
        self.known: dict[float, _Answer] = {}

    @property
    def error(self) -> float:
        """The standard error, infinite where it says no more than the bounds."""
        return self.sd if self.sd <= UNSEEN * (self.upper - self.lower) else np.inf

    def rise(self, values: Sequence[float]) -> list[float]:
        """χ² above the best with the parameter fixed at each value and all others fitted again.

        The others start from the answer at the nearest value so far, there and moved along the line through
        the two nearest on its side, and at further minima.
        """
        if not self.known:
            self._fit([self.value])
        self._fit([value for value in values if value not in self.known])
        best = self.known[self.value].deviance
        return [max(self.known[value].deviance - best, 0.0) for value in values]

    def _fit(self, values: list[float]) -> None:
        if values:
            starts = np.array([[*self._ahead(value), *self.around.others] for value in values])
            deviance, units = self.around.profile(self.which, np.array(values), starts)
            self.known |= {
                v: _Answer(*each) for v, *each in zip(values, deviance.tolist(), units, strict=True)
            }

    def _ahead(self, value: float) -> tuple[np.ndarray, np.ndarray]:
        """Two starts for a fit with the parameter at `value`, by what is known nearer to the best one."""
        if not self.known:
            return self.around.best, self.around.best
        side = [v for v in self.known if (v - self.value) * (value - self.value) >= 0]
        near, *rest = sorted(side, key=lambda v: abs(v - value))
        unit = self.known[near].unit
        if rest and rest[0] != near:
            slope = (unit - self.known[rest[0]].unit) / (near - rest[0])
        else:
            slope = self.along
        return np.clip(unit + (value - near) * slope, 0.0, 1.0), unit

    def beside(self, end: float) -> Limits:
        """Limits where the best value may as well be `end`, a bound that physics sets."""
        below = end == self.lower
        [side] = self.sides([self.upper if below else self.lower], ONE_SIDED)
        if self.rise([end])[0] > ONE_SIDED:
            return Limits(self.error)
        if side is None:
            return Limits(np.inf)
        limit = self.crossing(side, ONE_SIDED)
        return Limits(self.error, None, limit) if below else Limits(self.error, limit, None)

    def profiled(self, flat: tuple[bool, bool], natural: tuple[bool, bool]) -> Limits:
        """Limits where the misfit is no parabola; `flat` are sides known to be open, and an open side with a
        `natural` bound is closed by physics."""
        sides = self.sides([self.lower, self.upper], OPEN)
        below, above = (None if known else side for known, side in zip(flat, sides, strict=True))
        if below is not None and above is not None:
            low, high = self.crossing(below, TWO_SIDED), self.crossing(above, TWO_SIDED)
            return Limits((high - low) / (2 * TWO_SIDED**0.5))
        lower, upper = (None if side is None else self.crossing(side, ONE_SIDED) for side in (below, above))
        limit = upper if lower is None else lower
        closed = natural[0] or below is not None, natural[1] or above is not None
        if all(closed) and limit is not None:
            return Limits(self.error, lower, upper)
        rests = min(self.value - self.lower, self.upper - self.value) <= 1e-6 * (self.upper - self.lower)
        if rests and limit is not None and abs(limit - self.value) < STEEP * self.error and not any(flat):
            return Limits(self.error)  # the data push against that bound: they see the parameter well enough
        return Limits(np.inf, lower, upper)

    def sides(self, bounds: Sequence[float], level: float) -> list[_Side | None]:
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
            for bound, value, rise in zip(going, values, self.rise(values), strict=True):
                if rise > level:
                    result[bound] = _Side(inside[bound], value)
                elif rise < ONE_SIDED:
                    inside[bound] = value
        return [result[bound] for bound in bounds]

    def crossing(self, side: _Side, level: float) -> float:
        """Value at which the misfit reaches `level`: its root grows nearly linearly."""

        from scipy.optimize import brentq  # takes 0.2 s to import, and few fits need it

        def above(value: float) -> float:
            return (self.rise([value])[0] / level) ** 0.5 - 1

        root: Any = brentq(above, *side, xtol=_EXACT * abs(side.outside - side.inside))
        return root

    def flat_sides(self, scan: Profile) -> tuple[bool, bool]:
        """On which sides of the best thickness the misfit of the search's scan never rises."""
        close = scan.delta_chi2 < ONE_SIDED
        thinner, thicker = scan.thickness < self.value - NEAR, scan.thickness > self.value + NEAR
        outwards = scan.delta_chi2[thinner][::-1], scan.delta_chi2[thicker]
        below = _open(outwards[0]) if thinner.any() else close[thicker][:1].all()
        above = _open(outwards[1]) if thicker.any() else close[thinner][-1:].all()
        return bool(below), bool(above)


def _open(rise: np.ndarray) -> bool:
    """True where the misfit along a way to a bound never rises, or only to a plateau."""
    far = rise[len(rise) // 2 :]
    plateau = len(far) > 1 and far.max() < PLATEAU and np.ptp(far) < LEVEL
    return bool(rise.max() < OPEN or plateau)
