"""Systematic effects of many spectra: changes of their data by what a scene takes for granted."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.film.extended_scene import Program, simulated_side_by_side
from pellicle.fitting.film.systematic_effects import (
    SimulatedEffect,
    change_of_data,
    effects_on_signal,
    simulations_of,
)
from pellicle.fitting.film.view import Local, SpectrumView
from pellicle.fitting.linear_system import Effect
from pellicle.programs.cache import in_chunks
from pellicle.scene.film import Scene

_NODES = 96
"""Nodes in a fringe. With 48 the error of the interpolation tells an overlayer and an index from a thickness:
a standard error was 15 % too small (110 nm of oxide on silicon, Ψ and Δ)."""
LANES = 64
"""Spectra that one call of the compiled program takes: a few tens of signals each."""


def nodes(lower: float, upper: float, shortest: float) -> np.ndarray:
    """Thicknesses (nm) between which effects are interpolated, for a `shortest` wavelength in the layer.

    At `_NODES` in a fringe of half that wavelength, an interpolated sine is off by (2π/96)²/8, 0.05 %.
    """
    return np.linspace(lower, upper, max(int(np.ceil((upper - lower) * 2 * _NODES / shortest)) + 1, 2))


class BatchEffects:
    """The effects to which a scene gives an uncertainty, for spectra of one view.

    Which effects there are, and their sizes but for a spread of the thickness, are those at `example`, values
    of the parameters (parameters,). Where a thickness is the only parameter, they are interpolated between
    `nodes` (nodes,) of it, each of which is simulated when a spectrum first needs it. `lanes` are the most
    that one call of a program simulates.
    """

    def __init__(
        self,
        view: SpectrumView,
        example: np.ndarray,
        scene: Scene,
        nodes: np.ndarray | None = None,
        lanes: int = LANES,
    ):
        self._view, self._scene, self._nodes, self._lanes = view, scene, nodes, lanes
        self._simulations, self._start, self._rows = list[_Simulation](), np.zeros(0), list[SimulatedEffect]()
        simulations = simulations_of(view, example, scene)
        if simulations is None:
            return
        extended, self._rows = simulations
        self._start = extended.start(example)
        programs = extended.programs()
        by = [r.number.position if r.number.position in programs else None for r in self._rows]
        for position, program in programs.items():
            own = [at == position for at in by]
            simulation = _simulation(program, self._rows, own, unchanged=position is None)
            if simulation.terms:
                self._simulations.append(simulation)
        if nodes is not None:
            self._table = np.zeros((len(nodes), len(self._rows), view.points))
            self._simulated_at = np.zeros(len(nodes), bool)

    def changes(self, view: SpectrumView, at: Local, values: np.ndarray) -> list[Effect]:
        """Every effect with its change of the data (spectra, rows, measured channels), at `values` (spectra,
        parameters) of the parameters, where `at` are the models of the spectra.

        `view` is that of the spectra: its frame may have an axis of spectra.
        """
        simulated = self._simulated(view, at, values) if self._simulations else []
        return [*simulated, *effects_on_signal(view, at, self._scene)]

    def _simulated(self, view: SpectrumView, at: Local, values: np.ndarray) -> list[Effect]:
        if self._nodes is not None and view.data.frame is None:
            changes = self._interpolated(self._nodes, values[:, 0])
        else:
            changes = self._of_signal(values, view.data.frame)
        each = at._replace(signal=at.signal[:, None], gain=at.gain[:, None])
        of_data = np.moveaxis(change_of_data(view, each, changes), 1, 0)
        return [row.effect(change) for row, change in zip(self._rows, of_data, strict=True)]

    def _interpolated(self, nodes: np.ndarray, thickness: np.ndarray) -> np.ndarray:
        """Changes of the signal (spectra, effects, points) from those at the nodes of the table, linearly."""
        at = np.clip(np.searchsorted(nodes, thickness) - 1, 0, len(nodes) - 2)
        used = np.unique([at, at + 1])
        missing = used[~self._simulated_at[used]]
        if len(missing):
            self._table[missing] = self._of_signal(nodes[missing, None], None)
            self._simulated_at[missing] = True
        changes, rise = self._table[at], self._table[at + 1]
        rise -= changes
        rise *= ((thickness - nodes[at]) / (nodes[at + 1] - nodes[at]))[:, None, None]
        changes += rise
        return changes

    def _of_signal(self, values: np.ndarray, frames: Any) -> np.ndarray:
        """Changes of the signal (spectra, effects, points) at `values` (spectra, parameters)."""
        numbers = np.tile(self._start, (len(values), 1))
        numbers[:, : values.shape[1]] = values
        frame = None if frames is None else np.asarray(frames)
        if frame is not None:  # with the padding of the scene
            extra = len(self._view.scene.light.wavelength) - frame.shape[1]
            frame = np.concatenate([frame, np.repeat(frame[:, -1:], extra, axis=1)], axis=1)
        changes = np.zeros((len(values), len(self._rows), self._view.points))
        for (form, scene, order), terms, weights in self._simulations:
            candidates = np.repeat(numbers[:, None], len(terms), axis=1)
            for i, (row, relative) in enumerate(terms):
                candidates[:, i, row.number.position] += relative * row.sizes(numbers)
            candidates = candidates[:, :, order]

            def changed(rows: tuple[Any, np.ndarray], form=form, scene=scene, weights=weights) -> np.ndarray:
                signal = simulated_side_by_side(form, scene, self._view.data, *rows).signal
                return weights @ np.asarray(signal)[..., : self._view.points]

            changes += in_chunks(changed, (frame, candidates), self._lanes)
        return changes


class _Simulation(NamedTuple):
    """A program that simulates some of the effects.

    It adds `weights` (effects, terms) times the signals at the `terms` to the changes by the effects: a term
    is an effect whose number changes, and by how much in units of its size.
    """

    program: Program
    terms: list[tuple[SimulatedEffect, float]]
    weights: np.ndarray


def _simulation(
    program: Program, effects: Sequence[SimulatedEffect], own: Sequence[bool], *, unchanged: bool
) -> _Simulation:
    """The simulation of the program's `own` effects. The `unchanged` signal is that of one program for all
    effects: where a face has no thickness, the others simulate the same."""
    terms = [
        (i, change, weight)
        for i, effect in enumerate(effects)
        for change, weight in effect.changes
        if (own[i] if change else unchanged)
    ]
    # effects share the unchanged signal
    keys = [(i if change else -1, change / effects[i].size) for i, change, _ in terms]
    columns = list(dict.fromkeys(keys))
    weights = np.zeros((len(effects), len(columns)))
    for (i, _, weight), key in zip(terms, keys, strict=True):
        weights[i, columns.index(key)] += weight
    return _Simulation(program, [(effects[i], relative) for i, relative in columns], weights)
