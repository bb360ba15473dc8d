"""Airy's formula of one film in complex NumPy, which shares nothing with the package."""

from typing import Any

import numpy as np


def airy(wavelength: Any, thickness: Any, layer: Any, substrate: Any, cosine: Any = 1.0) -> np.ndarray:
    """Unpolarised reflectance in air at the cosine of the angle of incidence (Born and Wolf, section 7.6)."""
    q0 = np.asarray(cosine) + 0j
    q1, q2 = (np.sqrt(n**2 - (1 - q0**2) + 0j) for n in (layer, substrate))
    turn, total = np.exp(4j * np.pi / wavelength * q1 * thickness), 0.0
    for e1, e2 in ((1, 1), (layer**2, substrate**2)):
        above, below = (e1 * q0 - q1) / (e1 * q0 + q1), (e2 * q1 - e1 * q2) / (e2 * q1 + e1 * q2)
        total = total + 0.5 * np.abs((above + below * turn) / (1 + above * below * turn)) ** 2
    return np.asarray(total)
