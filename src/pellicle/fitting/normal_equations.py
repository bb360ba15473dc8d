"""Linear least squares of many fits at once, by their normal equations: solutions within bounds, covariances.

Normal equations lose half of the digits. They are therefore used only where the columns, brought to one
size, are independent enough; the few other fits are solved from their rows, by singular values.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

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


def times(matrices: Any, vectors: Any) -> Any:
    """Products (..., rows) of matrices (..., rows, columns) and vectors (..., columns), NumPy's or JAX's."""
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
