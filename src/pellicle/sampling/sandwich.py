"""Draws of a posterior with the covariance of a fit whose residuals stand for an uneven noise.

A likelihood of one noise for all points has the width of its curvature. The draws around each minimum are
stretched so that their covariance becomes that of the sandwich estimator: the open-faced sandwich adjustment
of B. Shaby, J. Comput. Graph. Stat. 23, 853 (2014).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pellicle.fitting.covariance import Errors
from pellicle.sampling.modes import Modes

Stretch = Callable[[np.ndarray], np.ndarray]
"""Points (..., parameters) of the unit cube → stretched ones."""


def unchanged(units: np.ndarray) -> np.ndarray:
    """Return the draws as they are."""
    return units


def sandwich_stretch(errors: Errors, slope: np.ndarray, modes: Modes) -> Stretch:
    """Return the stretch of draws from the curvature's covariance of a fit to its own.

    It is that of the best minimum, applied around the minimum to which a draw belongs. Draws beyond a bound
    are reflected at it.

    **Arguments:** `errors` of the best minimum; `slope` (parameters, parameters) of the parameters in their
    own units by the unit cube there; `modes` of the posterior.
    """
    if errors.curvature is None:
        return unchanged
    size = modes.centre.shape[1]  # nuisances, which come last, are integrated out
    to_units = np.linalg.inv(slope)
    own, narrow = (to_units @ c[:size, :size] @ to_units.T for c in (errors.covariance, errors.curvature))
    root = _root(narrow)
    inverse = np.linalg.inv(root)
    # as the errors of a fit, draws are not narrowed: that few residuals are small is no evidence
    matrix = root @ _root(inverse @ own @ inverse, least=1.0) @ inverse

    def stretch(units: np.ndarray) -> np.ndarray:
        flat = units.reshape(-1, units.shape[-1])
        centre = modes.centre[modes.nearest(flat)]
        moved = np.abs(centre + (flat - centre) @ matrix.T)
        return np.clip(1 - np.abs(1 - moved), 0.0, 1.0).reshape(units.shape)

    return stretch


def _root(matrix: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Symmetric square root of a positive definite matrix, of eigenvalues raised to `least`."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return (vectors * np.sqrt(np.maximum(values, max(least, 1e-15 * values.max())))) @ vectors.T
