"""Trace: one fit of a film against time from the light of one or a few wavelengths.

A path through the branches of the light gives each time a thickness near the right one. The state-space
smoother then joins all times, linearised around it, again after each pass. Gain and offset of each
wavelength, where they are free, are numbers that all times share, and first come from the extrema of the
trace.

**Source:** of `trace_path` and `state_space`.
"""

from __future__ import annotations

from dataclasses import replace
from logging import getLogger
from typing import TYPE_CHECKING, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.data.cube import Cube
from pellicle.errors import UsageError
from pellicle.fitting.batch.data import CODES, NO_DATA, ORDERS, BatchFits
from pellicle.fitting.film.parameters import bounds
from pellicle.fitting.film.problem import shortest_wavelength
from pellicle.fitting.film.view import Local
from pellicle.fitting.noise import correlation_length
from pellicle.fitting.result import Status
from pellicle.fitting.status import RIVAL
from pellicle.mapping.order_path import OrderPath
from pellicle.mapping.pixels import PixelModel
from pellicle.mapping.series_result import Joined
from pellicle.mapping.state_space import Quadratics, Smoothed, smooth
from pellicle.mapping.trace_branches import Branches, branches_of, known_ends, signals_at
from pellicle.mapping.trace_light import Light, averaged, light_of
from pellicle.mapping.trace_path import Course, TracePath
from pellicle.scene.film import Scene
from pellicle.scene.free import MONOTONIC, SHARED, SLOWLY
from pellicle.scene.instrument import Drift

if TYPE_CHECKING:
    from xarray import Dataset

log = getLogger(__name__)

FEW = 4
"""Most wavelengths of a trace; more are spectra, and each of them has a fit of its own first."""
_PASSES, _NEARLY, _SETTLED = 20, 1.0, 0.05
"""Most passes of the smoother, and the changes of all values, in standard errors, below which the stiffness
is sought again, and which end them."""
_APART = 3.0
"""Distance in standard errors below which the thicknesses of two fits are the same."""
_OTHERS, _FAR = 16, 40.0
"""Most other paths whose likelihood is computed, and the Δχ² of the path from which none is."""
_STRETCH, _LOST = 16, 0.1
"""Fewest times over which residuals are averaged, and their size, beyond noise and as a share of the range of
the light, at which a path has lost it: a laser that drifts by 3 % leaves less."""
_STEP = 0.125
"""Largest change of a thickness in a pass, in wavelengths in the film."""


class Trace(NamedTuple):
    """A trace as a cube, its scene without gain and offset, and which of these are free, or their numbers."""

    cube: Cube
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
        fit = _Fitter(model, kinds, depth)
        rough = averaged(light)
        found = branches_of(rough, model, depth, Course(np.inf if kinds[depth] == MONOTONIC else 0.0))
        path, rival = _decided(fit, rough, found)
        nearest = found.nearest(time)
        used = np.flatnonzero(np.isfinite(light.values).any(axis=1) & found.inside[nearest])
        joined = fit(light.part(used), found.along(path, time[used]), found)
        reduced = np.full(len(time), np.nan)
        reduced[used] = np.mean((joined.residual / light.noise) ** 2, axis=1)
        dataset["chi2_reduced"] = dataset["status"].dims, reduced
        status = np.full(len(time), CODES[NO_DATA], np.uint8)
        astray = lost(joined.residual, light)
        status[used] = CODES[str(Status.MISFIT if astray.any() else Status.AMBIGUOUS)]
        dataset["status"] = dataset["status"].copy(data=status)
        order = OrderPath(np.zeros(len(used), int), rival[nearest][used], np.zeros(len(used), bool))
        return Joined(order, _with_effects(light.part(used), fit, joined), kinds, used)


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
    return Trace(replace(cube, arrays=arrays, calibrated=True), bare, gain, offset)


def undecided(model: PixelModel, cube: Cube, where: tuple[slice, ...]) -> BatchFits:
    """The fits of the times alone: none has an answer."""
    there = np.any(np.isfinite(cube.pixels(where)["values"]), axis=1).reshape(-1)
    count, size = len(there), len(model.parameters)
    status = np.where(there, CODES[str(Status.AMBIGUOUS)], CODES[NO_DATA]).astype(np.uint8)
    numbers = np.full((3, count, size), np.nan)
    minima, delta = np.full((count, ORDERS, size), np.nan), np.full((count, ORDERS), np.inf)
    chi2, rms = np.full((2, count), np.nan)
    return BatchFits(numbers[0], numbers[1], numbers[2], status, minima, delta, chi2, rms)


def _decided(fit: _Fitter, light: Light, found: Branches) -> tuple[TracePath, np.ndarray]:
    """The best path by the likelihood of all data, and the Δχ² of others in each window (windows,)."""
    nearest, used = found.nearest(light.time), np.isfinite(light.values).all(axis=1)
    used = np.flatnonzero(used & found.inside[nearest])
    own = light.part(used)

    def fitted(path: TracePath, like: _Fit | None) -> _Fit:
        return fit(own, found.along(path, own.time), found, like)

    path, rival = found.path, np.full(len(found.candidates.thickness), np.inf)
    left, best = path.rival.copy(), fitted(path, None)
    for _ in range(_OTHERS):
        window = int(np.argmin(left))
        if left[window] >= _FAR:
            break
        other = found.without(path, window)
        differ = ~found.candidates.same(path.chosen)[np.arange(len(rival)), other.chosen]
        differ[window] = True
        left[differ] = np.inf
        if not np.isfinite(other.price):
            continue
        made = fitted(other, best)
        apart = (made.smoothed.mean - best.smoothed.mean)[:, fit.depth] ** 2
        if np.all(apart < _APART**2 * best.smoothed.variance[:, fit.depth]):
            continue  # it leads to the same thicknesses
        above = made.deviance - best.deviance
        log.info("another path, Δχ² %.3g", above)
        if above < 0:
            path, best, rival, above = other, made, rival - above, -above
        rival[differ] = np.minimum(rival[differ], above)
        if rival.max() < RIVAL:
            break
    every = np.full(len(found.centre), np.inf)
    every[found.inside] = np.minimum(rival, left)
    return path, every


class _Fit(NamedTuple):
    """The smoothed parameters of the times, gains and offsets among them after the scene's; the misfits
    around them, the slopes of the light (times, wavelengths, parameters) with their weights (times,
    wavelengths), the residuals (times, wavelengths), and −2 ln of the likelihood."""

    smoothed: Smoothed
    quadratics: Quadratics
    slope: np.ndarray
    weight: np.ndarray
    residual: np.ndarray
    kinds: tuple[str, ...]
    fastest: float
    deviance: float


class _Fitter(NamedTuple):
    """Fits of a trace around paths: the model, kinds of change, and which parameter is the thickness."""

    model: PixelModel
    kinds: tuple[str, ...]
    depth: int

    def __call__(
        self, light: Light, thickness: np.ndarray, found: Branches, rival: _Fit | None = None
    ) -> _Fit:
        """Smooth, linearise again, and so on until nothing moves; with the weights of the residuals of a
        `rival`, or those of their own size and correlation."""
        depth, own, bands = self.depth, len(self.kinds), light.values.shape[1]
        lower, upper = bounds(self.model.parameters)
        free = light.free
        every = (
            *(SLOWLY if kind == MONOTONIC else kind for kind in self.kinds),
            *[SHARED] * (bands * len(free)),
        )
        # a gain is twice the first one at 1, an offset goes over eight times the largest value
        scales = np.stack([2 * found.gain[:, 0], 8 * np.nanmax(np.abs(light.values), axis=0)], axis=1)
        gain, rest = found.gain.copy(), np.tile(found.start, (len(light.time), 1))
        rest[:, depth] = (thickness - lower[depth]) / (upper - lower)[depth]
        step = _STEP * shortest_wavelength(self.model.problem) / (upper - lower)[depth]
        moves = np.diff(rest[:, depth]) / (np.diff(light.time) / np.median(np.diff(light.time)))
        fastest = 10 * float(np.max(np.abs(moves))) + 1e-6
        like, breaks = None if rival is None else rival.smoothed, np.zeros(len(light.time), bool)
        fit, moved, settled = None, np.inf, False
        for number in range(_PASSES):
            slope, residual, point = self._linear(light, rest, gain, scales)
            known = np.isfinite(light.values)
            weights = _weights(residual, known, light, number > 1) if rival is None else rival.weight
            quadratics = self._quadratics(slope, weights, residual, point)
            again = moved < _NEARLY and not settled  # the stiffness of the right path
            like = smooth(light.time, quadratics, every, breaks, fastest, None if again else like)
            smoothed, settled = like, settled or again
            change = smoothed.mean - point
            moved = float(np.max(np.abs(change) / np.sqrt(np.maximum(smoothed.variance, 1e-30))))
            log.info("pass %d of the smoother: values moved by up to %.2g standard errors", number + 1, moved)
            constant = np.sum(weights * (residual + np.einsum("tbi,ti->tb", slope, point)) ** 2)
            deviance = smoothed.deviance + float(constant)
            fit = _Fit(smoothed, quadratics, slope, weights, residual, every, fastest, deviance)
            short = min(1.0, step / max(float(np.max(np.abs(change[:, depth]))), 1e-12))
            point = point + short * change
            rest = point[:, :own]
            for k, i in enumerate(free):
                gain[:, i] = scales[:, i] * (point[0, own + k * bands :][:bands] - (0.5 if i else 0.0))
            if settled and moved < _SETTLED:
                break
        assert fit is not None
        return fit

    def _linear(
        self, light: Light, rest: np.ndarray, gain: np.ndarray, scales: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Slopes (times, wavelengths, parameters) of the light, residuals (times, wavelengths), 0 where it
        is absent, and the point (times, parameters) of the scene's parameters `rest` and of the gains and
        offsets `gain` (wavelengths, 2), in their `scales`."""
        lower, upper = bounds(self.model.parameters)
        own, bands = len(self.kinds), light.values.shape[1]
        there = signals_at(self.model, np.clip(rest, 0.0, 1.0))
        signal, columns = np.asarray(there.signal), [rest]
        slope = np.zeros((*light.values.shape, own + bands * len(light.free)))
        slope[..., :own] = gain[:, 0, None] * np.asarray(there.slope) * (upper - lower)
        for k, i in enumerate(light.free):
            at = own + k * bands + np.arange(bands)
            slope[:, np.arange(bands), at] = scales[:, i] * (signal if i == 0 else 1.0)
            columns.append(np.tile(gain[:, i] / scales[:, i] + (0.5 if i else 0.0), (len(rest), 1)))
        residual = light.values - gain[:, 0] * signal - gain[:, 1]
        return slope, np.where(np.isfinite(residual), residual, 0.0), np.concatenate(columns, axis=1)

    def _quadratics(
        self, slope: np.ndarray, weight: np.ndarray, residual: np.ndarray, point: np.ndarray
    ) -> Quadratics:
        """Misfits of the times around points (times, parameters), with what is known of both ends."""
        information = np.einsum("tbi,tb,tbj->tij", slope, weight, slope)
        pull = np.einsum("tbi,tb,tb->ti", slope, weight, residual)
        vector = np.einsum("tij,tj->ti", information, point) + pull
        lower, upper = bounds(self.model.parameters)
        low, width, depth = lower[self.depth], (upper - lower)[self.depth], self.depth
        for row, end in known_ends(self.model, depth):
            information[row, depth, depth] += (width / end.sd) ** 2
            vector[row, depth] += width * (end.mean - low) / end.sd**2
        return Quadratics(vector, information, np.zeros((*vector.shape, 0)))


def _weights(residual: np.ndarray, known: np.ndarray, light: Light, later: bool) -> np.ndarray:
    """Weights (times, wavelengths) by the noise of the differences of times, and `later` by the size of the
    residuals and the number of neighbours that count as one."""
    if not later:
        return known / light.noise**2
    square = np.sum(residual**2, axis=0) / np.maximum(known.sum(axis=0), 1)
    together = np.array([correlation_length(column) for column in residual.T])
    return known / np.maximum(square * together, 1e-14 * light.span**2)


def _with_effects(light: Light, fitter: _Fitter, fit: _Fit) -> Smoothed:
    """The smoothed parameters with their systematic errors: each effect changes the light at all times."""
    model, own, bands = fitter.model, len(fitter.kinds), light.values.shape[1]
    lower, upper = bounds(model.parameters)
    mean = np.clip(fit.smoothed.mean[:, :own], 0.0, 1.0)
    signal, none = np.asarray(signals_at(model, mean).signal), np.zeros(0)
    at = Local(signal, none, signal, np.ones_like(signal), np.zeros_like(signal), none, none)
    effects = model.errors.effects.changes(model.search.view, at, lower + mean * (upper - lower))
    changes = np.stack([np.asarray(effect.change).reshape(-1, bands) for effect in effects], axis=2)
    pushes = np.einsum("tbi,tb,tbe->tie", fit.slope, fit.weight, changes)
    quadratics, breaks = fit.quadratics._replace(pushes=pushes), np.zeros(len(light.time), bool)
    return smooth(light.time, quadratics, fit.kinds, breaks, fit.fastest, fit.smoothed)
