"""Errors from the Jacobian: covariance, correlations, and what the data do not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pellicle.fitting.spectra.evaluation import Local
from pellicle.fitting.spectra.nuisance import offset_prior, scale_prior
from pellicle.fitting.spectra.problem import Problem, View
from pellicle.scene.instrument import Drift

UNSEEN = 0.5
"""A standard error above this share of a parameter's range: the data add nothing to the bounds."""


@dataclass(frozen=True)
class Linear:
    """One coefficient of the scale or the offset, in physical units."""

    name: str
    value: float
    basis: np.ndarray  # what it multiplies at each point
    prior_sd: float
    on_signal: bool
    not_negative: bool  # one number that cannot be below zero


def correlation(covariance: np.ndarray) -> np.ndarray:
    """The correlation matrix of a covariance; zero for a parameter without one."""
    deviation = np.sqrt(np.diag(covariance))
    sd = np.where(deviation > 0, deviation, 1.0)
    return covariance / np.outer(sd, sd)


@dataclass(frozen=True)
class Errors:
    """Covariance of nonlinear then linear parameters; `names` in the same order."""

    names: tuple[str, ...]
    covariance: np.ndarray

    @property
    def stderr(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> np.ndarray:
        return correlation(self.covariance)


def linear_coefficients(view: View, at: Local) -> list[Linear]:
    """Scale and offset as Chebyshev coefficients in wavelength, recovered from their curves."""
    instrument = view.scene.instrument
    found: list[Linear] = []
    if isinstance(instrument.scale, Drift):
        _, sd = scale_prior(instrument.scale)
        found += _series("scale", view, at.gain, sd, size=None)
    if isinstance(instrument.offset, Drift):
        _, sd = offset_prior(instrument.offset)
        found += _series("offset", view, at.offset, sd, size=float(view.data.level))
    return found


def _series(name: str, view: View, curve, sd: np.ndarray, size: float | None) -> list[Linear]:
    """The coefficients of one curve; a gain's priors are in units of its own mean (`size=None`)."""
    position, degree = np.asarray(view.data.position)[: view.points], len(sd) - 1
    coefficients = np.polynomial.chebyshev.chebfit(position, np.asarray(curve)[: view.points], degree)
    basis = np.polynomial.chebyshev.chebvander(position, degree).T
    prior_sd = sd * (abs(coefficients[0]) if size is None else size)
    own = f".{view.name}" if view.name else ""
    names = [f"instrument.{name}" + (f"_{j}" if j else "") + own for j in range(degree + 1)]
    not_negative = name == "offset" and degree == 0
    return [
        Linear(*row, name == "scale", not_negative)
        for row in zip(names, coefficients.tolist(), basis, prior_sd, strict=True)
    ]


class Scaled(NamedTuple):
    """The weighted Jacobian of all data and priors, each column in the `unit` of its parameter.

    `jacobian` (points and priors, parameters): nonlinear parameters by their range, then linear
    coefficients by their prior's standard deviation, and in its last rows the priors.
    """

    jacobian: np.ndarray
    unit: np.ndarray
    names: tuple[str, ...]


def scaled(problem: Problem, at: Sequence[Local], variance: Sequence[float]) -> Scaled:
    """`at` and `variance` are those of each view; `variance` multiplies σ²: what the residuals say of the
    noise, and of its correlation."""
    linear = [linear_coefficients(view, local) for view, local in zip(problem.views, at, strict=True)]
    every = [c for own in linear for c in own]
    span = problem.box.upper - problem.box.lower
    blocks, first = [], len(span)
    for view, local, own, widened in zip(problem.views, at, linear, variance, strict=True):
        block = np.zeros((view.points, len(span) + len(every)))
        weight = (np.asarray(view.data.weight)[: view.points] / np.sqrt(widened))[:, None]
        block[:, list(view.takes)] = weight * _steep(view, local)
        if own:
            block[:, first : first + len(own)] = weight * _flat(view, local, own)
        first += len(own)
        blocks.append(block)
    priors = np.diag(np.concatenate([problem.box.prior_weight * span, np.ones(len(every))]))
    return Scaled(
        np.vstack([*blocks, priors]),
        np.concatenate([span, [c.prior_sd for c in every]]),
        (*(p.name for p in problem.parameters), *(c.name for c in every)),
    )


def errors(problem: Problem, at: Sequence[Local], variance: Sequence[float]) -> Errors:
    """Covariance by a singular value decomposition of the Jacobian in units of each parameter's range.

    The arguments are those of `scaled`. Nothing is inverted that is not there: a direction that the data
    do not see keeps its huge variance (a pseudo-inverse would call it 0, and an opaque gold film known to
    ± 0.00 nm).
    """
    jacobian, unit, names = scaled(problem, at, variance)
    _, values, rows = np.linalg.svd(jacobian, full_matrices=False)
    points = len(jacobian) - len(unit)
    floor = np.finfo(float).eps * points * max(values.max(initial=0.0), 1e-100)
    spread = rows.T / np.maximum(values, floor)
    return Errors(names, (spread @ spread.T) * np.outer(unit, unit))


def _steep(view: View, at: Local) -> np.ndarray:
    """∂ model / ∂ nonlinear parameter in units of its range, (points, the view's parameters)."""
    gain, slope = np.asarray(at.gain)[: view.points, None], np.asarray(at.slope)[: view.points]
    return gain * slope * (view.box.upper - view.box.lower)


def _flat(view: View, at: Local, linear: list[Linear]) -> np.ndarray:
    """∂ model / ∂ linear coefficient in units of its prior, (points, coefficients)."""
    signal = np.asarray(at.signal)[: view.points]
    return np.column_stack([c.basis * (signal if c.on_signal else 1.0) * c.prior_sd for c in linear])


def layer_errors(at: Local, covariance: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Standard errors of the layer's n and k at each wavelength, from the nonlinear covariance."""
    slope = np.asarray(at.layer_slope)[:, :points]
    variance = np.einsum("cip,pq,ciq->ci", slope, covariance, slope)
    n, k = np.sqrt(np.maximum(variance, 0.0))
    return n, k
