"""Smooth noise over a sphere, which a free thickness and a free deviation of a surface follow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

WAVES = 24
"""Number of plane waves in the noise."""


class Relief(NamedTuple):
    """Height and slope of the noise, both 0 to 1, and direction of the slope (degrees), each (...)."""

    height: np.ndarray
    slope: np.ndarray
    azimuth: np.ndarray


def relief(normal: np.ndarray, axes: np.ndarray, rng: np.random.Generator) -> Relief:
    """Return noise of a few bumps over the sphere, at normals (..., 3) with frames (..., 3, 3)."""
    waves = rng.normal(0.0, 3.0, (WAVES, 3))
    phase = normal @ waves.T + rng.uniform(0, 2 * np.pi, WAVES)
    height, gradient = np.cos(phase).sum(-1), -np.sin(phase) @ waves
    along, beside = ((axes[:, row] * gradient).sum(-1) for row in (0, 1))
    slope = np.hypot(along, beside)
    span = np.ptp(height)
    return Relief((height - height.min()) / span, slope / slope.max(), np.rad2deg(np.arctan2(beside, along)))
