"""Systematic effects of many pixels: changes of their data by what a scene takes for granted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.fitting.discrepancy import Effect
from pellicle.fitting.spectra.extended_scene import Program, simulated_side_by_side
from pellicle.fitting.spectra.systematic_effects import (
    SimulatedEffect,
    change_of_data,
    effects_on_signal,
    simulations_of,
)
from pellicle.fitting.spectra.view import Local, SpectrumView
from pellicle.scene.film import Scene

_NODES = 48
_LANES = 64
"""Pixels that one call of the compiled program takes: a few tens of signals each."""


def nodes(lower: float, upper: float, shortest: float) -> np.ndarray:
    """Thicknesses (nm) between which effects are interpolated, for a `shortest` wavelength in the layer.

    At `_NODES` in a fringe of half that wavelength, an interpolated sine is off by (2π/48)²/8, 0.2 %.
    """
    return np.linspace(lower, upper, max(int(np.ceil((upper - lower) * 2 * _NODES / shortest)) + 1, 2))


class PixelEffects:
    """The effects to which a scene gives an uncertainty, for spectra of one view.

    Which effects there are, and their sizes but for a spread of the thickness, are those at `example`, values
    of the parameters (parameters,). Where a thickness is the only parameter, they are interpolated between
    `nodes` (nodes,) of it, each of which is simulated when a pixel first needs it.
    """

    def __init__(
        self, view: SpectrumView, example: np.ndarray, scene: Scene, nodes: np.ndarray | None = None
    ):
        self._view, self._scene, self._nodes = view, scene, nodes
        self._simulations, self._start, self._rows = list[_Simulation](), np.zeros(0), list[SimulatedEffect]()
        simulations = simulations_of(view, example, scene)
        if simulations is None:
            return
        extended, self._rows = simulations
        self._start = extended.start
        programs = extended.programs()
        by = [r.number.position if r.number.position in programs else None for r in self._rows]
        for position, program in programs.items():
            own = [i for i, at in enumerate(by) if at == position]
            if own:
                self._simulations.append(_simulation(program, self._rows, own))
        if nodes is not None:
            self._table = np.zeros((len(nodes), len(self._rows), view.points))
            self._simulated_at = np.zeros(len(nodes), bool)

    def changes(self, view: SpectrumView, at: Local, values: np.ndarray) -> list[Effect]:
        """Every effect with its change of the data (pixels, rows, measured channels), at `values` (pixels,
        parameters) of the parameters, where `at` are the models of the pixels.

        `view` is that of the pixels: its frame may have an axis of pixels.
        """
        found = self._simulated(view, at, values) if self._simulations else []
        return [*found, *effects_on_signal(view, at, self._scene)]

    def _simulated(self, view: SpectrumView, at: Local, values: np.ndarray) -> list[Effect]:
        if self._nodes is not None and view.data.frame is None:
            changes = self._interpolated(self._nodes, values[:, 0])
        else:
            changes = self._of_signal(values, view.data.frame)
        pairs = zip(self._rows, np.moveaxis(changes, 1, 0), strict=True)
        return [row.effect(change_of_data(view, at, change)) for row, change in pairs]

    def _interpolated(self, nodes: np.ndarray, thickness: np.ndarray) -> np.ndarray:
        """Changes of the signal (pixels, effects, points) from those at the nodes of the table, linearly."""
        at = np.clip(np.searchsorted(nodes, thickness) - 1, 0, len(nodes) - 2)
        used = np.unique([at, at + 1])
        missing = used[~self._simulated_at[used]]
        if len(missing):
            self._table[missing] = self._of_signal(nodes[missing, None], None)
            self._simulated_at[missing] = True
        share = ((thickness - nodes[at]) / (nodes[at + 1] - nodes[at]))[:, None, None]
        changes = self._table[at]
        changes += share * (self._table[at + 1] - changes)
        return changes

    def _of_signal(self, values: np.ndarray, frames: Any) -> np.ndarray:
        """Changes of the signal (pixels, effects, points) at `values` (pixels, parameters)."""
        numbers = np.tile(self._start, (len(values), 1))
        numbers[:, : values.shape[1]] = values
        frame = None if frames is None else np.asarray(frames)
        if frame is not None:  # with the padding of the scene
            extra = len(self._view.scene.light.wavelength) - frame.shape[1]
            frame = np.concatenate([frame, np.repeat(frame[:, -1:], extra, axis=1)], axis=1)
        changes = np.empty((len(values), len(self._rows), self._view.points))
        for (form, scene, order), rows, terms, weights in self._simulations:
            candidates = np.repeat(numbers[:, None], len(terms), axis=1)
            for i, (row, relative) in enumerate(terms):
                candidates[:, i, row.number.position] += relative * row.sizes(numbers)
            candidates = candidates[:, :, order]
            for first in range(0, len(values), _LANES):
                of = slice(first, first + _LANES)
                lanes = None if frame is None else _lanes(frame[of]), _lanes(candidates[of])
                found = simulated_side_by_side(form, scene, self._view.data, *lanes).signal
                signal = np.asarray(jax.device_get(found))[: len(values) - first, :, : self._view.points]
                changes[of, rows] = weights @ signal
        return changes


class _Simulation(NamedTuple):
    """A program that simulates some of the effects, those at positions `rows`.

    Each is `weights` (effects, terms) times the signals at the `terms`: an effect whose number changes, and
    by how much in units of its size. The unchanged signal is shared.
    """

    program: Program
    rows: list[int]
    terms: list[tuple[SimulatedEffect, float]]
    weights: np.ndarray


def _simulation(program: Program, every: Sequence[SimulatedEffect], rows: list[int]) -> _Simulation:
    keyed = {
        (every[i].number.position if change else -1, change / every[i].size): every[i]
        for i in rows
        for change, _ in every[i].changes
    }
    weights, keys = np.zeros((len(rows), len(keyed))), list(keyed)
    for i, own in zip(rows, weights, strict=True):
        for change, weight in every[i].changes:
            own[keys.index((every[i].number.position if change else -1, change / every[i].size))] += weight
    terms = [(row, relative) for (_, relative), row in keyed.items()]
    return _Simulation(program, rows, terms, weights)


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
