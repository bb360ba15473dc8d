"""Covariance of a fit from its Jacobian, also where the data do not see a direction.

Where the noise of the points is unknown and uneven, their residuals stand for it: the sandwich estimator of
H. White (1980, Econometrica 48, 817), with each residual divided by one less its leverage (HC3, J. MacKinnon
and H. White, 1985, J. Econometrics 29, 305), and Student's t of the degrees of freedom of that variance (F.
Satterthwaite, 1946, Biometrics Bull. 2, 110).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.noise import student
from pellicle.fitting.normal_equations import above_rounding, covariances
from pellicle.fitting.problem import Problem

UNSEEN = 0.5
"""A standard error above this share of a parameter's range: the data add nothing to the bounds."""


def correlation(covariance: np.ndarray) -> np.ndarray:
    """The correlation matrix of a covariance (..., n, n); zero for a parameter without one."""
    deviation = np.sqrt(_diagonal(covariance))
    sd = np.where(deviation > 0, deviation, 1.0)
    return covariance / (sd[..., :, None] * sd[..., None, :])


def _diagonal(matrix: np.ndarray) -> np.ndarray:
    return np.einsum("...ii->...i", matrix)


@dataclass(frozen=True)
class Errors:
    """Covariance (..., n, n) of parameters, then of nuisances, in their own units; `names` in the same order.

    `curvature` is the covariance that the weights alone would give, None where it is the same.
    """

    names: tuple[str, ...]
    covariance: np.ndarray
    curvature: np.ndarray | None = None

    @property
    def variance(self) -> np.ndarray:
        return _diagonal(self.covariance)

    @property
    def stderr(self) -> np.ndarray:
        return np.sqrt(self.variance)

    @property
    def by_curvature(self) -> np.ndarray:
        """Covariance by the curvature of the misfit, as its profile likelihood has it."""
        return self.covariance if self.curvature is None else self.curvature

    @property
    def widening(self) -> np.ndarray:
        """Standard errors over those by the curvature of the misfit (parameters and nuisances,)."""
        return self.stderr / np.maximum(np.sqrt(_diagonal(self.by_curvature)), 1e-300)

    @property
    def correlation(self) -> np.ndarray:
        return correlation(self.covariance)


class Scaled(NamedTuple):
    """The weighted Jacobian of all data and priors, each column in the `unit` of its parameter.

    `jacobian` (..., points and priors, parameters and nuisances): parameters by the unit interval of their
    coordinate, nuisances by the standard deviation of their prior; the last rows are those of the priors.
    `stretch` takes steps in these units to steps in the parameters' own units. `pull` is the distance from
    the means of the priors (..., parameters and nuisances), in their standard deviations. Leading axes are
    those of many fits.
    """

    jacobian: np.ndarray
    stretch: np.ndarray
    names: tuple[str, ...]
    pull: np.ndarray | float = 0.0

    def of(self, which: np.ndarray) -> Scaled:
        """Those of some of many fits, by their positions."""
        pull = np.broadcast_to(self.pull, self.stretch.shape[:-1])
        return Scaled(self.jacobian[which], self.stretch[which], self.names, pull[which])

    def blocks(self, sizes: Sequence[int], variance: Sequence[float | np.ndarray]) -> list[np.ndarray]:
        """Rows of each view, of so many data values, by the σ of its weights: without its `variance`."""
        rows = np.split(self.jacobian, np.cumsum(sizes), axis=-2)[: len(sizes)]
        pairs = zip(rows, variance, strict=True)
        return [block * np.sqrt(widened)[..., None, None] for block, widened in pairs]

    def by_range(self, ranges: np.ndarray) -> np.ndarray:
        """The Jacobian with its columns in steps of `ranges` (columns,) of the parameters' own units."""
        return self.jacobian @ np.linalg.pinv(self.stretch) * ranges


def scaled(problem: Problem, unit: np.ndarray, at: Sequence[Any], variance: Sequence[Any]) -> Scaled:
    """The Jacobian at points (..., parameters) of the unit cube, where `at` are the views' local models.

    `variance` (...) of each view multiplies σ²: noise, and correlation, as the residuals show them.
    """
    nuisances = [view.nuisances(local) for view, local in zip(problem.views, at, strict=True)]
    every = [c for own in nuisances for c in own]
    slope = problem.coordinates.slope(problem.box, unit)
    *lead, count = np.shape(unit)
    size, blocks, first = count + len(every), [], count
    for view, local, own, widened in zip(problem.views, at, nuisances, variance, strict=True):
        part = view.jacobian(local) / np.sqrt(widened)[..., None, None]
        block = np.zeros((*part.shape[:-1], size))
        block[..., :count] = part[..., : len(view.takes)] @ slope[..., list(view.takes), :]
        block[..., first : first + len(own)] = part[..., len(view.takes) :]
        first += len(own)
        blocks.append(block)
    priors, stretch = np.zeros((2, *lead, size, size))
    pull = np.zeros((*lead, size))
    priors[..., :count, :count] = problem.box.prior_weight[:, None] * slope
    priors[..., count:, count:] = np.eye(len(every))
    stretch[..., :count, :count] = slope
    pull[..., :count] = problem.box.prior_rows(problem.values(unit))
    for i, c in enumerate(every, start=count):
        stretch[..., i, i], pull[..., i] = c.prior_sd, c.pull
    names = (*(p.name for p in problem.parameters), *(c.name for c in every))
    return Scaled(np.concatenate([*blocks, priors], axis=-2), stretch, names, pull)


def errors(scaled: Scaled, uneven: Mapping[int, np.ndarray] = MappingProxyType({})) -> Errors:
    """Covariance by the scaled Jacobian, of one fit or of many.

    `uneven` are the weighted residuals (rows, channels) of views of one fit whose residuals stand for the
    noise of their points, each by the first of the view's rows in the Jacobian; channels of one point may be
    correlated.
    """
    if uneven:
        return _by_scores(scaled, uneven)
    shape = scaled.jacobian.shape
    covariance = covariances(scaled.jacobian.reshape(-1, *shape[-2:])).reshape(scaled.stretch.shape)
    return Errors(scaled.names, scaled.stretch @ covariance @ np.swapaxes(scaled.stretch, -1, -2))


def _by_scores(scaled: Scaled, uneven: Mapping[int, np.ndarray]) -> Errors:
    """The sandwich estimator: see the module's docstring."""
    left, values, right = np.linalg.svd(scaled.jacobian, full_matrices=False)
    values = above_rounding(values, len(scaled.jacobian) - len(scaled.names))
    spread = scaled.stretch @ (right.T / values)
    plain = spread @ spread.T
    even, shares = np.ones(len(left), bool), np.zeros(len(spread))
    middle = np.zeros((len(values), len(values)))
    for first, residuals in uneven.items():
        rows = slice(first, first + residuals.size)
        even[rows] = False
        block = left[rows].reshape(*residuals.shape, -1)
        middle += _sum_of_squares(block, residuals)
        shares += np.sum(np.sum((block @ spread.T) ** 2, axis=1) ** 2, axis=0)
    # added, not taken from 1, of which residuals without noise would leave rounding, also below zero
    middle += left[even].T @ left[even]
    # a parameter that few points determine has an error of as few degrees of freedom
    wider = student(np.diag(plain) ** 2 / np.maximum(shares, 1e-300), 1.0)
    return Errors(scaled.names, spread @ middle @ spread.T * np.outer(wider, wider), plain)


def _sum_of_squares(block: np.ndarray, residuals: np.ndarray) -> np.ndarray:
    """Σ uᵀe eᵀu over the rows (rows, channels, columns), with e = (1 − uuᵀ)⁻¹ r: r without the row's own
    influence on the fit."""
    # a point that alone determines a parameter has no residual: nothing divided by nothing
    own = (1 + 1e-9) * np.eye(residuals.shape[1]) - block @ np.swapaxes(block, 1, 2)
    scores = np.einsum("rci,rc->ri", block, np.linalg.solve(own, residuals[..., None])[..., 0])
    return scores.T @ scores
