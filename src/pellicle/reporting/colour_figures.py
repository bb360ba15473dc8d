"""Interference colour chart of a film."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from pellicle.colour.spaces import outside
from pellicle.reporting.matplotlib_figure import figure_path, new_figure, save_figure
from pellicle.scene.film import Scene
from pellicle.simulation.colours import interference_colours

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pellicle.reporting.colour_inverse import ChartInverse

ACROSS, UP = 600, 61
"""Pixels of the chart: thicknesses, angles."""


def chart(
    scene: Scene,
    path: str | os.PathLike[str],
    thickness: tuple[float, float],
    angle: tuple[float, float],
    layer: str | None = None,
    *,
    observer: str = "1931",
    illuminant: str = "D65",
    title: str = "",
    inverse: ChartInverse | None = None,
) -> float:
    """Draw a film's colours against thickness and angle of incidence into `path` (.png, .pdf or .svg).

    **Arguments:** `thickness` (nm) and `angle` (degrees) are ranges; `layer`, `observer` and `illuminant` are
    those of `pellicle.simulation.colours.interference_colours`. `inverse` adds a panel with every thickness
    that has the colour of another one.

    **Returns:** the share of the colours that sRGB cannot show.

    **Raises:** UsageError for another file type, and where the file exists or cannot be written.
    """
    target = figure_path(path)
    nm, degrees = np.linspace(*thickness, ACROSS), np.linspace(*angle, UP)
    colours = interference_colours(scene, nm, degrees, layer, observer=observer, illuminant=illuminant)
    linear = np.asarray(colours.linear_srgb)
    shown = np.clip(np.asarray(colours.srgb), 0, 1)
    save_figure(_draw_chart(shown, thickness, angle, f"{title}   {illuminant}", inverse), target)
    return float(np.mean(outside(linear)))


def _draw_chart(
    srgb: np.ndarray,
    thickness: tuple[float, float],
    angle: tuple[float, float],
    title: str,
    inverse: ChartInverse | None,
) -> Figure:
    """The colours over all angles, below them a strip of the first angle, and then the inverse."""
    heights = [4, 1] if inverse is None else [4, 1, 6]
    figure = new_figure(8, 0.8 * sum(heights))
    swatch, strip, *others = figure.subplots(
        len(heights), 1, sharex=True, gridspec_kw={"height_ratios": heights}
    )
    swatch.imshow(srgb, origin="lower", aspect="auto", extent=(*thickness, *angle))
    swatch.set(ylabel="angle of incidence (°)")
    swatch.set_title(title.strip(), loc="left")
    strip.imshow(srgb[:1], origin="lower", aspect="auto", extent=(*thickness, 0, 1))
    strip.set(yticks=[], ylabel=f"{angle[0]:g}°")
    for axes in others:
        assert inverse is not None
        row, order = np.nonzero(inverse.admissible)
        found = inverse.found.thickness[row, order]
        size = 12 + 24 * np.sqrt(inverse.found.probability[row, order])
        axes.scatter(inverse.source[row], found, size, color=inverse.srgb[row], edgecolors="none")
        axes.set(ylabel=f"thicknesses (nm) of the\ncolour at {angle[0]:g}°", ylim=thickness)
    (others or [strip])[-1].set_xlabel("thickness (nm)")
    return figure
