"""Lines of a figure of a spectrum: its abscissa, and the points of each angle of incidence and azimuth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pellicle.data.settings import named
from pellicle.data.spectrum import Spectrum
from pellicle.reporting.drawing import BLACK, BLUE, FITTED, GAP, GREEN, GREY, ORANGE, marker_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_NAMED = 8
"""Most lines, one for each angle and azimuth, that get a label."""
_COLOURS = (ORANGE, BLUE, GREEN, BLACK)
_DASHES = ("-", "--")


def abscissa(spectrum: Spectrum) -> tuple[np.ndarray, str]:
    """The x axis and its label: wavelength, or the angle of incidence or else the azimuth of the sample if
    there is one wavelength only."""
    if np.unique(spectrum.wavelength).size == 1:
        if spectrum.angle is not None and np.unique(spectrum.angle).size > 1:
            return spectrum.angle, "angle of incidence (degrees)"
        if spectrum.azimuth is not None and np.unique(spectrum.azimuth).size > 1:
            return spectrum.azimuth, "azimuth of the sample (degrees)"
    return spectrum.wavelength, "wavelength (nm)"


def lines_of(spectrum: Spectrum) -> list[tuple[np.ndarray, str | None]]:
    """Indices of the points of each line in rising order, and its name, such as `65°` or `azimuth 45°`; None
    if there is one line."""
    x, _ = abscissa(spectrum)
    every = spectrum.settings
    if (x is spectrum.angle and spectrum.azimuth is None) or x is spectrum.azimuth:
        return [(np.argsort(x, kind="stable"), None)]
    if x is spectrum.angle:
        assert spectrum.azimuth is not None
        azimuths = np.unique(spectrum.azimuth)
        groups = [
            (np.flatnonzero(spectrum.azimuth == own), f"azimuth {own:g}°" if len(azimuths) > 1 else None)
            for own in azimuths
        ]
    else:
        groups = [(setting.rows, named(setting, every)) for setting in every]
    return [(points[np.argsort(x[points], kind="stable")], name) for points, name in groups]


def unbroken(x: np.ndarray, points: np.ndarray, delta: np.ndarray | None = None) -> list[np.ndarray]:
    """Indices of the points of each stroke, split at wide gaps and where `delta` passes 360 degrees."""
    steps = np.diff(x[points])
    broken = steps > GAP * np.median(steps) if steps.size else np.zeros(0, dtype=bool)
    if delta is not None:
        broken = broken | (np.abs(np.diff(delta[points])) > 180.0)
    return np.split(points, np.flatnonzero(broken) + 1)


def data_and_fit(
    axes: Axes, spectrum: Spectrum, data: np.ndarray, model: np.ndarray, turns: bool = False
) -> None:
    """Draw data as points and the model as one line for each angle and azimuth.

    Angles that turn, such as Δ, are interrupted where they pass 360 degrees.
    """
    x, _ = abscissa(spectrum)
    axes.plot(x, data, ".", color=GREY, markersize=marker_size(x.size), label="data")
    lines = lines_of(spectrum)
    for i, (points, setting) in enumerate(lines):
        color, style = _COLOURS[i % len(_COLOURS)], _DASHES[i // len(_COLOURS) % len(_DASHES)]
        name = "fit" if setting is None else f"fit, {setting}"
        for j, stroke in enumerate(unbroken(x, points, model if turns else None)):
            label = "_" if j or len(lines) > MOST_NAMED else name
            axes.plot(x[stroke], model[stroke], **{**FITTED, "color": color}, linestyle=style, label=label)
    axes.tick_params(labelbottom=False)
    axes.margins(x=0.01)
