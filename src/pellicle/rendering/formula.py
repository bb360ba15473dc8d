"""A renderer's own formula of a film's colour, and the numbers that it takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.colour import lab, sensor
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
