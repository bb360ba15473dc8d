"""Fitted colours as a display shows them, and in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pellicle.colour.encoding import encoding
from pellicle.colour.spaces import linear_srgb, srgb
from pellicle.data.colours import Colours
from pellicle.fitting.curves import ColourCurve

if TYPE_CHECKING:
    from pellicle.fitting.result import Part

_DISPLAY = 2.2
"""Gamma with which the channels of a camera are shown: its own colours are not those of a display."""


def colours_of(part: Part) -> tuple[Colours, ColourCurve]:
    """Data and curve of a part. Raises TypeError where these are no colours."""
    if not isinstance(part.data, Colours) or not isinstance(part.curve, ColourCurve):
        raise TypeError(f"{type(part.data).__name__} was fitted, not colours")
    return part.data, part.curve


def display(colours: Colours, values: np.ndarray) -> np.ndarray:
    """sRGB from 0 to 1 of values (..., 3) in the space of the colours; of a camera its channels."""
    if colours.space == "srgb":
        return np.clip(values, 0.0, 1.0)
    if colours.space == "rgb":
        return np.clip(values, 0.0, 1.0) ** (colours.gamma / _DISPLAY)
    white = colours.sensor[1].sum(axis=0)
    return np.asarray(srgb(linear_srgb(encoding(colours.space, white).decode(values), white)))


def summary(part: Part) -> str:
    """`3 colours in srgb, R, at 0 to 60 degrees`."""
    data, _ = colours_of(part)
    light = "" if data.polarisation == "unpolarised" else f" of {data.polarisation}-polarised light"
    text = f"{len(data)} colour{'s' * (len(data) != 1)} in {data.space}, {data.signal}{light}"
    if data.angle is None:
        return text
    low, high = data.angle.min(), data.angle.max()
    return f"{text}, at {low:g} to {high:g} degrees" if low < high else f"{text}, at {low:g} degrees"


def differences(part: Part) -> str | None:
    """Mean and largest ΔE*ab of data and fit, None where the channels are those of a camera."""
    _, curve = colours_of(part)
    if curve.difference is None:
        return None
    return f"{curve.difference.mean():.2g} on average, {curve.difference.max():.2g} at most (ΔE*ab, CIE 1976)"
