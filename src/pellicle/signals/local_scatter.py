"""Local scatter of the values of a spectrum, from their second differences."""

import numpy as np
from jaxtyping import Float

HALF_WIDTH = 15
"""Points on each side of the window."""
FEWEST = 2 * HALF_WIDTH + 3
"""Points that have a window."""
_LAGS = range(3, 9)
"""Distances, in points, over which noise of detectors is uncorrelated and fringes are not."""


def local_scatter(values: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
    """Estimate the standard deviation of white noise around each point of a smooth curve.

    It is 1.4826 · median |second difference| / √6 within 15 points on either side: 1.4826 makes a median
    absolute deviation that of a normal distribution, and √6 is the norm of (1, −2, 1). Noise at every other
    point of a window does not reach the median.

    **Arguments:** `values` in the order of the wavelengths; their steps should change slowly.

    **Returns:** one number per point, zeros for fewer than 33 points.
    """
    if values.size < FEWEST:
        return np.zeros(values.size)
    bent = np.abs(np.diff(values, 2))
    medians = np.median(np.lib.stride_tricks.sliding_window_view(bent, 2 * HALF_WIDTH + 1), axis=1)
    return 1.4826 / np.sqrt(6.0) * np.pad(medians, HALF_WIDTH + 1, mode="edge")


def coherence(values: Float[np.ndarray, " points"]) -> Float[np.ndarray, " windows"]:
    """Return the largest correlation of second differences 3 to 8 points apart, in windows of 31 points.

    That of white noise is about 0.3, that of fringes and of smooth curves above 0.8. Empty for a curve that
    is shorter than a window.
    """
    width = 2 * HALF_WIDTH + 1
    if values.size < FEWEST:
        return np.zeros(0)
    bent = np.diff(values, 2)
    windows = np.lib.stride_tricks.sliding_window_view(bent, width)[:: HALF_WIDTH // 3]
    size = np.median(np.abs(windows), axis=1, keepdims=True)
    clipped = np.clip(windows, -3 * size, 3 * size)  # a spike would hide the rest
    power = np.maximum(np.mean(clipped**2, axis=1), np.finfo(float).tiny)
    products = [np.mean(clipped[:, k:] * clipped[:, :-k], axis=1) for k in _LAGS]
    return np.max(np.abs(products), axis=0) / power
