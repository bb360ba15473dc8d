"""Conversion of XYZ to linear sRGB, sRGB and Lab."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.optics.array_namespace import namespace

TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""XYZ to linear sRGB (IEC 61966-2-1)."""

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
SRGB_WHITE = np.linalg.solve(TO_SRGB, np.ones(3))


def adaptation(source: Any, target: Any) -> np.ndarray:
    """Return the Bradford matrix that converts XYZ under the white `source` to that under `target`."""
    gain = (BRADFORD @ np.asarray(target)) / (BRADFORD @ np.asarray(source))
    return np.linalg.solve(BRADFORD, gain[:, None] * BRADFORD)


def linear_srgb(xyz: Any, white: Any) -> Float[Array, "... 3"]:
    """Convert XYZ (..., 3) to linear sRGB, not clipped.

    Bradford's adaptation maps `white` (3,) to (1, 1, 1).
    """
    matrix = TO_SRGB @ adaptation(white, SRGB_WHITE)
    return xyz @ jnp.asarray(matrix.T, jnp.result_type(xyz))


def srgb(linear: Any) -> Float[Array, "..."]:
    """Convert linear sRGB to display values (IEC 61966-2-1), clipped to 0 to 1."""
    linear = jnp.clip(linear, 0.0, 1.0)
    dark = linear <= 0.0031308
    safe = jnp.where(dark, 1.0, linear)
    return jnp.where(dark, 12.92 * linear, 1.055 * safe ** (1 / 2.4) - 0.055)


def lab(xyz: Any, white: Any) -> Float[Array | np.ndarray, "... 3"]:
    """Convert XYZ (..., 3) to CIE 1976 L*, a*, b* relative to `white` (3,); arrays of NumPy stay so."""
    xp = namespace(xyz)
    t = xyz / xp.asarray(white, xp.result_type(xyz))
    dark = t <= (6 / 29) ** 3
    f = xp.where(dark, t * (29 / 6) ** 2 / 3 + 4 / 29, xp.cbrt(xp.where(dark, 1.0, t)))
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return xp.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)
