"""Turns of a trace at extrema: courses that are mirrored there have the same light.

The light of one wavelength is symmetric about each of its extrema. A film that goes on through one, and a
film that turns there abruptly, differ in their rates only, so each extremum of a path has a rival.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pellicle.fitting.batch.effects import nodes
from pellicle.fitting.film.problem import shortest_wavelength
from pellicle.mapping.trace_branches import Start, signals_at
from pellicle.mapping.trace_fit import Fit, Fitter

_NEAR = 0.04
"""Distance in wavelengths in the film within which a turn is at an extremum: the light there differs by 6 %
of its range."""
_ABRUPT = 7.4
"""Price of an abrupt turn, as Δχ²: it may happen anywhere, and 15 % of the thicknesses are within 8 nm of one
of six extrema, 2 ln(6 / 0.15)."""


_REACHED, _EARLY = (0.6, 0.9), 0.9
"""Shares of its longest way between which a path has its rate, and of the times before which it ends it."""


class Mirrored(NamedTuple):
    """Fits to be tried that are mirrored from a position `at` on, in the `run` of positions near it."""

    at: int
    run: np.ndarray
    starts: list[Start]

    def price(self, fit: Fit) -> float:
        """The deviance of a fit, and the price of an abrupt turn."""
        return fit.deviance + _ABRUPT * bool(np.any(fit.about["kinks"][self.run]))


class Mirrors(NamedTuple):
    """Thicknesses (extrema,) at which the light of a `fitter` has extrema."""

    fitter: Fitter
    extrema: np.ndarray

    @classmethod
    def of(cls, fitter: Fitter, fit: Fit) -> Mirrors:
        """The extrema of the light between the bounds, with the other parameters of a fit."""
        parameter, own = fitter.model.parameters[fitter.depth], len(fitter.kinds)
        grid = nodes(parameter.lower, parameter.upper, shortest_wavelength(fitter.model.problem))
        units = np.tile(np.clip(np.median(fit.smoothed.mean[:, :own], axis=0), 0.0, 1.0), (len(grid), 1))
        units[:, fitter.depth] = (grid - parameter.lower) / (parameter.upper - parameter.lower)
        slope = np.asarray(signals_at(fitter.model, units).slope)[:, 0, fitter.depth]
        at = np.flatnonzero(slope[1:] * slope[:-1] < 0)
        share = slope[at] / (slope[at] - slope[at + 1])
        return cls(fitter, grid[at] + share * (grid[at + 1] - grid[at]))

    def next(self, time: np.ndarray, fit: Fit, after: int) -> Mirrored | None:
        """Fits that are mirrored at the first position behind `after` at which a path is at an extremum; None
        behind the last one. A path that turns may go on at the same rate, too.
        """
        thickness, kinks = self.fitter.thickness(fit), fit.about["kinks"] > 0
        parameter, model = self.fitter.model.parameters[self.fitter.depth], self.fitter.model
        near = _NEAR * float(shortest_wavelength(model.problem))
        lower, upper = parameter.lower - near, parameter.upper + near
        events = list[Mirrored]()
        for level in self.extrema:
            away = thickness - level
            for run in _runs(np.abs(away) < near):
                first, last = run[0] - 1, run[-1] + 1
                if first < 0 or last == len(away):
                    continue
                turns = away[first] * away[last] > 0
                to = np.sign(away[first]) * away[run] if turns else np.abs(away[run])
                at = int(run[np.argmin(to)])
                other = np.where(np.arange(len(away)) < at, thickness, level - away)
                if at > after and lower < other.min() and other.max() < upper:
                    bent, close = kinks.copy(), np.abs(away[run])
                    bent[run[close <= max(0.5 * near, close.min())]] = True
                    every = [bent, kinks & ~bent] if turns else [bent]
                    events.append(Mirrored(at, run, [Start(time, other, x) for x in every]))
        return min(events, key=lambda event: event.at, default=None)

    def moved(self, start: Start) -> Iterator[Start]:
        """A course as a whole a fringe thicker, thinner, or mirrored at an extremum, as the bounds allow."""
        parameter = self.fitter.model.parameters[self.fitter.depth]
        shifted = [start.thickness + way * x for x in np.diff(self.extrema[::2])[:1] for way in (1, -1)]
        mirrored = [2 * level - start.thickness for level in self.extrema]
        for some, most in (shifted, 2), (mirrored, 1):
            inside = [x for x in some if parameter.lower <= x.min() and x.max() <= parameter.upper]
            yield from (start._replace(thickness=x) for x in inside[:most])


def going_on(start: Start, lower: float, upper: float) -> tuple[int, Start] | None:
    """A course that goes on at its rate from a position on, where a path turns back or comes to rest; None
    for a path that does neither. Where the fringes of an absorbing film have died out, no light tells."""
    time, thickness, kinks = start
    way = thickness - thickness[0]
    way *= np.sign(way[np.argmax(np.abs(way))])
    before, last, top = (int(np.argmax(way >= share * way.max())) for share in (*_REACHED, 1.0))
    if not before < last < top < _EARLY * len(way):
        return None
    rate = (thickness[last] - thickness[before]) / (time[last] - time[before])
    on = thickness[last] + rate * (time - time[last])
    return last, Start(time, np.where(time < time[last], thickness, np.clip(on, lower, upper)), kinks)


def _runs(true: np.ndarray) -> list[np.ndarray]:
    """Positions of each stretch that is true."""
    positions = np.flatnonzero(true)
    return np.split(positions, np.flatnonzero(np.diff(positions) > 1) + 1) if positions.size else []
