"""Fit of a trace around one path: the state-space smoother, linearised again around what it gives.

Gain and offset of each wavelength, where they are free, are parameters that all times share.
"""

from __future__ import annotations

from logging import getLogger
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.film.parameters import bounds
from pellicle.fitting.film.problem import shortest_wavelength
from pellicle.fitting.noise import correlation_length
from pellicle.mapping.pixels import PixelModel
from pellicle.mapping.state_space import Quadratics, Smoothed, smooth
from pellicle.mapping.trace_branches import Branches, Start, known_ends, signals_at
from pellicle.mapping.trace_light import MIDDLE, Light
from pellicle.scene.free import MONOTONIC, SLOWLY

log = getLogger(__name__)

_PASSES, _NEARLY, _SETTLED = 20, 1.0, 0.05
"""Most passes of the smoother, and the changes of all values, in standard errors, below which the stiffness
is sought again, and which end them."""
_APART = 3.0
"""Distance in standard errors below which the thicknesses of two fits are the same."""
_LEAST = 1e-6
"""Least of the fastest rates."""
_STEP = 0.125
"""Largest change of a thickness in a pass, in wavelengths in the film."""


class Fit(NamedTuple):
    """The smoothed parameters of the times, gains and offsets among them after the scene's; the misfits
    around them, the slopes of the light (times, wavelengths, parameters) with their weights (times,
    wavelengths), the residuals (times, wavelengths), kinds of change, and −2 ln of the likelihood.

    `about` are what the smoother takes beside the misfits: `fastest` rate and variances of `kinks` (times,).
    """

    smoothed: Smoothed
    quadratics: Quadratics
    slope: np.ndarray
    weight: np.ndarray
    residual: np.ndarray
    kinds: tuple[str, ...]
    about: dict[str, Any]
    scales: np.ndarray
    deviance: float

    @property
    def misfit(self) -> float:
        """Sum of the weighted squares of the residuals."""
        return float(np.sum(self.weight * self.residual**2))

    def again(self, time: np.ndarray, pushes: np.ndarray) -> Smoothed:
        """The smoothed parameters with systematic effects (times, parameters, effects)."""
        quadratics = self.quadratics._replace(pushes=pushes)
        return smooth(time, quadratics, self.kinds, like=self.smoothed, **self.about)


class Fitter(NamedTuple):
    """Fits of a trace around paths: the model, kinds of change, and which parameter is the thickness."""

    model: PixelModel
    kinds: tuple[str, ...]
    depth: int

    @property
    def step(self) -> float:
        """Largest change of the thickness in a pass (nm)."""
        return _STEP * float(shortest_wavelength(self.model.problem))

    def thickness(self, fit: Fit) -> np.ndarray:
        """Thickness (times,) of a fit (nm)."""
        parameter = self.model.parameters[self.depth]
        return parameter.lower + (parameter.upper - parameter.lower) * fit.smoothed.mean[:, self.depth]

    def course(self, time: np.ndarray, fit: Fit) -> Start:
        """A fit at the times (times,) as the start of others."""
        return Start(time, self.thickness(fit), fit.about["kinks"] > 0)

    def thickness_error(self, fit: Fit) -> np.ndarray:
        """Standard error (times,) of the thickness by the noise (nm)."""
        parameter = self.model.parameters[self.depth]
        return (parameter.upper - parameter.lower) * np.sqrt(fit.smoothed.variance[:, self.depth])

    def apart(self, fit: Fit, other: Fit) -> np.ndarray:
        """True at times (times,) at which the thickness of a fit is not that of the `other` one."""
        return np.abs(self.thickness(fit) - self.thickness(other)) > _APART * self.thickness_error(other)

    def __call__(self, light: Light, start: Start, found: Branches, rival: Fit | None = None) -> Fit:
        """Smooth, linearise again, and so on until nothing moves; with the weights of the residuals of a
        `rival`, or those of their own size and correlation."""
        depth, own, count = self.depth, len(self.kinds), len(light.time)
        lower, upper = bounds(self.model.parameters)
        kinds = *(SLOWLY if kind == MONOTONIC else kind for kind in self.kinds), *light.shared
        # a gain is twice the first one at 1, an offset goes over eight times the largest value
        scales = np.stack([2 * found.gain[:, 0], 8 * np.nanmax(np.abs(light.values), axis=0)], axis=1)
        gain, rest = found.gain.copy(), np.tile(found.start, (count, 1))
        rest[:, depth] = (start.along(light.time) - lower[depth]) / (upper - lower)[depth]
        about = _about(light.time, rest[:, depth], start, rival)
        step = self.step / (upper - lower)[depth]
        like, fit, moved, settled = None if rival is None else rival.smoothed, None, np.inf, False
        for number in range(_PASSES):
            slope, residual, point = self._linear(light, rest, gain, scales)
            weights = _weights(residual, light, number > 1) if rival is None else rival.weight.copy()
            quadratics = self._quadratics(slope, weights, residual, point)
            again = not settled and moved < _NEARLY  # the stiffness is that of the right path
            like = smooth(light.time, quadratics, kinds, like=None if again else like, **about)
            settled, change = settled or again, like.mean - point
            moved = np.max(np.abs(change) / np.sqrt(np.maximum(like.variance, 1e-30)))
            log.info("pass %d of the smoother: values moved by up to %.2g standard errors", number + 1, moved)
            constant = np.sum(weights * (residual + np.einsum("tbi,ti->tb", slope, point)) ** 2)
            deviance = like.deviance + float(constant)
            fit = Fit(like, quadratics, slope, weights, residual, kinds, about, scales, deviance)
            point += change * min(1.0, step / max(float(np.max(np.abs(change[:, depth]))), 1e-12))
            rest, gain = point[:, :own], light.gains(point[0, own:], gain, scales)
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
            columns.append(np.tile(gain[:, i] / scales[:, i] + MIDDLE[i], (len(rest), 1)))
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


def _about(time: np.ndarray, thickness: np.ndarray, start: Start, rival: Fit | None) -> dict[str, Any]:
    """Breaks, of which a trace has none, fastest rate and kinks, as the smoother takes them; the prior of
    rates is that of the `rival`, with which the fit is compared."""
    if rival is None:
        usual = float(np.max(np.abs(np.diff(thickness) / np.diff(time)))) * float(np.median(np.diff(time)))
    else:
        usual = 0.1 * (rival.about["fastest"] - _LEAST)
    bent = start.bent(time)
    run = np.cumsum(np.diff(bent, prepend=False) & bent)  # steps in which one change of the rate may be
    kinks = bent * usual**2 / np.maximum(np.bincount(run, bent)[run], 1)
    return {"breaks": np.zeros(len(time), bool), "fastest": 10 * usual + _LEAST, "kinks": kinks}


def _weights(residual: np.ndarray, light: Light, later: bool) -> np.ndarray:
    """Weights (times, wavelengths) by the noise of the differences of times, and `later` by the size of the
    residuals and the number of neighbours that count as one."""
    known = np.isfinite(light.values)
    if not later:
        return known / light.noise**2
    square = np.sum(residual**2, axis=0) / np.maximum(known.sum(axis=0), 1)
    together = np.array([correlation_length(column) for column in residual.T])
    return known / np.maximum(square * together, 1e-14 * light.span**2)
