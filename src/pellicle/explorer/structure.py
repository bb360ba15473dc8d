"""Structures of programs: the effects that are there, and the largest sizes that a program serves."""

from __future__ import annotations

import math
from typing import NamedTuple

from pellicle.errors import UsageError
from pellicle.explorer.controls import Control

_AVERAGED = ("thickness_spread", "bandwidth", "numerical_aperture", "angle_spread")
CONES = ("numerical_aperture", "angle_spread")
_SHARES = (0.125, 0.25, 0.5, 1.0)
"""Shares of the range of an average for which programs are compiled: a small spread needs few nodes."""
_ANGLES, _GRAZING = 5.0, 89.0
"""Step of the largest angle of incidence of programs with a cone of light, and the steepest ray (degrees)."""


class Structure(NamedTuple):
    """Optional effects that a program is compiled for, with upper bounds of their sizes."""

    active: tuple[tuple[str, float], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the controls of the effects that are there."""
        return tuple(name for name, _ in self.active)


def bucket(control: Control, value: float) -> float:
    """Return the upper bound of a program for a value: a share of the range of an average, else all of it."""
    if key_of(control.name) not in _AVERAGED:
        return control.upper
    return next(share * control.upper for share in _SHARES if value <= share * control.upper * (1 + 1e-12))


def oblique_cone(name: str, angle: float, size: float, bound: float) -> tuple[float, float]:
    """Return upper bounds of the angle of incidence, in steps of `_ANGLES`, and of the size of a cone at it.

    Raises UsageError where the cone reaches beyond `_GRAZING`.
    """
    aperture = key_of(name) == "numerical_aperture"
    half = math.degrees(math.asin(min(size, 1.0))) if aperture else size
    if angle + half > _GRAZING:
        raise UsageError(
            f"the cone of light reaches beyond {_GRAZING:g} degrees: the angle of incidence is {angle:g}, and"
            f" the half angle of the cone {half:.3g}"
        )
    highest = min(math.ceil(angle / _ANGLES) * _ANGLES, _GRAZING - half)
    room = _GRAZING - highest
    return highest, min(bound, math.sin(math.radians(room)) if aperture else room)


def key_of(name: str) -> str:
    """Return the last part of a control's name."""
    return name.rpartition(".")[2]
