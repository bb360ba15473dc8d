"""Fitted colours in figures, texts and tables: patches of data and fit beside each other, and residuals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pellicle.colour.encoding import encoding
from pellicle.colour.spaces import linear_srgb, srgb
from pellicle.data.colours import Colours
from pellicle.fitting.curves import ColourCurve
from pellicle.reporting.drawing import ABOVE, BLACK, BLUE, GREEN, GREY, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pellicle.fitting.result import Part

_DISPLAY = 2.2
"""Gamma with which the channels of a camera are shown: its own colours are not those of a display."""
_MARKS = ORANGE, GREEN, BLUE


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


def columns(part: Part) -> dict[str, Sequence[float] | np.ndarray]:
    """Columns of a table with a row for each colour: angle, data, model, σ and ΔE*ab."""
    data, curve = colours_of(part)
    result: dict[str, Sequence[float] | np.ndarray] = {}
    if data.angle is not None:
        result["angle_deg"] = data.angle
    for kind, values in (("", curve.data), ("model_", curve.model), ("sigma_", curve.sigma)):
        result |= {f"{kind}{name}": column for name, column in zip(data.channels, values.T, strict=True)}
    if curve.difference is not None:
        result["delta_e"] = curve.difference
    return result


def rows(part: Part) -> Iterable[tuple[str | float, ...]]:
    """Rows of a joint table: name, signal, nothing for the wavelength, angle, data, model, residual, σ."""
    data, curve = colours_of(part)
    angle = np.full(len(data), np.nan) if data.angle is None else data.angle
    for c, channel in enumerate(data.channels):
        values = (x[:, c] for x in (curve.data, curve.model, curve.residual, curve.sigma))
        for at, *row in zip(angle, *values, strict=True):
            yield part.name, channel, np.nan, at, *row


def patches(axes: Axes, part: Part) -> None:
    """Draw each measured colour above the fitted one, with their difference."""
    data, curve = colours_of(part)
    image = np.stack([display(data, curve.data), display(data, curve.model)])
    axes.imshow(image, aspect="auto", interpolation="nearest", extent=(-0.5, len(data) - 0.5, 1.5, -0.5))
    axes.set_yticks([0, 1], ["data", "fit"])
    for at, difference in enumerate(() if curve.difference is None else curve.difference):
        dark = image[1, at] @ (0.2126, 0.7152, 0.0722) < 0.5
        colour = "white" if dark else BLACK
        axes.text(at, 1, f"ΔE {difference:.2g}", ha="center", va="center", fontsize="small", color=colour)
    axes.axhline(0.5, color="white", linewidth=1.5)
    axes.tick_params(labelbottom=False, length=0)


def residuals(axes: Axes, part: Part) -> None:
    """Draw the residuals of each channel in standard deviations."""
    data, curve = colours_of(part)
    at, scaled = np.arange(len(data)), curve.residual / curve.sigma
    for c, (name, colour) in enumerate(zip(data.channels, _MARKS, strict=True)):
        axes.plot(at + 0.12 * (c - 1), scaled[:, c], "o", color=colour, markersize=4, label=name)
    axes.axhspan(-1, 1, color=BLUE, alpha=0.12, lw=0)
    axes.axhline(0, color=GREY, linewidth=0.6)
    ticks = [str(i + 1) for i in at] if data.angle is None else [f"{x:g}°" for x in data.angle]
    axes.set_xticks(at, ticks)
    axes.set_xlim(-0.5, len(data) - 0.5)
    reach = max(1.5, 1.15 * float(np.max(np.abs(scaled))))
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("colour" if data.angle is None else "angle of incidence")
    axes.set_ylabel("(data − fit) / σ")
    axes.legend(**ABOVE, ncols=3, fontsize="small")
