"""Errors of a fitted surface, from the Jacobian at its best point."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.fitting.brdf.coordinates import Coordinates
from pellicle.fitting.brdf.neighbourhood import valley
from pellicle.fitting.brdf.problem import Problem, around, compared, parameters
from pellicle.fitting.brdf.search import Minima
from pellicle.fitting.profile_likelihood import Limits, limits
from pellicle.fitting.result import Estimate, Rival
from pellicle.fitting.spectra.covariance import UNSEEN, Scaled, correlation
from pellicle.fitting.spectra.noise import correlation_length
from pellicle.fitting.status import RIVAL
from pellicle.scene.surface import FreeNumber, Surface

_ON_BOUND = 1e-6
_MOST_RIVALS, _MOST_LOOKED_AT = 10, 3


class Local(NamedTuple):
    """A fit around its best point. `variance` multiplies χ²: the noise, and its correlation.

    `slope` is the Jacobian of the residuals by the free numbers, each in its own unit.
    """

    names: tuple[str, ...]
    numbers: np.ndarray
    covariance: np.ndarray
    slope: np.ndarray
    parameters: dict[str, Any]
    residuals: np.ndarray  # (samples, channels)
    model: np.ndarray
    span: float
    chi2_reduced: float
    length: float
    variance: float

    @property
    def stderr(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> np.ndarray:
        return correlation(self.covariance)


def local(problem: Problem, unit: np.ndarray, sigma_known: bool) -> Local:
    """Residuals, errors and correlation at one point of the unit cube.

    A given σ stays; an unknown one becomes the rms of the residuals. Residuals that are alike in
    neighbouring samples of the file, as on a goniometer's arc, count as fewer.
    """
    left, slope, numbers, stretch, rho = (
        np.asarray(x) for x in jax.device_get(around(*problem.program, unit))
    )
    shape = problem.data.values.shape
    keep = slice(problem.samples)
    residuals = left.reshape(shape)[keep]
    slope = slope.reshape(*shape, -1)[keep].reshape(residuals.size, -1)
    chi2 = float(np.sum(residuals**2)) / max(residuals.size - len(unit), 1)
    length = float(np.mean([correlation_length(column) for column in residuals.T]))
    variance = length * (1.0 if sigma_known else max(chi2, 1e-300))
    c = problem.form.coordinates
    return Local(
        names=(*c.names, *problem.form.weights),
        numbers=numbers,
        covariance=stretch @ _covariance(slope) @ stretch.T * variance,
        slope=slope @ np.linalg.pinv(stretch),
        parameters=parameters(problem.form, problem.fixed, problem.box, problem.most, unit),
        residuals=residuals,
        model=rho[keep],
        span=_span(problem),
        chi2_reduced=chi2,
        length=length,
        variance=variance,
    )


def _span(problem: Problem) -> float:
    """The range of the compared data, in the residuals' unit."""
    form, data = problem.form, problem.data
    there = np.asarray(compared(form, data, 0.0 * data.values))[: problem.samples]
    return float(np.max(np.ptp(there, axis=0)))


def _covariance(slope: np.ndarray) -> np.ndarray:
    """(JᵀJ)⁻¹ by singular values; a direction that the data do not see keeps its huge variance."""
    _, found, rows = np.linalg.svd(slope, full_matrices=False)
    floor = np.finfo(float).eps * len(slope) * max(found.max(initial=0.0), 1e-100)
    spread = rows.T / np.maximum(found, floor)
    return spread @ spread.T


def scaled(surface: Surface, at: Local) -> Scaled:
    """The Jacobian by each number's range, in units of the noise."""
    bounds = {leaf.name: leaf.free.upper - leaf.free.lower for leaf in surface.free_numbers()}
    span = np.array([bounds[name] for name in at.names])
    return Scaled(at.slope * span / math.sqrt(at.variance), span, at.names)


def estimates(surface: Surface, problem: Problem, at: Local, known: dict[str, Limits]) -> dict[str, Estimate]:
    """Every parameter, free ones first, the thickness before all; `known` by name, of the free ones."""
    leaves = {leaf.name: leaf for leaf in surface.free_numbers()}
    found = [
        _estimate(leaves[name], float(value), known[name], problem.form.coordinates)
        for name, value in zip(at.names, at.numbers, strict=True)
    ]
    found.sort(key=lambda e: e.name != "thickness")
    fixed = [
        Estimate(name, x, 0.0, about.unit, x, x, False)
        for about in surface.brdf.parameters
        if about.key in (numbers := surface.fixed_numbers())
        for name, x in _each(about.key, numbers[about.key])
    ]
    return {e.name: e for e in [*found, *fixed]}


def by_curvature(surface: Surface, at: Local) -> dict[str, Limits]:
    """Errors by the covariance alone, for a fit whose numbers should not be used: profiles of it would mean
    nothing, and cost most where the model misses the samples."""
    span = {leaf.name: leaf.free.upper - leaf.free.lower for leaf in surface.free_numbers()}
    each = zip(at.names, at.stderr, strict=True)
    return {name: Limits(float(sd) if sd <= UNSEEN * span[name] else math.inf) for name, sd in each}


def by_profile(
    surface: Surface, problem: Problem, at: Local, others: tuple[Rival, ...] = ()
) -> dict[str, Limits]:
    """Errors and limits, which look at the rivals too. An azimuth has no bounds to lie beside, and of no tilt
    it has no meaning."""
    near = [list(r.parameters.values()) for r in others[:_MOST_LOOKED_AT] if r.delta_chi2 < RIVAL]
    around = valley(surface, problem, np.array([at.numbers, *near]), at.covariance, at.variance)
    found = dict(zip(at.names, limits(around), strict=True))
    tilt, azimuth = found.get("deviation"), found.get("azimuth")
    if tilt is not None and azimuth is not None and problem.form.coordinates.tilt is not None:
        upright = tilt.upper is not None or not math.isfinite(tilt.stderr)
        one_sided = (azimuth.lower is None) != (azimuth.upper is None)
        if upright or (one_sided and not problem.form.coordinates.folded):
            found["azimuth"] = Limits(math.inf)
    return found


def _estimate(leaf: FreeNumber, value: float, limit: Limits, searched: Coordinates) -> Estimate:
    lower, upper, turns = (
        leaf.free.lower,
        leaf.free.upper,
        leaf.key == "azimuth" and searched.tilt is not None,
    )
    if turns and searched.folded:
        lower, upper = 0.0, 180.0
    # a whole turn has no ends
    at_bound = not turns and min(value - lower, upper - value) <= _ON_BOUND * (upper - lower)
    stderr = float(limit.stderr)
    return Estimate(
        leaf.name, value, stderr, leaf.parameter.unit, lower, upper, True, at_bound, limit.lower, limit.upper
    )


def _each(key: str, value: np.ndarray) -> list[tuple[str, float]]:
    if value.ndim == 0:
        return [(key, float(value))]
    letters = ("r", "g", "b") if value.size == 3 else range(1, value.size + 1)
    return [(f"{key}_{letter}", float(x)) for letter, x in zip(letters, value, strict=True)]


def rivals(problem: Problem, minima: Minima, at: Local) -> tuple[Rival, ...]:
    """Every other minimum with its Δχ² on the effective points, best first."""
    found = []
    for unit, chi2 in zip(minima.units[1 : _MOST_RIVALS + 1], minima.chi2[1:], strict=False):
        numbers = np.asarray(around(*problem.program, unit)[2])
        delta = float(chi2 - minima.chi2[0]) / at.variance
        found.append(Rival(dict(zip(at.names, numbers.tolist(), strict=True)), delta))
    return tuple(found)
