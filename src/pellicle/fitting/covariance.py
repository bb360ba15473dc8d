"""Covariance of a fit from its Jacobian, also where data do not see a direction, and linear least squares.

Where the noise of the points is unknown and uneven, their residuals stand for it: the sandwich estimator of
H. White (1980, Econometrica 48, 817), with each residual divided by one less its leverage (HC3, J. MacKinnon
and H. White, 1985, J. Econometrics 29, 305), and Student's t of the degrees of freedom of that variance (F.
Satterthwaite, 1946, Biometrics Bull. 2, 110).

Linear least squares of many fits at once are solved by their normal equations, which lose half of the digits.
They are therefore used only where the columns, brought to one size, are independent enough; the few other
fits are solved from their rows, by singular values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.noise import student
from pellicle.fitting.problem import Problem

_RIDGE = 1e-14
"""Share of a column's own sum of squares below which no direction is seen: rounding of a sum."""
_ILL = 1e9
"""Variance inflation (of a column by the others) beyond which singular values are taken instead: normal
equations are then off by up to 3e-6."""
_PASSES = 20

Rows = Callable[[int], tuple[np.ndarray, np.ndarray]]
"""Rows (points and priors, columns) and right-hand sides (points and priors,) of one fit."""


class Normal(NamedTuple):
    """Normal equations of fits: `matrix` (fits, columns, columns), priors included, `right` (fits, columns),
    and the `rows` of one fit by its position."""

    matrix: np.ndarray
    right: np.ndarray
    rows: Rows

    def of(self, columns: np.ndarray) -> Normal:
        """The normal equations of some columns, without the others."""

        def rows(fit: int) -> tuple[np.ndarray, np.ndarray]:
            every, data = self.rows(fit)
            return every[:, columns], data

        return Normal(self.matrix[:, columns][:, :, columns], self.right[:, columns], rows)

    def solved(self) -> tuple[np.ndarray, np.ndarray]:
        """Solutions (fits, columns) and covariances (fits, columns, columns)."""
        covariance, ill = inverse(self.matrix)
        solution = times(covariance, self.right)
        for fit in np.flatnonzero(ill).tolist():
            rows, data = self.rows(fit)
            solution[fit] = np.linalg.lstsq(rows, data, rcond=None)[0]
            covariance[fit] = by_singular_values(rows)
        return solution, covariance


def covariances(rows: np.ndarray) -> np.ndarray:
    """Covariances (fits, columns, columns) of least squares by rows (fits, points and priors, columns)."""
    result, ill = inverse(np.swapaxes(rows, 1, 2) @ rows)
    for fit in np.flatnonzero(ill).tolist():
        result[fit] = by_singular_values(rows[fit])
    return result


def by_singular_values(rows: np.ndarray) -> np.ndarray:
    """Covariance (columns, columns) by rows (points and priors, columns).

    Nothing is inverted that is not there: a direction that the data do not see keeps its huge variance (a
    pseudo-inverse would call it 0, and an opaque gold film known to ± 0.00 nm).
    """
    _, values, directions = np.linalg.svd(rows, full_matrices=False)
    half = directions.T / above_rounding(values, len(rows) - rows.shape[1])
    return half @ half.T


def above_rounding(values: np.ndarray, points: int) -> np.ndarray:
    """Singular values of rows of so many points, those that are rounding raised to its size."""
    return np.maximum(values, np.finfo(float).eps * points * max(values.max(initial=0.0), 1e-100))


def inverse(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (fits, columns, columns) of positive definite matrices, and which (fits,) are inaccurate."""
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", matrix), 1e-200))
    outer = size[..., :, None] * size[..., None, :]
    inverted = np.linalg.inv(matrix / outer + _RIDGE * np.eye(matrix.shape[-1]))
    inflation = np.einsum("...ii->...i", inverted)
    return inverted / outer, ~np.all((inflation > 0) & (inflation < _ILL), axis=-1)


def solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions (fits, columns) of positive definite systems, columns brought to one size first."""
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", matrix), 1e-200))
    scaled = matrix / (size[..., :, None] * size[..., None, :]) + _RIDGE * np.eye(matrix.shape[-1])
    return np.linalg.solve(scaled, (right / size)[..., None])[..., 0] / size


def times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Product of a matrix and a vector of each fit."""
    return (matrices @ vectors[..., None])[..., 0]


def held_within(free: np.ndarray, covariance: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Least-squares solutions within bounds: coefficients that would leave them stay on them, until the slope
    points inwards again.

    `free` are the solutions (fits, columns) without bounds, of this `covariance`; `lower` and `upper` (fits,
    columns). Coefficients h that are held at b move the others as by Gaussian conditioning:
    x = free + Σ[:, h] Σ[h, h]⁻¹ (b − free[h]).
    """
    if np.all((free >= lower) & (free <= upper)):
        return free
    bounded = np.flatnonzero((np.isfinite(lower) | np.isfinite(upper)).any(axis=0))
    solution, held = free.copy(), np.zeros((len(free), len(bounded)), bool)
    bounds, force = np.zeros(held.shape), np.zeros(held.shape)
    todo = np.arange(len(free))
    for step in range(_PASSES):
        own = solution[todo][:, bounded]
        inside = np.clip(own, lower[todo][:, bounded], upper[todo][:, bounded])
        outside = (own != inside) & ~held[todo]
        # a bound pulls a coefficient back; one that would push it there lets go, but not for ever
        pushed = np.where(bounds[todo] == lower[todo][:, bounded], force[todo] < 0, force[todo] > 0)
        pushed &= held[todo] & (step < _PASSES // 2)
        some = (outside | pushed).any(axis=1)
        todo, outside = todo[some], outside[some]
        if not len(todo):
            break
        bounds[todo] = np.where(outside, inside[some], bounds[todo])
        held[todo] = (held[todo] & ~pushed[some]) | outside
        now = held[todo]
        beside = covariance[todo[:, None], bounded]
        matrix = np.where(now[:, :, None] & now[:, None, :], beside[:, :, bounded], np.eye(len(bounded)))
        force[todo] = solve(matrix, np.where(now, bounds[todo] - free[todo][:, bounded], 0.0))
        solution[todo] = free[todo] + np.einsum("pij,pi->pj", beside, force[todo])
        solution[todo[:, None], bounded] = np.where(now, bounds[todo], solution[todo][:, bounded])
    return solution


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
    left, values, rows = np.linalg.svd(scaled.jacobian, full_matrices=False)
    values = above_rounding(values, len(scaled.jacobian) - len(scaled.names))
    spread = scaled.stretch @ (rows.T / values)
    plain = spread @ spread.T
    middle, shares = np.eye(len(values)), np.zeros(len(spread))
    for first, residuals in uneven.items():
        block = left[first : first + residuals.size].reshape(*residuals.shape, -1)
        middle += _sum_of_squares(block, residuals) - np.einsum("rci,rcj->ij", block, block)
        shares += np.sum(np.sum((block @ spread.T) ** 2, axis=1) ** 2, axis=0)
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
