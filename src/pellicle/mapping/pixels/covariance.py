"""Least squares of many pixels at once, by their normal equations: solutions within bounds, covariances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_RIDGE = 1e-14
"""Share of a column's own sum of squares below which no direction is seen: rounding of a sum."""
_PASSES = 20


class Normal(NamedTuple):
    """Normal equations of pixels: `matrix` (pixels, columns, columns), priors included, and `right` (pixels,
    columns)."""

    matrix: np.ndarray
    right: np.ndarray


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverses (pixels, columns, columns) of positive definite matrices.

    Columns are brought to one size first. A direction that the data do not see keeps a huge variance, as in
    `fitting.covariance.errors`.
    """
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", matrix), 1e-200))
    outer = size[..., :, None] * size[..., None, :]
    scaled = matrix / outer + _RIDGE * np.eye(matrix.shape[-1])
    return np.linalg.inv(scaled) / outer


def solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions (pixels, columns) of positive definite systems, columns brought to one size first."""
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", matrix), 1e-200))
    scaled = matrix / (size[..., :, None] * size[..., None, :]) + _RIDGE * np.eye(matrix.shape[-1])
    return np.linalg.solve(scaled, (right / size)[..., None])[..., 0] / size


def solve_within(normal: Normal, lower: np.ndarray, upper: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Solutions where coefficients that would leave their bounds stay on them, and are not let go again.

    `free` are the solutions without bounds, `lower` and `upper` (pixels, columns); as `fitting.discrepancy`.
    """
    solution, inside = free.copy(), np.ones(free.shape, bool)
    todo = np.arange(len(free))
    for _ in range(_PASSES):
        own = solution[todo]
        outside = inside[todo] & ((own < lower[todo]) | (own > upper[todo]))
        todo = todo[outside.any(axis=1)]
        if not len(todo):
            break
        kept = inside[todo] & ~outside[outside.any(axis=1)]
        inside[todo] = kept
        held = np.where(kept, 0.0, np.clip(solution[todo], lower[todo], upper[todo]))
        right = normal.right[todo] - np.einsum("pij,pj->pi", normal.matrix[todo], held)
        both = kept[:, :, None] & kept[:, None, :]
        matrix = np.where(both, normal.matrix[todo], np.eye(kept.shape[1]))
        solution[todo] = held + solve(matrix, np.where(kept, right, 0.0))
    return solution


def noise_covariance(
    jacobian: np.ndarray, variance: np.ndarray, prior: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariances (pixels, columns, columns) by weighted Jacobians (pixels, points, columns) with `variance`
    (pixels,) on σ² and `prior` (pixels, columns) rows, and the sums of squares without either."""
    gram = np.swapaxes(jacobian, 1, 2) @ jacobian
    matrix = gram / variance[:, None, None]
    at = np.arange(prior.shape[1])
    matrix[:, at, at] += prior**2
    return inverse(matrix), gram
