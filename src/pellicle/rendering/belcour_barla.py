"""Spectral sensitivities in Fourier space, and Airy's series, as renderers approximate them.

Source: L. Belcour and P. Barla, ACM TOG 36(4), 65 (2017), in the form that glTF and MaterialX publish.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.colour.bands import published_gaussians

ORDERS = 2
"""Orders of interference that glTF and MaterialX sum."""


def sensitivity(path: Any, shift: Any) -> Any:
    """XYZ (..., 3) under E of cos(2π·path/λ + shift), for optical paths (...) in nm and shifts (..., 3)."""
    bands = published_gaussians()
    channel = np.array([0, 1, 2, 0])  # the second lobe of X has the shift of the first
    phase = 2 * jnp.pi * path[..., None]
    wavelength, width, weights = (jnp.asarray(x, phase.dtype) for x in bands[:3])
    waves = jnp.cos(phase / wavelength + shift[..., channel])
    return (waves * jnp.exp(-0.5 * (phase * width) ** 2)) @ weights


def series(
    first: Any, second: Any, path: Any, shift: Any, to_channels: Any, product: tuple[float, float]
) -> Any:
    """Reflectance (..., 3) of a film as order 0 and two orders of interference.

    **Arguments:** `first`, `second`: reflectances of the upper and of the lower face; `path`: optical path
    difference (...) in nm; `shift`: phase (..., 3) of both reflections; `to_channels`: converts the XYZ of a
    wave (..., 3) to the channels of the sum; `product`: bounds of the product of both reflectances, whose
    root has no slope at 0.
    """
    passed, both = 1 - first, jnp.clip(first * second, *product)
    returned = passed**2 * second / (1 - both)
    total, term = first + returned, returned - passed
    for order in range(1, ORDERS + 1):
        term = term * jnp.sqrt(both)
        total = total + 2 * term * to_channels(sensitivity(order * path, order * shift))
    return total
