"""Models of many spectra around their minima, compiled once: signals, slopes, deviances, profiles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.fitting.covariance import scaled
from pellicle.fitting.film import nuisance
from pellicle.fitting.film.indices import indices
from pellicle.fitting.film.nuisance import Data
from pellicle.fitting.film.search import thickness_grid
from pellicle.fitting.film.summary import like_substrate, thinnest
from pellicle.fitting.film.view import Local, SpectrumForm, SpectrumView
from pellicle.fitting.noise import student
from pellicle.fitting.normal_equations import solve, times
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import Neighbourhood, flat_sides
from pellicle.fitting.reported_layer import linearised, slope_errors
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.status import RIVAL
from pellicle.programs.cache import in_chunks, kept
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves

LANES, FEW = 256, 16
"""Spectra that one call of a compiled program takes, and that of the last ones where they are few."""
_REFITS = 4
"""Steps of Gauss and Newton of the other parameters where a profile holds one."""


class BatchArrays(NamedTuple):
    """Arrays that differ between spectra, each (spectra, ...), padded as the data of the view."""

    values: Any
    weight: Any
    independent_fraction: Any
    level: Any
    frame: Any

    def of(self, data: Data) -> Data:
        """The data of one spectrum, where these are its arrays."""
        return data._replace(**{k: x for k, x in self._asdict().items() if x is not None})

    def some(self, which: np.ndarray) -> BatchArrays:
        """The arrays of some of the spectra, by their positions."""
        return BatchArrays(*(None if x is None else x[which] for x in self))


class BatchLocals(NamedTuple):
    """Models around one point of each spectrum: see `fitting.film.form.Local`."""

    signal: Any
    slope: Any
    model: Any
    gain: Any
    offset: Any
    layer: Any
    layer_slope: Any
    deviance: Any


@kept
def local_models(form: SpectrumForm, scene: Scene, data: Data, spectra: BatchArrays, at: Any) -> BatchLocals:
    """The model of each spectrum around `at` (spectra, parameters)."""

    def one(spectrum: BatchArrays, values: Any) -> BatchLocals:
        own = spectrum.of(data)
        linear = linearised(form, scene, own, values)
        solved = nuisance.solve(linear.signal, own, scene.instrument)
        curves = solved.model, solved.gain, solved.offset
        return BatchLocals(
            linear.signal, linear.slope, *curves, linear.layer, linear.layer_slope, solved.deviance
        )

    return jax.vmap(one)(spectra, at)


class BatchDeviances(NamedTuple):
    """Deviances of candidates of each spectrum, (spectra, candidates)."""

    value: Any


@kept
def deviances(form: SpectrumForm, scene: Scene, data: Data, spectra: BatchArrays, at: Any) -> BatchDeviances:
    """Deviance of each spectrum at `at` (spectra, candidates, parameters), priors of parameters left out."""

    def one(spectrum: BatchArrays, candidates: Any) -> Any:
        own = spectrum.of(data)
        return jax.vmap(lambda values: form.explain((scene, own), values).deviance)(candidates)

    return BatchDeviances(jax.vmap(one)(spectra, at))


def thickness_nodes(problem: Problem) -> np.ndarray:
    """Thicknesses (nm) of a scan of the problem's thickness alone."""
    p = problem.parameters[problem.thickness_axis or 0]
    return p.lower + thickness_grid(problem, 1) * (p.upper - p.lower)


class LocalModels:
    """Models of spectra around their best minima, whose points count as the ranking has them.

    `problem` has the one view without axes, `whole` is that of the spectra at all points.
    """

    def __init__(self, problem: Problem, whole: SpectrumView, ranked: RankedMinima):
        self._problem, self._ranked, self._values = problem, ranked, ranked.values
        [self._view], [fit], [after] = problem.views, ranked.fits, ranked.problem.views
        self._box = jax.device_get(problem.box)
        data, extra = whole.data, len(self._view.data.values) - whole.points
        [before] = ranked.searched.views
        self._raised = np.max(after.data.weight, axis=1) / np.max(before.data.weight, axis=1)
        weight = data.weight * self._raised[:, None]
        values, weight = (np.pad(x, [(0, 0), (0, extra)]) for x in (data.values, weight))
        frame = data.frame
        if frame is not None:
            frame = np.concatenate([frame, np.repeat(frame[:, -1:], extra // whole.channels, axis=1)], axis=1)
        self._arrays = BatchArrays(values, weight, 1 / fit.variance, data.level, frame)

    def neighbourhood(self, covariance: np.ndarray) -> Neighbourhood:
        """The neighbourhoods of the minima; `covariance` has the problem's parameters first."""
        spectra, count = self._values.shape
        return Neighbourhood(
            self._values,
            np.asarray(self._box.lower),
            np.asarray(self._box.upper),
            covariance[:, :count, :count],
            np.reshape([p.natural for p in self._problem.parameters], (-1, 2)).astype(bool),
            self._deviance,
            self._refitted,
            np.zeros((spectra, 0, count)),
        )

    def flat_sides(self, depth: int, grid: np.ndarray, scan: np.ndarray, usable: np.ndarray) -> np.ndarray:
        """Sides (spectra, 2) of the best thickness, parameter `depth`, on which the misfit never rises or
        only to a plateau.

        That is by a `scan` (spectra, nodes) at the thicknesses `grid` (nodes,) with the weights of the
        search; where it says so of `usable` spectra, by the exact misfit at its nodes.
        """
        ranked, values = self._ranked, self._values
        [before], [after] = ranked.searched.views, ranked.problem.views
        wider = np.asarray(student(ranked.freedom, RIVAL))[:, None] ** 2
        factor = self._raised**2 * after.independent_fraction / before.independent_fraction
        rise = scan * factor[:, None] / wider
        sides = flat_sides(grid, rise - np.minimum(rise.min(axis=1), 0.0)[:, None], values[:, depth])
        doubtful = np.flatnonzero(sides.any(axis=1) & usable)
        if values.shape[1] == 1 and len(doubtful):
            points = np.concatenate([np.tile(grid, (len(doubtful), 1)), values[doubtful]], axis=1)
            exact = self._deviance(doubtful, points[..., None])
            rise = (exact - exact.min(axis=1)[:, None])[:, :-1] / wider[doubtful]
            sides[doubtful] = flat_sides(grid, rise, values[doubtful, 0])
        return sides

    def thinnest(self) -> np.ndarray:
        """Thickness (spectra,), or (1,) for all, of a layer below which a drift can imitate its fringes."""
        # a layer without numbers of its own has one index at all spectra
        some = np.arange(1 if self._values.shape[1] == 1 else len(self._values))
        locals_: BatchLocals = self._in_lanes(local_models, some, self._values[some])
        return thinnest(self._view, locals_.layer)

    def unneeded(self, covariance: np.ndarray) -> np.ndarray:
        """Spectra (spectra,) whose only layer has the index of the substrate within its error by the
        `covariance` (spectra, parameters, parameters) of the parameters: see `summary.FilmMeasurements`."""
        some, view = np.arange(len(self._values)), self._view
        if len(view.scene.layers) != 1 or not free_leaves(view.scene.layers[0].material):
            return np.zeros(len(some), bool)
        locals_: BatchLocals = self._in_lanes(local_models, some, self._values)
        below = indices(view.scene, self._values[0]).substrate[: view.rows]
        index, slope = locals_.layer[:, :2, : view.rows], locals_.layer_slope[:, :2, : view.rows]
        return like_substrate(index, slope_errors(slope, covariance), below)

    def _in_lanes(self, program: Callable[..., Any], which: np.ndarray, at: np.ndarray) -> Any:
        """Call a program for some spectra, `LANES` at a time, and return NumPy arrays of all of them."""
        view = self._view
        rows = self._arrays.some(which), at
        return in_chunks(lambda own: program(view.form, view.scene, view.data, *own), rows, LANES, FEW)

    def _prior(self, at: np.ndarray) -> np.ndarray:
        """-2 ln of the priors of parameters `at` (..., parameters), without a constant."""
        return np.sum(self._box.prior_rows(at) ** 2, axis=-1)

    def _deviance(self, which: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Deviance (which, candidates) at points (which, candidates, parameters)."""
        return self._in_lanes(deviances, which, at).value + self._prior(at)

    def _refitted(
        self, which: np.ndarray, axis: np.ndarray, held: np.ndarray, starts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Least deviance with one parameter held and the others refitted, and where it is."""
        at = starts[:, 0].copy()
        at[np.arange(len(at)), axis] = held
        if at.shape[1] == 1:
            return self._deviance(which, at[:, None])[:, 0], at
        arrays, lower, span = self._arrays.some(which), self._box.lower, self._box.upper - self._box.lower
        view = replace(self._view, data=arrays.of(self._view.data))
        problem = self._problem._replace(views=(view,))
        fixed = np.arange(at.shape[1]) == axis[:, None]
        best, best_at = np.full(len(at), np.inf), at.copy()
        for _ in range(_REFITS + 1):
            models: BatchLocals = self._in_lanes(local_models, which, at)
            deviance = models.deviance + self._prior(at)
            better = deviance < best
            best[better], best_at[better] = deviance[better], at[better]
            local = Local(*models[:7])
            jacobian = scaled(problem, (at - lower) / span, [local], [1 / arrays.independent_fraction])
            rows = jacobian.jacobian
            data = view.residuals(local) * np.sqrt(arrays.independent_fraction)[:, None, None]
            data = np.concatenate([data.reshape(len(at), -1), -np.asarray(jacobian.pull)], axis=1)
            transposed = np.swapaxes(rows, 1, 2)
            kept = np.concatenate([~fixed, np.ones((len(at), rows.shape[2] - at.shape[1]), bool)], axis=1)
            matrix = np.where(kept[:, :, None] & kept[:, None, :], transposed @ rows, np.eye(kept.shape[1]))
            step = solve(matrix, np.where(kept, times(transposed, data), 0.0))[:, : at.shape[1]] * span
            # half of the step after one that was too long
            step = np.where(better[:, None], step, 0.5 * (best_at - at) * ~fixed)
            at = np.clip(at + step, lower, self._box.upper)
        return best, best_at
