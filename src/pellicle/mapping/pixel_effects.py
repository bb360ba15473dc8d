"""Systematic effects of many pixels: changes of their data by what a scene takes for granted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax
import numpy as np

from pellicle.fitting.discrepancy import Effect
from pellicle.fitting.spectra.extended_scene import simulated_side_by_side
from pellicle.fitting.spectra.systematic_effects import (
    SimulatedEffect,
    change_of_data,
    effects_on_signal,
    simulations_of,
)
from pellicle.fitting.spectra.view import Local, SpectrumView
from pellicle.scene.film import Scene

_LANES = 64
"""Pixels that one call of the compiled program takes: a few tens of signals each."""


class PixelEffects:
    """The effects to which a scene gives an uncertainty, for spectra of one view.

    Which effects there are, and their sizes but for a spread of the thickness, are those at `example`, values
    of the parameters (parameters,).
    """

    def __init__(self, view: SpectrumView, example: np.ndarray, scene: Scene):
        self._view, self._scene = view, scene
        self._program, self._start, self._rows = None, np.zeros(0), list[SimulatedEffect]()
        simulations = simulations_of(view, example, scene)
        if simulations is None:
            return
        extended, self._rows = simulations
        self._program, self._start = extended.program(), extended.start
        # each by what it changes, in units of its size; the unchanged signal is shared
        terms = [(row, change / row.size) for row in self._rows for change, _ in row.changes]
        self._terms = {(row.number.position if c else -1, c): row for row, c in terms}

    def changes(self, view: SpectrumView, at: Local, values: np.ndarray) -> list[Effect]:
        """Every effect with its change of the data (pixels, rows, measured channels), at `values` (pixels,
        parameters) of the parameters, where `at` are the models of the pixels.

        `view` is that of the pixels: its frame may have an axis of pixels.
        """
        found = [] if self._program is None else self._simulated(view, at, values)
        return [*found, *effects_on_signal(view, at, self._scene)]

    def _simulated(self, view: SpectrumView, at: Local, values: np.ndarray) -> list[Effect]:
        form, scene, order = self._program or (None, None, [])
        pixels, numbers = len(values), np.tile(self._start, (len(values), 1))
        numbers[:, : values.shape[1]] = values
        keys = list(self._terms)
        candidates = np.repeat(numbers[:, None], len(keys), axis=1)
        for i, (key, row) in enumerate(self._terms.items()):
            candidates[:, i, row.number.position] += key[1] * row.sizes(numbers)
        candidates = candidates[:, :, order]
        frame, pieces = None if view.data.frame is None else np.asarray(view.data.frame), []
        if frame is not None:  # with the padding of the scene
            extra = len(self._view.scene.light.wavelength) - frame.shape[1]
            frame = np.concatenate([frame, np.repeat(frame[:, -1:], extra, axis=1)], axis=1)
        for first in range(0, pixels, _LANES):
            of = slice(first, first + _LANES)
            own = None if frame is None else _lanes(frame[of]), _lanes(candidates[of])
            signal = simulated_side_by_side(form, scene, self._view.data, *own).signal
            pieces.append(np.asarray(jax.device_get(signal))[: pixels - first])
        signals = np.concatenate(pieces)[..., : view.points]
        result = []
        for row in self._rows:
            change = np.zeros((pixels, signals.shape[2]))
            for own, weight in row.changes:
                relative = own / row.size
                change += weight * signals[:, keys.index((row.number.position if relative else -1, relative))]
            result.append(row.effect(change_of_data(view, at, change)))
        return result


def _lanes(x: np.ndarray) -> np.ndarray:
    """As many rows as the program takes."""
    return np.concatenate([x, np.repeat(x[-1:], _LANES - len(x), axis=0)])


def of_pixels(view: SpectrumView, frame: np.ndarray | None) -> SpectrumView:
    """The view without padding, and with the frames of pixels (pixels, wavelengths, channels, channels)."""
    position = np.asarray(view.data.position)[: view.points]
    return replace(view, data=view.data._replace(position=position, frame=frame))


def columns(changes: Sequence[np.ndarray], pixels: int, points: int) -> np.ndarray:
    """Changes of the data, each (pixels, rows, channels), as columns (pixels, points, effects)."""
    if not changes:
        return np.zeros((pixels, points, 0))
    return np.stack([change.reshape(pixels, points) for change in changes], axis=-1)
