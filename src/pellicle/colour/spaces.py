"""Conversion of XYZ to linear sRGB, sRGB and Lab, colour differences, and colours outside sRGB."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.optics.pair import namespace

TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""XYZ to linear sRGB (IEC 61966-2-1)."""

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
SRGB_WHITE = np.linalg.solve(TO_SRGB, np.ones(3))
LUMINANCE = np.linalg.inv(TO_SRGB)[1]
"""Y of linear red, green and blue."""


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


def delta_e76(one: Any, other: Any) -> Float[Array, "..."]:
    """Return ΔE*ab (CIE 1976) of Lab values (..., 3). It is differentiable; where equal, its gradient is 0.

    >>> float(delta_e76([50.0, 3.0, 4.0], [50.0, 0.0, 0.0]))
    5.0
    """
    square = jnp.sum((jnp.asarray(one) - jnp.asarray(other)) ** 2, axis=-1)
    equal = square == 0
    return jnp.where(equal, 0.0, jnp.sqrt(jnp.where(equal, 1.0, square)))


def delta_e2000(one: Any, other: Any) -> np.ndarray:
    """Return ΔE CIE 2000 of Lab values (..., 3), by colour-science; it is not differentiable.

    **Raises:** ImportError if colour-science is not installed.
    """
    try:
        from colour.difference import delta_E_CIE2000
    except ImportError as error:
        raise ImportError(
            "ΔE2000 needs colour-science: pip install 'pellicle[colour]' (in a clone of the repository:"
            " pip install -e '.[colour]')"
        ) from error
    return np.asarray(delta_E_CIE2000(np.asarray(one, float), np.asarray(other, float)))


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
