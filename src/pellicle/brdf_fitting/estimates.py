"""Errors of a fitted surface, from the Jacobian at its best point."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.brdf_fitting.problem import Problem, around, compared, parameters
from pellicle.brdf_fitting.search import Minima
from pellicle.fitting.noise import correlation_length
from pellicle.fitting.result import Estimate, Rival
from pellicle.fitting.uncertainty import UNSEEN, correlation
from pellicle.surfaces.surface import Surface

_ON_BOUND = 1e-6
_MOST_RIVALS = 10


class Local(NamedTuple):
    """A fit around its best point. `variance` multiplies χ²: the noise, and its correlation."""

    names: tuple[str, ...]
    numbers: np.ndarray
    covariance: np.ndarray
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


def estimates(surface: Surface, problem: Problem, unit: np.ndarray, at: Local) -> dict[str, Estimate]:
    """Every parameter, free ones first, the thickness before all."""
    leaves = {leaf.name: leaf for leaf in surface.leaves()}
    found = []
    for name, value, stderr in zip(at.names, at.numbers, at.stderr, strict=True):
        free = leaves[name].free
        near = _ON_BOUND * (free.upper - free.lower)
        bound = bool(min(value - free.lower, free.upper - value) <= near)
        error = math.inf if stderr > UNSEEN * (free.upper - free.lower) else float(stderr)
        unit_ = leaves[name].about.unit
        found.append(Estimate(name, float(value), error, unit_, free.lower, free.upper, True, bound))
    found.sort(key=lambda e: e.name != "thickness")
    fixed = [
        Estimate(name, x, 0.0, about.unit, x, x, False)
        for about in surface.brdf.parameters
        if about.key in (numbers := surface.fixed())
        for name, x in _each(about.key, numbers[about.key])
    ]
    return {e.name: e for e in [*found, *fixed]}


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
