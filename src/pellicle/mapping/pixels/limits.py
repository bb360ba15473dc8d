"""Standard errors of pixels by the noise: of a parabola or, where the misfit is none, of a profile."""

import jax
import numpy as np

from pellicle.fitting.film.search import thickness_grid
from pellicle.fitting.film.summary import FEWEST_FRINGES
from pellicle.fitting.film.targets import drifts
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.noise import NoiseEstimate, student
from pellicle.fitting.normal_equations import solve
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import Neighbourhood, by_curvature, flat_sides, limits
from pellicle.fitting.status import RIVAL
from pellicle.mapping.pixels.data import PixelData, PixelMinima
from pellicle.mapping.pixels.local_models import (
    Nuisances,
    PixelArrays,
    deviances,
    in_lanes,
    locals_of,
    padded,
)
from pellicle.scene.film import Scene


def evidence_factor(noise: NoiseEstimate, view: SpectrumView) -> np.ndarray:
    """Factors (pixels,) of a misfit with the given weights and the view's share of independent points, for
    the weights and the effective points of the ranking."""
    return noise.scale[:, 0] ** 2 * noise.fraction(view.noise) / view.independent_fraction


_REFITS = 4
"""Steps of Gauss and Newton of the other parameters where a profile holds one."""


class PixelLimits:
    """Standard errors by the noise, of the pixels of a problem with one spectrum."""

    def __init__(self, problem: Problem, scene: Scene, nuisances: Nuisances):
        [self._view], self._parameters = problem.views, problem.parameters
        self._scene, self._nuisances = scene, nuisances
        self._lower = np.array([p.lower for p in self._parameters])
        self._upper = np.array([p.upper for p in self._parameters])
        self._box = jax.device_get(problem.box)
        self._natural = np.reshape([p.natural for p in self._parameters], (-1, 2)).astype(bool)
        self._depth = problem.thickness_axis
        if self._depth is not None:
            p = self._parameters[self._depth]
            self._grid = p.lower + thickness_grid(problem, 1) * (p.upper - p.lower)

    def arrays(self, data: PixelData, which: np.ndarray, noise: NoiseEstimate) -> PixelArrays:
        """Arrays of the pixels `which` with the weights and the effective points of their `noise`."""
        weight = data.weight[which] * noise.scale[:, :1]
        frame = None if data.frame is None else data.frame[which]
        fraction = noise.fraction(self._view.noise)
        own = PixelArrays(data.values[which], weight, fraction, data.level[which], frame)
        return padded(self._view, own)

    def flat_sides(
        self,
        data: PixelData,
        minima: PixelMinima,
        which: np.ndarray,
        noise: NoiseEstimate,
        usable: np.ndarray,
    ) -> np.ndarray:
        """On which sides (pixels, 2) of the best thickness of the pixels `which` the misfit never rises, or
        only to a plateau.

        That is by their scan; where it says so of `usable` pixels, by the exact misfit at its nodes.
        """
        sides = np.zeros((len(which), 2), bool)
        if self._depth is None or minima.profile.shape[1] < 2:
            return sides
        values = minima.values[which, 0]
        wider = student(noise.effective_freedom(self._view.noise), RIVAL)[:, None] ** 2
        rise = _resampled(self._grid, minima.thickness, minima.profile[which])
        rise = rise * evidence_factor(noise, self._view)[:, None] / wider
        rise = rise - np.minimum(rise.min(axis=1), 0.0)[:, None]
        sides = flat_sides(self._grid, rise, values[:, self._depth])
        doubtful = np.flatnonzero(sides.any(axis=1) & usable)
        if len(self._parameters) == 1 and len(doubtful):
            arrays = self.arrays(data, which, noise)
            points = np.concatenate([np.tile(self._grid, (len(doubtful), 1)), values[doubtful]], axis=1)
            exact = self._deviance(arrays, doubtful, points[..., None])
            rise = (exact - exact.min(axis=1)[:, None])[:, :-1] / wider[doubtful]
            sides[doubtful] = flat_sides(self._grid, rise, values[doubtful, 0])
        return sides

    def stderr(
        self,
        arrays: PixelArrays,
        values: np.ndarray,
        covariance: np.ndarray,
        sides: np.ndarray,
        usable: np.ndarray,
        converged: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Standard errors (pixels, parameters) at the best `values`, and the pixels that have converged.

        `arrays` count points as the errors do, `covariance` (pixels, parameters, parameters) is that by the
        curvature. Pixels that are not `usable` have errors by the covariance alone.
        """

        def profile(
            which: np.ndarray, axis: np.ndarray, at: np.ndarray, starts: np.ndarray
        ) -> tuple[np.ndarray, np.ndarray]:
            points = starts[:, 0].copy()
            points[np.arange(len(at)), axis] = at
            return self._refitted(arrays, which, axis, points)

        around = Neighbourhood(
            values,
            self._lower,
            self._upper,
            covariance,
            self._natural,
            lambda which, points: self._deviance(arrays, which, points),
            profile,
            np.zeros((len(values), 0, values.shape[1])),
        )
        flat = {} if self._depth is None else {self._depth: sides}
        result = limits(around, flat, usable).stderr
        # on a plateau, as of an opaque film, a solver has no point to settle at
        depths = [i for i, p in enumerate(self._parameters) if p.key == "thickness"]
        converged = converged | (usable & np.isinf(result[:, depths]).any(axis=1))
        lost = ~converged & usable
        result[lost] = by_curvature(around.stderr, self._lower, self._upper)[lost]
        if drifts(self._scene) and len(self._scene.layers) == 1 and self._depth is not None:
            result[values[:, self._depth] < self._thinnest(arrays, values), self._depth] = np.inf
        return result, converged

    def _thinnest(self, arrays: PixelArrays, values: np.ndarray) -> np.ndarray:
        """Thickness (pixels,), or (1,) for all, of a layer below which a drift can imitate its fringes."""
        rows = slice(self._view.rows)
        # a layer without numbers of its own has one index at all pixels
        some = np.arange(1 if len(self._parameters) == 1 else len(values))
        layer = locals_of(self._view, arrays.some(some), values[some])[0].layer
        index = layer[:, 0, rows] / np.asarray(self._view.scene.light.wavelength)[rows]
        return FEWEST_FRINGES / np.maximum(np.ptp(2 * index, axis=1), 1e-12)

    def _prior(self, at: np.ndarray) -> np.ndarray:
        """-2 ln of the priors of parameters `at` (..., parameters), without a constant."""
        return np.sum(self._box.prior_rows(at) ** 2, axis=-1)

    def _deviance(self, arrays: PixelArrays, which: np.ndarray, at: np.ndarray) -> np.ndarray:
        return in_lanes(deviances, self._view, arrays.some(which), at).value + self._prior(at)

    def _refitted(
        self, arrays: PixelArrays, which: np.ndarray, axis: np.ndarray, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Least deviance with one parameter held and the others refitted, and where it is."""
        if at.shape[1] == 1:
            return self._deviance(arrays, which, at[:, None])[:, 0], at
        view, own, span = self._view, arrays.some(which), self._upper - self._lower
        held = np.arange(at.shape[1]) == axis[:, None]
        best, best_at = np.full(len(at), np.inf), at.copy()
        for _ in range(_REFITS + 1):
            local, deviance = locals_of(view, own, at)
            deviance = deviance + self._prior(at)
            better = deviance < best
            best[better], best_at[better] = deviance[better], at[better]
            weight = own.weight * np.sqrt(own.independent_fraction)[:, None]
            flat, _ = self._nuisances.columns(local, own.level)
            steep = local.gain[..., None] * local.slope * span
            rows = np.concatenate([steep[:, : view.points], flat], axis=2)
            rows = rows * weight[:, : view.points, None]
            data = ((own.values - local.model) * weight)[:, : view.points]
            matrix = np.swapaxes(rows, 1, 2) @ rows
            right = np.einsum("pnc,pn->pc", rows, data)
            prior = np.concatenate([self._box.prior_weight * span, np.ones(flat.shape[2])])
            matrix = matrix + np.diag(prior**2)
            right[:, : at.shape[1]] -= prior[: at.shape[1]] * self._box.prior_rows(at)
            kept = np.concatenate([~held, np.ones((len(at), flat.shape[2]), bool)], axis=1)
            matrix = np.where(kept[:, :, None] & kept[:, None, :], matrix, np.eye(kept.shape[1]))
            step = solve(matrix, np.where(kept, right, 0.0))[:, : at.shape[1]] * span
            # half of the step after one that was too long
            step = np.where(better[:, None], step, 0.5 * (best_at - at) * ~held)
            at = np.clip(at + step, self._lower, self._upper)
        return best, best_at


def _resampled(grid: np.ndarray, thickness: np.ndarray, profile: np.ndarray) -> np.ndarray:
    """A scan (pixels, nodes) against thickness at the values of another grid, linearly."""
    at = np.clip(np.searchsorted(thickness, grid) - 1, 0, len(thickness) - 2)
    share = np.clip((grid - thickness[at]) / (thickness[at + 1] - thickness[at]), 0.0, 1.0)
    return profile[:, at] * (1 - share) + profile[:, at + 1] * share
