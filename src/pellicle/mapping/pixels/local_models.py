"""Models of many pixels around their minima: signals, slopes, nuisances and deviances, compiled once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.fitting.film import nuisance
from pellicle.fitting.film.form import Local, SpectrumForm
from pellicle.fitting.film.nuisance import Data, offset_prior, scale_prior
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.reported_layer import linearised
from pellicle.programs.cache import in_chunks, kept
from pellicle.scene.film import Scene
from pellicle.scene.instrument import Drift

LANES, FEW = 256, 16
"""Pixels that one call of a compiled program takes, and that of the last ones where they are few."""


class PixelArrays(NamedTuple):
    """Arrays that differ between pixels, each (pixels, ...), padded as the data of the view."""

    values: Any
    weight: Any
    independent_fraction: Any
    level: Any
    frame: Any

    def of(self, data: Data) -> Data:
        """The data of one pixel, where these are its arrays."""
        frame = data.frame if self.frame is None else self.frame
        return Data(self.values, self.weight, data.position, self.independent_fraction, self.level, frame)

    def some(self, which: np.ndarray) -> PixelArrays:
        """The arrays of some of the pixels, by their positions."""
        return PixelArrays(*(None if x is None else x[which] for x in self))


class PixelLocals(NamedTuple):
    """Models around one point of each pixel: see `fitting.film.form.Local`."""

    signal: Any
    slope: Any
    model: Any
    gain: Any
    offset: Any
    layer: Any
    deviance: Any


@kept
def local_models(form: SpectrumForm, scene: Scene, data: Data, pixels: PixelArrays, at: Any) -> PixelLocals:
    """The model of each pixel around `at` (pixels, parameters)."""

    def one(pixel: PixelArrays, values: Any) -> PixelLocals:
        own = pixel.of(data)
        linear = linearised(form, scene, own, values)
        solved = nuisance.solve(linear.signal, own, scene.instrument)
        curves = solved.model, solved.gain, solved.offset
        return PixelLocals(linear.signal, linear.slope, *curves, linear.layer, solved.deviance)

    return jax.vmap(one)(pixels, at)


class PixelDeviances(NamedTuple):
    """Deviances of candidates of each pixel, (pixels, candidates)."""

    value: Any


@kept
def deviances(form: SpectrumForm, scene: Scene, data: Data, pixels: PixelArrays, at: Any) -> PixelDeviances:
    """Deviance of each pixel at `at` (pixels, candidates, parameters), priors of parameters left out."""

    def one(pixel: PixelArrays, candidates: Any) -> Any:
        own = pixel.of(data)
        return jax.vmap(lambda values: form.explain((scene, own), values).deviance)(candidates)

    return PixelDeviances(jax.vmap(one)(pixels, at))


def padded(view: SpectrumView, arrays: PixelArrays) -> PixelArrays:
    """The arrays (pixels, points) with the padding of the view, which weighs nothing."""
    extra = len(view.data.values) - view.points
    values, weight = (np.pad(x, [(0, 0), (0, extra)]) for x in (arrays.values, arrays.weight))
    frame = arrays.frame
    if frame is not None:
        frame = np.concatenate([frame, np.repeat(frame[:, -1:], extra // view.channels, axis=1)], axis=1)
    return arrays._replace(values=values, weight=weight, frame=frame)


def in_lanes(program: Callable[..., Any], view: SpectrumView, arrays: PixelArrays, at: np.ndarray) -> Any:
    """Call a program for pixels, `LANES` at a time, and return NumPy arrays of all of them."""
    return in_chunks(lambda own: program(view.form, view.scene, view.data, *own), (arrays, at), LANES, FEW)


def locals_of(view: SpectrumView, arrays: PixelArrays, at: np.ndarray) -> tuple[Local, np.ndarray]:
    """The model of each pixel around `at` (pixels, parameters), without layer slopes, and its deviance."""
    models: PixelLocals = in_lanes(local_models, view, arrays, at)
    local = Local(
        models.signal, models.slope, models.model, models.gain, models.offset, models.layer, np.zeros(0)
    )
    return local, models.deviance


class Nuisances:
    """Scale and offset that drift: Chebyshev terms of each, and the standard deviations of their priors."""

    def __init__(self, view: SpectrumView, scene: Scene):
        position = np.asarray(view.data.position)[: view.points]
        self._points, self._each = view.points, list[tuple[np.ndarray, np.ndarray, bool]]()
        for number, prior, on_signal in (
            (scene.instrument.scale, scale_prior, True),
            (scene.instrument.offset, offset_prior, False),
        ):
            if isinstance(number, Drift):
                basis = np.polynomial.chebyshev.chebvander(position, number.degree)
                self._each.append((basis, prior(number)[1], on_signal))

    @property
    def count(self) -> int:
        """Numbers that are fitted to each pixel."""
        return sum(len(sd) for _, sd, _ in self._each)

    def columns(self, at: Local, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns (pixels, points, nuisances) in steps of their priors, and those steps."""
        points, flat, steps = self._points, [], []
        for basis, sd, on_signal in self._each:
            curve = (at.gain if on_signal else at.offset)[:, :points]
            numbers = curve @ np.linalg.pinv(basis).T
            own = sd * (np.abs(numbers[:, :1]) if on_signal else level[:, None])
            column = basis * own[:, None]
            flat.append(column * at.signal[:, :points, None] if on_signal else column)
            steps.append(own)
        if not flat:
            return np.zeros((len(level), points, 0)), np.zeros((len(level), 0))
        return np.concatenate(flat, axis=2), np.concatenate(steps, axis=1)
