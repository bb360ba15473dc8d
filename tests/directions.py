"""Directions above a surface as vectors, in NumPy, which share nothing with the package."""

from typing import Any

import numpy as np


def unit(theta: Any, phi: Any) -> np.ndarray:
    """Unit vectors (..., 3) at polar angles from the normal and azimuths in degrees."""
    theta, phi = np.deg2rad(theta), np.deg2rad(phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
