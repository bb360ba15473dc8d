"""A renderer's own formula of a film's colour, and the numbers that it takes.

`sensitivity` and `series` are spectral sensitivities in Fourier space and Airy's series, as renderers
approximate them: L. Belcour and P. Barla, ACM TOG 36(4), 65 (2017), in the form that glTF and MaterialX
publish.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.colour import lab, sensor
from pellicle.colour.bands import published_gaussians
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation
from pellicle.rendering.appearance import ANGLES, Appearance

Numbers = Mapping[str, Any]
"""Numbers of a formula by key: arrays () or (3,) of red, green and blue."""


class Key(NamedTuple):
    """A number of a formula that may be solved for: its bounds, and 1 or 3 channels."""

    name: str
    lower: float
    upper: float
    channels: int = 1


@dataclass(frozen=True)
class Formula:
    """A renderer's formula of a film's colour.

    `colour` takes numbers by key, thicknesses (..., ) in nm and cosines (..., ) of the angle of incidence,
    which broadcast, and returns linear sRGB (..., 3), not above what the renderer would show. `physical` are
    the numbers of a film as a user would copy them from a table. `keys` are those that may be solved for,
    beside the thickness.
    """

    name: str
    keys: tuple[Key, ...]
    colour: Callable[[Numbers, Any, Any], Any]
    physical: Callable[[Appearance], Numbers]

    def xyz(self, numbers: Numbers, thickness: Any) -> Any:
        """XYZ (thicknesses, angles, 3) at `ANGLES` under D65, where linear sRGB (1, 1, 1) is white."""
        return self.xyz_at(numbers, jnp.asarray(thickness)[:, None], np.cos(np.deg2rad(ANGLES)))

    def xyz_at(self, numbers: Numbers, thickness: Any, cosine: Any) -> Any:
        """XYZ (..., 3) under D65 at thicknesses (nm) and cosines, which broadcast."""
        rgb = self.colour(numbers, thickness, cosine)
        matrix = np.linalg.inv(TO_SRGB @ adaptation(sensor().white, SRGB_WHITE))
        return rgb @ jnp.asarray(matrix.T, rgb.dtype)


def lab_of(xyz: Any, brightest: Any) -> Any:
    """CIE 1976 L*, a*, b* of XYZ (..., 3) with the exposure at which the Y `brightest` is white.

    A camera exposes for the image: without that, errors of dark films would look small.
    """
    return lab(xyz / brightest, sensor().white)


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
