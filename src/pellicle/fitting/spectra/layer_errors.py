"""Standard errors of a layer's n and k."""

from __future__ import annotations

from typing import Any

import numpy as np


def layer_errors(at: Any, covariance: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Standard errors of the layer's n and k at each wavelength, from the covariance of the parameters.

    `at` is the local model of a spectrum or of colours.
    """
    slope = np.asarray(at.layer_slope)[:, :points]
    variance = np.einsum("cip,pq,ciq->ci", slope, covariance, slope)
    n, k = np.sqrt(np.maximum(variance, 0.0))
    return n, k
