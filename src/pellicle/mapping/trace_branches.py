"""Branches of a trace: thicknesses that explain the light of each window of time, and the best path."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.batch import polish
from pellicle.fitting.batch.data import batch_data
from pellicle.fitting.batch.effects import nodes
from pellicle.fitting.film.problem import shortest_wavelength
from pellicle.fitting.parameter import Parameter
from pellicle.mapping.pixels import PixelModel
from pellicle.mapping.trace_light import Light, windows_of
from pellicle.mapping.trace_path import KINK, Candidates, Course, TracePath, trace_path
from pellicle.scene.priors import Normal

_ROUNDS = 4
"""Rounds of the path, each with the gain that the one before gives."""
_LEVELS, _FEW_OTHERS = (0.15, 0.5, 0.85), 2
"""Values of the other parameters with which the path is tried, as shares of their range, if they are few."""
_KNOWN = 1 / 32
"""Standard error of a known thickness without one, in wavelengths in the film: it only selects the order."""
_TOLERANCE = 0.02, 0.005
"""Error of the model as a share of the range of the light, in the first round and in the last."""
_OUTSIDE = 25.0
"""Least χ² of a window without any thickness that explains it: a shutter, a saturated detector."""


class Start(NamedTuple):
    """Thickness at times (times,) from which a fit starts, True in `kinks` (times,) if the rate may change
    abruptly in the step before."""

    time: np.ndarray
    thickness: np.ndarray
    kinks: np.ndarray

    def along(self, time: np.ndarray) -> np.ndarray:
        """Thickness at any times, by straight lines."""
        return np.interp(time, self.time, self.thickness)

    def bent(self, time: np.ndarray) -> np.ndarray:
        """True at any times (times,) with a kink in the step of this start that leads to them."""
        step = np.searchsorted(self.time, time)
        return self.kinks[np.clip(step, 0, len(self.kinks) - 1)] & (step > 0) & (step < len(self.kinks))


class Branches(NamedTuple):
    """Candidates of the windows that a thickness explains, at the times `centre` of all windows, of which
    these are `inside`; what the film may do; the best path, the gain and offset (wavelengths, 2), the other
    parameters in the unit cube, and the price of path, misfit and windows outside."""

    candidates: Candidates
    centre: np.ndarray
    inside: np.ndarray
    course: Course
    path: TracePath
    gain: np.ndarray
    start: np.ndarray
    price: float

    def thickness(self, path: TracePath) -> np.ndarray:
        """Thickness of a path in its windows."""
        return self.candidates.thickness[np.arange(len(path.chosen)), path.chosen]

    def along(self, path: TracePath, time: np.ndarray) -> np.ndarray:
        """Thickness of a path at any times, by straight lines."""
        return np.interp(time, self.centre[self.inside], self.thickness(path))

    def start_of(self, path: TracePath, *, turns: bool = False) -> Start:
        """A path as the start of a fit, which may change its rate abruptly where the path pays for that, or
        wherever it `turns`, too: at an extremum a turn looks even from window to window."""
        centre, thickness = self.centre[self.inside], self.thickness(path)
        kinks = path.kinks.copy()
        error = self.candidates.stderr[np.arange(len(kinks)), path.chosen]
        for a in range(2, len(kinks) - 2) if turns else ():
            away = thickness[[a - 2, a + 2]] - thickness[a]
            nearest = np.abs(thickness[a - 1 : a + 2] - thickness[a]).max() <= np.abs(away).min()
            kinks[a] |= np.prod(away) > 0 and nearest and np.all(np.abs(away) > 2 * error[[a - 2, a + 2]])
        return Start(centre, thickness, kinks | np.roll(kinks, 1))

    def nearest(self, time: np.ndarray) -> np.ndarray:
        """The windows of any times."""
        return np.searchsorted(0.5 * (self.centre[1:] + self.centre[:-1]), time)

    def gain_of(
        self,
        path: TracePath,
        seen: np.ndarray,
        grid: np.ndarray,
        table: np.ndarray,
        known: tuple[float | None, float | None],
    ) -> np.ndarray:
        """Gain and offset (wavelengths, 2) of the light `seen` in the windows that are `inside`, by a
        path."""
        thickness = self.thickness(path)
        reflected = np.stack([np.interp(thickness, grid, column) for column in table.T], axis=1)
        return gain_of(seen, reflected, known)

    def without(self, path: TracePath, window: int) -> TracePath:
        """The best path that is elsewhere than `path` in a window."""
        delta = self.candidates.delta.copy()
        delta[window, self.candidates.same(path.chosen)[window]] = np.inf
        others = self.candidates._replace(delta=delta)
        return trace_path(self.centre[self.inside], others, self.course)


def branches_of(light: Light, model: PixelModel, depth: int, course: Course) -> Branches:
    """The path of the thickness through the branches, by windows of time."""
    parameter = model.parameters[depth]
    grid = nodes(parameter.lower, parameter.upper, shortest_wavelength(model.problem))
    ends, found = known_ends(model, depth), []
    for start in _starts(model.parameters, depth):
        units = np.tile(start, (len(grid), 1))
        units[:, depth] = (grid - parameter.lower) / (parameter.upper - parameter.lower)
        table = np.asarray(signals_at(model, units).signal)
        made = branches_in(light, grid, table, ends, course)
        found += [] if made is None else [made._replace(start=start)]
    if not found:
        raise UsageError("no thickness within its bounds follows the trace: widen them")
    return min(found, key=lambda made: made.price)


def branches_in(
    light: Light,
    grid: np.ndarray,
    table: np.ndarray,
    ends: list[tuple[int, Normal]],
    course: Course,
    first: np.ndarray | None = None,
) -> Branches | None:
    """The cheapest path through the branches of one light, in rounds, each with a better gain; None without.

    **Arguments:** `table` (thicknesses, wavelengths) is the light of a gain of 1 at the thicknesses `grid`;
    `ends` are known thicknesses; `first`, the gain and offset (wavelengths, 2) to start from.
    """
    windows, weight = windows_of(light)
    seen = np.stack([np.nanmean(light.values[w], axis=0) for w in windows])
    count = np.array([len(w) for w in windows])
    centre = np.array([light.time[w].mean() for w in windows])
    best, better = None, np.zeros((0, 2))
    starts = _first_gains(light, seen, grid, table, ends) if first is None else iter([first])
    for begun, number in product(starts, range(_ROUNDS)):
        gain = better if number else begun
        error = np.hypot(light.noise / np.sqrt(count)[:, None], _TOLERANCE[number > 0] * light.span)
        candidates, least = candidates_of(grid, table, seen, error, gain, weight)
        inside = explained(least)
        own = anchored(Candidates(*(x[inside] for x in candidates)), ends)
        path = trace_path(centre[inside], own, course)
        price = path.price + weight * float(np.sum(least[inside])) + KINK * float(np.sum(~inside))
        made = Branches(own, centre, inside, course, path, gain, np.zeros(0), price)
        if number and price < (np.inf if best is None else best.price):
            best = made
        better = made.gain_of(path, seen[inside], grid, table, light.known)
    return best


def explained(least: np.ndarray) -> np.ndarray:
    """True for windows whose `least` misfit (windows,) a thickness explains."""
    return least < _OUTSIDE + 9 * np.median(least)


def _starts(parameters: tuple[Parameter, ...], depth: int) -> Iterator[np.ndarray]:
    """Points of the unit cube to start from: some values of the others where these are few."""
    middle = np.array([(p.start - p.lower) / (p.upper - p.lower) for p in parameters])
    others = [i for i in range(len(parameters)) if i != depth]
    yield middle
    for levels in product(_LEVELS, repeat=len(others)) if len(others) <= _FEW_OTHERS else ():
        point = middle.copy()
        point[others] = levels
        if others and not np.allclose(point, middle):
            yield point


def signals_at(model: PixelModel, units: np.ndarray) -> polish.Best:
    """Signals (points, wavelengths) and their slopes at points (points, parameters) of the unit cube."""
    search, size = model.search, model.search.view.points
    ones = np.ones((len(units), size))
    data = batch_data({"values": ones, "sigma": ones}, model.problem.views[0].noise)
    return polish.in_rows(polish.at_best, search.static, search.common, data, units)


def _first_gains(
    light: Light, seen: np.ndarray, grid: np.ndarray, table: np.ndarray, ends: list[tuple[int, Normal]]
) -> Iterator[np.ndarray]:
    """Gains and offsets (wavelengths, 2) to start from: by the extrema, and by a known end of the trace."""
    scale, offset = light.known
    if scale is not None and offset is not None:
        yield np.tile([scale, offset], (table.shape[1], 1))
        return
    low, high = np.percentile(seen, [1, 99], axis=0)
    least, most = table.min(axis=0), table.max(axis=0)
    size = (high - low) / np.maximum(most - least, 1e-9) if scale is None else np.full(len(low), scale)
    if offset is not None and scale is None:
        size = (high + low - 2 * offset) / (most + least)
    level = 0.5 * (high + low - size * (most + least)) if offset is None else np.full(len(low), offset)
    yield np.stack([size, level], axis=1)
    if scale is None and offset is not None:
        for row, end in ends:
            there = np.array([np.interp(end.mean, grid, column) for column in table.T])
            yield np.stack([(seen[row] - offset) / np.maximum(there, 1e-9), level], axis=1)


def gain_of(seen: np.ndarray, reflected: np.ndarray, known: tuple[float | None, float | None]) -> np.ndarray:
    """Gain and offset (wavelengths, 2) by least squares, as far as they are free."""
    scale, offset = known
    rows = []
    for y, x in zip(seen.T, reflected.T, strict=True):
        if scale is not None:
            rows.append([scale, np.mean(y - scale * x) if offset is None else offset])
        elif offset is not None:
            rows.append([np.sum(x * (y - offset)) / np.sum(x**2), offset])
        else:
            slope = np.cov(x, y)[0, 1] / max(np.var(x, ddof=1), 1e-12)
            rows.append([slope, y.mean() - slope * x.mean()])
    return np.array(rows)


def candidates_of(
    grid: np.ndarray,
    table: np.ndarray,
    seen: np.ndarray,
    error: np.ndarray,
    gain: np.ndarray,
    weight: float,
) -> tuple[Candidates, np.ndarray]:
    """Local minima of the misfit of each window, and the least misfit of each (windows,)."""
    model = gain[:, 0] * table + gain[:, 1]
    misfit = sum(
        ((seen[:, None, j] - model[None, :, j]) / error[:, None, j]) ** 2 for j in range(table.shape[1])
    )
    padded = np.pad(np.asarray(misfit), [(0, 0), (1, 1)], constant_values=np.inf)
    before, here, after = padded[:, :-2], padded[:, 1:-1], padded[:, 2:]
    least = here.min(axis=1)
    bottom = (here <= before) & (here < after) & (here - least[:, None] < 60 / weight)
    row, at = np.nonzero(bottom)
    column = np.arange(len(row)) - np.searchsorted(row, np.arange(len(seen)))[row]
    thickness, delta, stderr = np.full((3, len(seen), int(column.max()) + 1), np.nan)
    step = grid[1] - grid[0]
    inner = (at > 0) & (at < len(grid) - 1)
    a, b, c = before[row, at], here[row, at], after[row, at]
    with np.errstate(invalid="ignore"):
        bend = np.where(inner, a - 2 * b + c, np.inf)
        shift = np.where(inner, np.clip(0.5 * (a - c) / np.maximum(bend, 1e-12), -0.5, 0.5), 0.0)
    thickness[row, column] = grid[at] + step * shift
    delta[row, column] = weight * (b - least[row])
    # half the width in which χ² is within 1 of the minimum; at an extremum it rises as the fourth power
    half = np.full(len(row), 24.0)
    wide = np.pad(here, [(0, 0), (24, 24)], constant_values=np.inf)
    for i in range(24, 0, -1):
        rise = np.minimum(wide[row, at + 24 + i], wide[row, at + 24 - i]) - b
        half = np.where(rise >= 1, i / np.sqrt(np.maximum(rise, 1.0)) if i == 1 else float(i), half)
    stderr[row, column] = step * half
    return Candidates(thickness, delta, stderr), least


def known_ends(model: PixelModel, depth: int) -> list[tuple[int, Normal]]:
    """Positions of the first and the last time, and the thickness there, as far as it is known."""
    width = float(shortest_wavelength(model.problem)) * _KNOWN
    ends = (0, model.parameters[depth].first), (-1, model.parameters[depth].last)
    return [(row, x if isinstance(x, Normal) else Normal(x, width)) for row, x in ends if x is not None]


def anchored(candidates: Candidates, ends: list[tuple[int, Normal]]) -> Candidates:
    """The candidates without those of the first and of the last window that contradict a known thickness."""
    delta = candidates.delta.copy()
    for row, end in ends:
        away, spread = np.abs(candidates.thickness[row] - end.mean), np.hypot(end.sd, candidates.stderr[row])
        near = (away < 4 * spread) | (away <= np.nanmin(away))
        delta[row] = np.where(near, delta[row] + (away / spread) ** 2, np.inf)
    return candidates._replace(delta=delta)
