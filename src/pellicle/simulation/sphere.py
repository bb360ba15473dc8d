"""Geometry of a sphere seen from far away, and light that it passes on as a chain of chords.

The sphere has radius 1, the eye is at infinite z: all lines of sight are parallel. Directions are those of
`pellicle.simulation.environment`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

EYE = np.array([0.0, 0.0, 1.0])
FILLS = 0.95
"""Diameter of the sphere, relative to the width of its rendering."""
LIMB = 0.9995
"""Largest sine of the angle of incidence: pixels that lie across the limb take the colour beside it."""


class Rendering(NamedTuple):
    """Rendering of a sphere: linear sRGB (size, size, 3), and the share of each pixel in it (size, size)."""

    linear: np.ndarray
    coverage: np.ndarray


class Sphere(NamedTuple):
    """Pixels that a sphere covers at least in part: a mask (size, size), their share inside, and normals."""

    mask: np.ndarray
    share: np.ndarray  # (pixels,)
    normal: np.ndarray  # (pixels, 3)

    @property
    def cosine(self) -> np.ndarray:
        """Cosines (pixels,) of the angle of incidence along the line of sight."""
        return self.normal[:, 2]

    @property
    def outward(self) -> np.ndarray:
        """Directions (pixels, 3) from the centre of the rendering to each pixel."""
        flat = self.normal * [1.0, 1.0, 0.0]
        return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)

    def rendering(self, linear: np.ndarray) -> Rendering:
        """Make a rendering of the linear sRGB (pixels, 3) of each pixel."""
        image, coverage = np.zeros((*self.mask.shape, 3)), np.zeros(self.mask.shape)
        image[self.mask], coverage[self.mask] = linear, self.share
        return Rendering(image, coverage)

    def deflected(self, angle: np.ndarray) -> np.ndarray:
        """The line of sight (pixels, 3), away from the eye, turned outward by angles (pixels,) in radians."""
        return np.cos(angle)[:, None] * -EYE + np.sin(angle)[:, None] * self.outward

    def mirrored(self) -> np.ndarray:
        """Directions (pixels, 3) that the sphere mirrors to the eye."""
        return self.deflected(np.pi - 2 * np.arccos(self.cosine))


def sphere(size: int) -> Sphere:
    """Return the pixels of a sphere in a rendering of `size` × `size`."""
    across = ((np.arange(size) + 0.5) * 2 / size - 1) / FILLS
    x, y = np.meshgrid(across, -across)
    radius = np.hypot(x, y)
    share = np.clip((1 - radius) * FILLS * size / 2 + 0.5, 0.0, 1.0)
    mask = share > 0
    shrunk = np.minimum(1.0, LIMB / np.maximum(radius[mask], 1e-12))
    x, y = x[mask] * shrunk, y[mask] * shrunk
    return Sphere(mask, share[mask], np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1))
