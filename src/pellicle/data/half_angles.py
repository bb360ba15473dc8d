"""Directions as angles, unit vectors, and half and difference angles; all angles in radians.

The normal is z. Half and difference angles are those of Rusinkiewicz (A new change of variables for
efficient BRDF representation, 1998): the half vector lies at (θ_h, φ_h), and the difference vector
(θ_d, φ_d) is one of the two directions after a rotation of the half vector onto the normal.
"""

import numpy as np

Angle = np.ndarray | float


def vectors(theta: Angle, phi: Angle) -> np.ndarray:
    """Return unit vectors of shape (3, ...)."""
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def angles(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return θ from 0 to π and φ from 0 to 2π of vectors of shape (3, ...) and any length."""
    x, y, z = vector
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x) % (2 * np.pi)


def from_half_difference(
    theta_h: Angle, phi_h: Angle, theta_d: Angle, phi_d: Angle
) -> tuple[np.ndarray, np.ndarray]:
    """Return the two directions (3, ...) with these half and difference angles, that of φ_d first.

    The second is that of φ_d + π, the mirror image of the first at the half vector: adding π to φ_d swaps
    light and viewer.
    """
    x, y, z = vectors(theta_d, phi_d)
    return _rotated(x, y, z, theta_h, phi_h), _rotated(-x, -y, z, theta_h, phi_h)


def _rotated(x: np.ndarray, y: np.ndarray, z: np.ndarray, theta: Angle, phi: Angle) -> np.ndarray:
    """Rotate by θ about y, which takes the normal to the half vector, then by φ about z."""
    x, z = np.cos(theta) * x + np.sin(theta) * z, np.cos(theta) * z - np.sin(theta) * x
    return np.stack([np.cos(phi) * x - np.sin(phi) * y, np.sin(phi) * x + np.cos(phi) * y, z])
