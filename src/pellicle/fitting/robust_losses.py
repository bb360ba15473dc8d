"""Robust losses by name: weights of residuals larger than noise should be.

With z the residual in standard deviations and ρ(z) the loss, ψ = ρ'. Least squares have ψ = z; a loss
whose ψ stops growing, or falls again, is not moved by a few outliers. They are fitted by least squares
with weights ψ(z)/z, again and again (P. Huber and E. Ronchetti, 2009, Robust Statistics, 7.8).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from pellicle.errors import UsageError

LEAST_SQUARES, ROBUST = "least-squares", "student-t"
"""The loss of a fit, and that which is tried where few points carry the residuals."""

_HUBER = 1.345
"""Residual at which Huber's loss turns linear: 95 % of the efficiency of least squares for normal noise."""
_FREEDOM = 4.0
"""Degrees of freedom of Student's t (Lange, Little and Taylor, 1989, J. Am. Stat. Assoc. 84, 881)."""
MAD_TO_SIGMA = 1.4826
"""Standard deviation of normal noise over the median of its absolute values."""


class Loss(NamedTuple):
    """A loss ρ, its weight ψ/z and its curvature ψ'."""

    loss: Callable[[np.ndarray], np.ndarray]
    weight: Callable[[np.ndarray], np.ndarray]
    curvature: Callable[[np.ndarray], np.ndarray]


def _inside(z: np.ndarray) -> np.ndarray:
    return np.abs(z) <= _HUBER


LOSSES = {
    "huber": Loss(
        lambda z: np.where(_inside(z), 0.5 * z**2, _HUBER * (np.abs(z) - 0.5 * _HUBER)),
        lambda z: _HUBER / np.maximum(np.abs(z), _HUBER),
        lambda z: _inside(z).astype(float),
    ),
    "student-t": Loss(
        lambda z: 0.5 * (_FREEDOM + 1) * np.log1p(z**2 / _FREEDOM),
        lambda z: (_FREEDOM + 1) / (_FREEDOM + z**2),
        lambda z: (_FREEDOM + 1) * (_FREEDOM - z**2) / (_FREEDOM + z**2) ** 2,
    ),
}
"""Losses that a fit accepts beside least squares."""


def check_loss(name: str, what: str = "loss") -> None:
    """Raise UsageError for an unknown loss."""
    if name not in (LEAST_SQUARES, *LOSSES):
        raise UsageError(f"{what} must be one of {', '.join([LEAST_SQUARES, *LOSSES])}, not {name!r}")


def spread(residual: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Any:
    """Standard deviation of the bulk of residuals along `axis` (all), from their median absolute value."""
    return np.maximum(MAD_TO_SIGMA * median(np.abs(residual), axis), 1e-300)


def median(values: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Any:
    """Median of values along `axis` (all): NumPy sorts many short rows three times as fast as it finds their
    median."""
    axes = tuple(range(values.ndim)) if axis is None else (axis,) if isinstance(axis, int) else axis
    last = tuple(range(-len(axes), 0))
    rows = values if axes == last else np.moveaxis(values, axes, last)
    ordered = np.sort(rows.reshape(*rows.shape[: rows.ndim - len(axes)], -1), axis=-1)
    middle = ordered.shape[-1] // 2
    return 0.5 * (ordered[..., middle] + ordered[..., -middle - 1])


def inflation(loss: Loss, z: np.ndarray) -> float:
    """Factor on the variance from the reweighted Jacobian: E[w] E[ψ²] / E[ψ']², for residuals `z` whose bulk
    has a standard deviation of 1."""
    weight = loss.weight(z)
    curvature = max(float(np.mean(loss.curvature(z))), 0.1)
    return float(np.mean(weight) * np.mean((weight * z) ** 2) / curvature**2)
