"""Trace: one fit of a film against time from the light of one or a few wavelengths.

A path through the branches of the light gives each time a thickness near the right one. The state-space
smoother then joins all times, linearised around it, again after each pass. Gain and offset of each
wavelength, where they are free, are numbers that all times share, and first come from the extrema of the
trace.

**Source:** of `trace_path` and `state_space`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from logging import getLogger
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.cubes.traces import FEW
from pellicle.errors import UsageError
from pellicle.fitting.batch.data import CODES, NO_DATA, ORDERS, BatchFits
from pellicle.fitting.film.parameters import bounds
from pellicle.fitting.film.view import Local
from pellicle.fitting.result import Status
from pellicle.fitting.status import RIVAL
from pellicle.mapping.order_path import OrderPath
from pellicle.mapping.pixels import PixelModel
from pellicle.mapping.series_residuals import of_trace
from pellicle.mapping.series_result import ERRORS, SURE, Joined
from pellicle.mapping.state_space import Smoothed
from pellicle.mapping.trace_branches import Branches, Start, branches_of, signals_at
from pellicle.mapping.trace_fit import Fit, Fitter
from pellicle.mapping.trace_light import Light, averaged, light_of
from pellicle.mapping.trace_path import Course
from pellicle.mapping.trace_turns import Mirrors, going_on
from pellicle.scene.film import Scene
from pellicle.scene.free import MONOTONIC, SLOWLY
from pellicle.scene.instrument import Drift

if TYPE_CHECKING:
    from xarray import Dataset

log = getLogger(__name__)

_OTHERS, _FAR = 16, 40.0
"""Most other paths whose likelihood is computed, and the Δχ² of the path from which none is."""
_STRETCH, _LOST = 16, 0.1
"""Fewest times over which residuals are averaged, and their size, beyond noise and as a share of the range of
the light, at which a path has lost it: a laser that drifts by 3 % leaves less."""


class Trace(NamedTuple):
    """A trace as a cube, another one whose values are possible without a gain, its scene without gain and
    offset, and which of these are free, or their numbers."""

    cube: Cube
    example: Cube
    scene: Scene
    gain: float | None
    offset: float | None

    def joined(
        self, model: PixelModel, cube: Cube, dataset: Dataset, time: np.ndarray, kinds: tuple[str, ...]
    ) -> Joined:
        """Fit all times together; the χ² of each comes into the `dataset`."""
        depth = model.problem.thickness_axis
        if depth is None or kinds[depth] not in (SLOWLY, MONOTONIC):
            raise UsageError("a trace needs a free thickness that varies slowly, or is monotonic")
        light = light_of(self.cube, time, (self.gain, self.offset))
        fit = Fitter(model, kinds, depth)
        rough = averaged(light)
        found = branches_of(rough, model, depth, Course(np.inf if kinds[depth] == MONOTONIC else 0.0))
        start, rival, turns = _decided(fit, rough, found)
        nearest = found.nearest(time)
        used = np.flatnonzero(np.isfinite(light.values).any(axis=1) & found.inside[nearest])
        joined = fit(light.part(used), start, found)
        reduced = np.full(len(time), np.nan)
        reduced[used] = np.mean((joined.residual / light.noise) ** 2, axis=1)
        dataset["chi2_reduced"] = dataset["status"].dims, reduced
        status = np.full(len(time), CODES[NO_DATA], np.uint8)
        astray = lost(joined.residual, light)
        status[used] = CODES[str(Status.MISFIT if astray.any() else Status.AMBIGUOUS)]
        dataset["status"] = dataset["status"].copy(data=status)
        # no data hold a film whose fringes have died out in its branch
        held = (fit.step / fit.thickness_error(joined)) ** 2
        rival = np.minimum(rival[nearest][used], held)
        order = OrderPath(np.zeros(len(used), int), rival, np.zeros(len(used), bool))
        smoothed = _with_effects(light.part(used), fit, joined)
        beside = _gains(light, joined, cube.wavelength, smoothed)
        left = np.full(light.values.shape, np.nan)
        left[used] = np.where(np.isfinite(light.values[used]), joined.residual, np.nan)
        beside |= of_trace(cube, light.values, left)
        return Joined(order, smoothed, kinds, used, turns, beside)


def lost(residual: np.ndarray, light: Light) -> np.ndarray:
    """True at times (times,) around which the best path does not follow the light (times, wavelengths)."""
    size = max(_STRETCH, len(residual) // 40)
    square = np.array([np.convolve(x**2, np.full(size, 1 / size), "same") for x in residual.T]).T
    beyond = np.sqrt(np.maximum(square - light.noise**2, 0.0)) / light.span
    return np.any((square > 2 * light.noise**2) & (beyond > _LOST), axis=1)


def is_trace(cube: Cube) -> bool:
    """True for R or T at so few wavelengths that a time has no fit of its own."""
    return cube.points <= FEW and cube.signal in ("R", "T")


def trace_of(cube: Cube, scene: Scene) -> Trace:
    """Return the trace of a cube. Raises UsageError for values of an arbitrary unit with a known gain."""
    instrument = scene.instrument
    gain, offset = (None if isinstance(x, Drift) else float(x) for x in (instrument.scale, instrument.offset))
    if gain is not None and not cube.calibrated:
        raise UsageError(
            f'{cube.path}: its values have an arbitrary unit: free their gain by scale = "free" under'
            " [instrument]"
        )
    bare = eqx.tree_at(lambda s: (s.instrument.scale, s.instrument.offset), scene, (1.0, 0.0))
    arrays = {name: array for name, array in cube.arrays.items() if name == "values"}
    arrays["sigma"] = np.ones(cube.wavelength.size)
    own = replace(cube, arrays=arrays, calibrated=True)
    example = own
    if not cube.calibrated:  # volts may be many
        values = np.clip(cube.pixels((slice(None),))["values"], 0.0, 1.0)
        example = replace(own, arrays=arrays | {"values": values})
    return Trace(own, example, bare, gain, offset)


def undecided(model: PixelModel, cube: Cube, where: tuple[slice, ...]) -> BatchFits:
    """The fits of the times alone: none has an answer."""
    there = np.any(np.isfinite(cube.pixels(where)["values"]), axis=1).reshape(-1)
    count, size = len(there), len(model.parameters)
    status = np.where(there, CODES[str(Status.AMBIGUOUS)], CODES[NO_DATA]).astype(np.uint8)
    numbers = np.full((3, count, size), np.nan)
    minima, delta = np.full((count, ORDERS, size), np.nan), np.full((count, ORDERS), np.inf)
    chi2, rms = np.full((2, count), np.nan)
    return BatchFits(numbers[0], numbers[1], numbers[2], status, minima, delta, chi2, rms)


def _decided(fit: Fitter, light: Light, found: Branches) -> tuple[Start, np.ndarray, list[float]]:
    """The best path by the likelihood of all data, the Δχ² of others in each window (windows,), and times
    from which one that turns abruptly, or that does not, is as probable."""
    nearest, used = found.nearest(light.time), np.isfinite(light.values).all(axis=1)
    used = np.flatnonzero(used & found.inside[nearest])
    own = light.part(used)
    centre, size = found.centre[found.inside], len(found.candidates.thickness)
    path, left, rival = found.path, found.path.rival.copy(), np.full(size, np.inf)
    best = fit(own, found.start_of(path), found)
    for _ in range(_OTHERS):
        window = int(np.argmin(left))
        if left[window] >= _FAR:
            break
        other = found.without(path, window)
        left[window] = np.inf
        left[~found.candidates.same(path.chosen)[np.arange(size), other.chosen]] = np.inf
        if not np.isfinite(other.price):
            continue
        made = fit(own, found.start_of(other, turns=True), found, best)
        apart = fit.apart(made, best)
        if not apart.any():
            continue  # it leads to the same thicknesses
        above = made.deviance - best.deviance
        log.info("another path, Δχ² %.3g", above)
        if above < 0:  # others are those of the better path
            best, path, left, rival = made, other, other.rival.copy(), np.full(size, np.inf)
        differ = np.interp(centre, own.time, apart) > 0
        rival[differ] = np.minimum(rival[differ], abs(above))
        if rival.max() < RIVAL:
            break
    turns = dict[float, float]()
    if own.values.shape[1] == 1:
        if found.course.turn < np.inf:
            best, rival, turns = _turned(fit, own, found, best, rival)
        # the windows list the path that pays least, and its likelihood may be far from that of other orders
        starts = Mirrors.of(fit, best).moved(fit.course(own.time, best))
        moved = (fit(own, start, found, best) for start in starts)
        best, rival = _weighed(fit, found, own.time, moved, best, rival)
    plausible = [time for time, less in turns.items() if less <= SURE]
    every = np.full(len(found.centre), np.inf)
    every[found.inside] = np.minimum(rival, left)
    return fit.course(own.time, best), every, plausible


def _turned(
    fit: Fitter, own: Light, found: Branches, best: Fit, rival: np.ndarray
) -> tuple[Fit, np.ndarray, dict[float, float]]:
    """The best fit with turns at extrema, the Δχ² of others in each window (windows,), and how much worse
    those are that turn, or do not, at these times."""
    centre, mirrors, turns, after = found.centre[found.inside], Mirrors.of(fit, best), dict[float, float](), 0
    while (event := mirrors.next(own.time, best, after)) is not None:
        after = event.at
        made = min((fit(own, start, found, best) for start in event.starts), key=event.price)
        apart = fit.apart(made, best)
        if not apart.any():
            continue
        above, differ = event.price(made) - event.price(best), np.interp(centre, own.time, apart) > 0
        log.info("mirrored at %.4g, Δχ² %.3g", own.time[after], above)
        if above < 0:  # those before were of the path that is worse
            best, rival = made, rival - above
            turns = {time: less - above for time, less in turns.items()}
        turns[float(own.time[after])] = abs(above)
        rival[differ] = np.minimum(rival[differ], abs(above))
    parameter, course = fit.model.parameters[fit.depth], fit.course(own.time, best)
    beyond = going_on(course, parameter.lower, parameter.upper)
    others = [] if beyond is None else [fit(own, beyond[1], found, best)]
    return *_weighed(fit, found, own.time, others, best, rival), turns


def _weighed(
    fit: Fitter, found: Branches, time: np.ndarray, others: Iterable[Fit], best: Fit, rival: np.ndarray
) -> tuple[Fit, np.ndarray]:
    """The best of several fits, and the Δχ² of others in each window (windows,)."""
    for made in others:
        apart = np.interp(found.centre[found.inside], time, fit.apart(made, best)) > 0
        above = made.deviance - best.deviance
        best = made if above < 0 else best
        rival = np.where(apart, np.minimum(rival, abs(above)), rival)
        if rival.max() < RIVAL:
            break
    return best, rival


def _gains(light: Light, fit: Fit, wavelength: np.ndarray, smoothed: Smoothed) -> dict[str, tuple[Any, ...]]:
    """The free gains and offsets, the last parameters, with both errors, as variables of a dataset."""
    found: dict[str, tuple[Any, ...]] = {}
    own = smoothed.mean.shape[1] - len(light.shared)
    values = light.gains(smoothed.mean[0, own:], fit.scales, fit.scales)
    variances = smoothed.variance[0, own:] + smoothed.systematic[0, own:], smoothed.variance[0, own:]
    for k, i in enumerate(light.free):
        word = ("gain", "offset")[i]
        for band, nm in enumerate(wavelength):
            errors = [fit.scales[band, i] * np.sqrt(x[k * len(wavelength) + band]) for x in variances]
            numbers = zip(ERRORS, (values[band, i], *errors), strict=True)
            about = {"long_name": f"{word} at {nm:g} nm", "units": "1"}
            found |= {f"{word}_{nm:g}_nm{end}": ((), number, about) for end, number in numbers}
    return found


def _with_effects(light: Light, fitter: Fitter, fit: Fit) -> Smoothed:
    """The smoothed parameters with their systematic errors: each effect changes the light at all times."""
    model, own, bands = fitter.model, len(fitter.kinds), light.values.shape[1]
    lower, upper = bounds(model.parameters)
    mean = np.clip(fit.smoothed.mean[:, :own], 0.0, 1.0)
    signal, none = np.asarray(signals_at(model, mean).signal), np.zeros(0)
    at = Local(signal, none, signal, np.ones_like(signal), np.zeros_like(signal), none, none)
    effects = model.errors.effects.changes(model.search.view, at, lower + mean * (upper - lower))
    changes = np.stack([np.asarray(effect.change).reshape(-1, bands) for effect in effects], axis=2)
    return fit.again(light.time, np.einsum("tbi,tb,tbe->tie", fit.slope, fit.weight, changes))
