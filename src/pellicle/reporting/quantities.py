"""Measured quantities of spectra, colours and BRDF samples: names, labels with units, data, model, σ.

Colours are also shown as a display has them, and in words.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.colour.spaces import encoding, linear_srgb, srgb
from pellicle.data.brdf_samples import BrdfSamples, vectors
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum, named
from pellicle.fitting.curves import BrdfCurve, ColourCurve, Curve
from pellicle.fitting.result import Part
from pellicle.reporting.drawable import CHANNELS, SERIES, Style
from pellicle.signals.base import Quantity as Measured


@dataclass(frozen=True, eq=False)
class Quantity:
    """One measured quantity, arrays (points,); `model` and `residual` are those of a fit.

    `name` is that in tables, `label` has the unit. Angles that turn at 360 degrees have `turns`. In a grid,
    its panel has the row and the column of `place`, a `title`, and at least the range `smallest`. `missed` is
    the residual as it is drawn, None where it is not; `drawn` is the name, colour and style of its line.
    """

    name: str
    label: str
    data: np.ndarray
    sigma: np.ndarray | None = None
    model: np.ndarray | None = None
    residual: np.ndarray | None = None
    missed: np.ndarray | None = None
    drawn: tuple[str, str, Style] = ("residual", "residual", "solid")
    turns: bool = False
    place: tuple[int, int] | None = None
    title: str = ""
    smallest: float = 0.0


def quantities(
    data: Spectrum | Colours | BrdfSamples, curve: Curve | ColourCurve | BrdfCurve | None = None
) -> list[Quantity]:
    """Quantities of measured data, in the order of their columns, with those of a fit's `curve`."""
    if isinstance(data, BrdfSamples):
        assert curve is not None
        colours = CHANNELS if set(data.channels) <= {"R", "G", "B"} else ("fit", "green", "blue", "fourth")
        return _channels(data, data.values, data.sigma, curve.model, colours)
    if isinstance(data, Colours):
        assert isinstance(curve, ColourCurve)
        return _channels(data, curve.data, curve.sigma, curve.model, CHANNELS)
    assert curve is None or isinstance(curve, Curve)
    known = [
        q
        for q in data.kind.quantities
        if q.array != "depolarisation" or curve is None or curve.depolarisation_data is not None
    ]
    return [_of_spectrum(data, curve, q, i) for i, q in enumerate(known)]


def _channels(
    data: Colours | BrdfSamples,
    values: np.ndarray,
    sigma: np.ndarray | None,
    model: np.ndarray,
    colours: Sequence[str],
) -> list[Quantity]:
    """Residuals of channels are drawn in σ, where that is known."""
    residual, found = values - model, []
    scaled = residual if sigma is None else residual / sigma
    for c, name in enumerate(data.channels):
        columns = [None if x is None else x[:, c] for x in (sigma, model, residual, scaled)]
        line = (name, colours[c % len(colours)], "point")
        found.append(Quantity(name, name, values[:, c], *columns, drawn=line))
    return found


def weighted_delta(curve: Curve) -> np.ndarray:
    """Residuals of Δ times ½ sin 2Ψ, (points, ratios): what they are on the sphere, in degrees of Ψ.

    Where a ratio is nearly 0, its Δ is noise alone.
    """
    return 0.5 * np.sin(2 * np.deg2rad(curve.model)) * curve.delta_residual


def _of_spectrum(data: Spectrum, curve: Curve | None, q: Measured, i: int) -> Quantity:
    """One quantity of a spectrum, the i-th one, with those of a fit."""
    values: dict[str, Any] = {"data": q.measured(data), "sigma": q.error(data)}
    if curve is not None:
        names = "data", "model", "residual"
        values |= dict(zip(names, q.curve(curve), strict=True))
        if q.array == "values":
            values["sigma"] = curve.sigma if q.column is None else curve.sigma[:, q.column]
        if q.array != "depolarisation":  # it has another unit than the residuals of angles
            weighted = q.wraps and q.column is not None
            values["missed"] = weighted_delta(curve)[:, q.column] if weighted else values["residual"]
    label = (q if q.cell is None else q._replace(label=q.cell.label)).axis
    label = label if data.calibrated else f"{label} × unknown scale"
    if q.cell is not None:  # its place in a grid, and the line of its residual
        row, column = q.cell.row, q.cell.column
        # angles share the colour of their column
        colour, later = (SERIES[column], row > 0) if q.unit else (f"C{i % 10}", i >= 10)
        values |= {"place": (row, column), "title": data.kind.grid[row][column], "smallest": q.cell.smallest}
        values["drawn"] = (q.cell.residual, colour, "dashed" if later else "solid")
    elif q.unit:
        values["drawn"] = (q.label, *(("blue", "dashed") if q.wraps else ("residual", "solid")))
    return Quantity(q.name, label, **values, turns=q.wraps)


def abscissa(data: Spectrum | Colours | BrdfSamples) -> tuple[np.ndarray, str]:
    """The x axis (points,) and its label.

    Of a spectrum it is the wavelength, or the angle of incidence or else the azimuth of the sample if there
    is one wavelength only; of BRDF samples the half angle; of colours their number.
    """
    if isinstance(data, BrdfSamples):
        return half_angle(data), "half angle (degrees)"
    if isinstance(data, Colours):
        return np.arange(1.0, len(data) + 1), "colour" if data.angle is None else "angle of incidence"
    if np.unique(data.wavelength).size == 1:
        if data.angle is not None and np.unique(data.angle).size > 1:
            return data.angle, "angle of incidence (degrees)"
        if data.azimuth is not None and np.unique(data.azimuth).size > 1:
            return data.azimuth, "azimuth of the sample (degrees)"
    return data.wavelength, "wavelength (nm)"


def half_angle(samples: BrdfSamples) -> np.ndarray:
    """Angle between the normal and the bisector of light and eye, in degrees, shape (samples,)."""
    theta_i, phi_i, theta_o, phi_o = (
        np.deg2rad(angle) for angle in (samples.theta_i, samples.phi_i, samples.theta_o, samples.phi_o)
    )
    half = vectors(theta_i, phi_i) + vectors(theta_o, phi_o)
    return np.rad2deg(np.arctan2(np.hypot(half[0], half[1]), half[2]))


def lines_of(spectrum: Spectrum) -> list[tuple[np.ndarray, str | None]]:
    """Indices of the points of each line in rising order, and its name, such as `65°` or `azimuth 45°`; None
    if there is one line."""
    x, _ = abscissa(spectrum)
    every = spectrum.settings
    if (x is spectrum.angle and spectrum.azimuth is None) or x is spectrum.azimuth:
        return [(np.argsort(x, kind="stable"), None)]
    groups: list[tuple[np.ndarray, str | None]] = []
    if x is spectrum.angle:
        assert spectrum.azimuth is not None
        azimuths = np.unique(spectrum.azimuth)
        for azimuth in azimuths:
            name = f"azimuth {azimuth:g}°" if len(azimuths) > 1 else None
            groups.append((np.flatnonzero(spectrum.azimuth == azimuth), name))
    else:
        groups += [(setting.rows, named(setting, every)) for setting in every]
    return [(points[np.argsort(x[points], kind="stable")], name) for points, name in groups]


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


def colour_codes(colours: Colours, values: np.ndarray) -> list[str]:
    """Values (colours, 3) as a display shows them, #rrggbb."""
    shown = np.round(255 * np.clip(display(colours, values), 0, 1)).astype(int)
    return ["#{:02x}{:02x}{:02x}".format(*rgb) for rgb in shown]


def colours_in_words(part: Part) -> str:
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
