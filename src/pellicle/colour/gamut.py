"""Colours outside sRGB, brought into it at equal luminance."""

from __future__ import annotations

import numpy as np

from pellicle.colour.spaces import TO_SRGB

LUMINANCE = np.linalg.inv(TO_SRGB)[1]
"""Y of linear red, green and blue."""


def into_srgb(linear: np.ndarray) -> np.ndarray:
    """Bring linear sRGB into 0 to 1 by mixing each colour outside with the grey of its own luminance.

    Luminance is kept, and hue along a straight line to the white; only saturation is lost. Colours brighter
    than white become white. Clipping each channel would change hue and luminance: a saturated green film
    would look lighter than it is, an overexposed straw yellow.

    **Arguments:** `linear` (..., 3), with 1 for white.

    **Returns:** (..., 3), in 0 to 1; colours inside are unchanged.

    >>> into_srgb(np.array([0.5, 0.5, -0.1])).round(3).tolist()
    [0.455, 0.455, 0.0]
    """
    linear = np.asarray(linear, float)
    grey = np.clip(linear @ LUMINANCE, 0.0, 1.0)[..., None]
    away = linear - grey
    room = np.where(away > 0, 1 - grey, grey)
    share = np.min(np.where(np.abs(away) > room, room / np.maximum(np.abs(away), 1e-300), 1.0), axis=-1)
    return np.clip(grey + share[..., None] * away, 0.0, 1.0)  # the clip removes rounding


def outside(linear: np.ndarray) -> np.ndarray:
    """True where a colour (..., 3) lies outside sRGB by more than 0.001 of white."""
    return np.any((np.asarray(linear) < -1e-3) | (np.asarray(linear) > 1 + 1e-3), axis=-1)
