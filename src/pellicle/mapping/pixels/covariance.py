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


def held_within(free: np.ndarray, covariance: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Solutions where coefficients that would leave their bounds stay on them, and are not let go again.

    `free` are the solutions (pixels, columns) without bounds, of this `covariance`; `lower` and `upper`
    (pixels, columns). Coefficients h that are held at b move the others as by Gaussian conditioning:
    x = free + Σ[:, h] Σ[h, h]⁻¹ (b − free[h]). As `fitting.discrepancy`.
    """
    bounded = np.flatnonzero((np.isfinite(lower) | np.isfinite(upper)).any(axis=0))
    solution, held = free.copy(), np.zeros((len(free), len(bounded)), bool)
    bounds = np.zeros(held.shape)
    todo = np.arange(len(free))
    for _ in range(_PASSES):
        own = solution[todo][:, bounded]
        inside = np.clip(own, lower[todo][:, bounded], upper[todo][:, bounded])
        outside = (own != inside) & ~held[todo]
        some = outside.any(axis=1)
        todo, outside = todo[some], outside[some]
        if not len(todo):
            break
        bounds[todo] = np.where(outside, inside[some], bounds[todo])
        held[todo] |= outside
        now = held[todo]
        beside = covariance[todo[:, None], bounded]
        matrix = np.where(now[:, :, None] & now[:, None, :], beside[:, :, bounded], np.eye(len(bounded)))
        force = solve(matrix, np.where(now, bounds[todo] - free[todo][:, bounded], 0.0))
        solution[todo] = free[todo] + np.einsum("pij,pi->pj", beside, force)
        solution[todo[:, None], bounded] = np.where(now, bounds[todo], solution[todo][:, bounded])
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
