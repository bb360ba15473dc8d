"""Directions as angles, as unit vectors and as half and difference angles; all angles in radians.

The normal is z. Half and difference angles are those of Rusinkiewicz (A new change of variables for
efficient BRDF representation, 1998): the half vector lies at (θ_h, φ_h), and the difference vector
(θ_d, φ_d) is one of the two directions as seen when the half vector is turned into the normal.
"""

from __future__ import annotations

import numpy as np

Angle = np.ndarray | float


def vectors(theta: Angle, phi: Angle) -> np.ndarray:
    """Unit vectors of shape (3, ...)."""
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def angles(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ from 0 to π and φ from 0 to 2π of vectors of shape (3, ...) and any length."""
    x, y, z = vector
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x) % (2 * np.pi)


def from_half_difference(
    theta_h: Angle, phi_h: Angle, theta_d: Angle, phi_d: Angle
) -> tuple[np.ndarray, np.ndarray]:
    """The two directions (3, ...) with these half and difference angles, that of φ_d first.

    The second is that of φ_d + π: it mirrors the first at the half vector. So to swap light and eye is
    to add π to φ_d.
    """
    x, y, z = vectors(theta_d, phi_d)
    return _turned(x, y, z, theta_h, phi_h), _turned(-x, -y, z, theta_h, phi_h)


def _turned(x: np.ndarray, y: np.ndarray, z: np.ndarray, theta: Angle, phi: Angle) -> np.ndarray:
    """(x, y, z) turned by θ about the y axis, which takes the normal to the half vector, then φ about z."""
    x, z = np.cos(theta) * x + np.sin(theta) * z, np.cos(theta) * z - np.sin(theta) * x
    return np.stack([np.cos(phi) * x - np.sin(phi) * y, np.sin(phi) * x + np.cos(phi) * y, z])
