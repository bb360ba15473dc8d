"""Interference colour chart of a film, and its inverse: every thickness of each colour, as CSV."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from pellicle.colour import ColourInverse
from pellicle.colour.inverse import SIGMA, ColourThickness
from pellicle.colour.spaces import outside
from pellicle.files import write_text
from pellicle.fitting.film.parameters import varied_and_kept
from pellicle.reporting.matplotlib_figure import figure_path, new_figure, plain, save_figure
from pellicle.reporting.plain_text import csv_rows
from pellicle.scene.film import Scene
from pellicle.simulation.colours import colour_table, interference_colours, varied_layer

ACROSS, UP = 600, 61
"""Pixels of the chart: thicknesses, angles."""


def chart(
    scene: Scene,
    path: str | os.PathLike[str],
    thickness: tuple[float, float],
    angle: tuple[float, float],
    title: str = "",
    inverse: ChartInverse | None = None,
    **how: Any,
) -> float:
    """Draw a film's colours against thickness and angle of incidence into `path` (.png, .pdf or .svg).

    The colours over all angles, below them a strip of the first angle, and then the inverse.

    **Arguments:** `thickness` (nm) and `angle` (degrees) are ranges. `inverse` adds a panel with every
    thickness that has the colour of another one. `layer`, `observer` and `illuminant` are those of
    `pellicle.simulation.spectra.interference_colours`.

    **Returns:** the share of the colours that sRGB cannot show.

    **Raises:** UsageError for another file type, and where the file exists or cannot be written.
    """
    target = figure_path(path)
    colours = interference_colours(scene, np.linspace(*thickness, ACROSS), np.linspace(*angle, UP), **how)
    srgb, ratios = np.clip(np.asarray(colours.srgb), 0, 1), [4, 1] if inverse is None else [4, 1, 6]
    figure = new_figure(8, 0.8 * sum(ratios))
    swatch, strip, *others = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    swatch.imshow(srgb, origin="lower", aspect="auto", extent=(*thickness, *angle))
    swatch.set(ylabel="angle of incidence (°)")
    swatch.set_title(plain(f"{title}   {how.get('illuminant', 'D65')}".strip()), loc="left")
    strip.imshow(srgb[:1], origin="lower", aspect="auto", extent=(*thickness, 0, 1))
    strip.set(yticks=[], ylabel=f"{angle[0]:g}°")
    if inverse is not None:
        row, order = np.nonzero(inverse.admissible)
        nm = inverse.found.thickness[row, order]
        size = 12 + 24 * np.sqrt(inverse.found.probability[row, order])
        others[0].scatter(inverse.source[row], nm, size, color=inverse.srgb[row], edgecolors="none")
        others[0].set(ylabel=f"thicknesses (nm) of the\ncolour at {angle[0]:g}°", ylim=thickness)
    varied, _ = varied_and_kept(scene, varied_layer(scene, how.get("layer")))
    (others or [strip])[-1].set_xlabel(plain(f"{varied} (nm)"))
    save_figure(figure, target)
    return float(np.mean(outside(np.asarray(colours.linear_srgb))))


COLOURS = 301
"""Thicknesses, equally spaced, whose colours are inverted."""
LEAST = 1e-3
"""Least probability of an order that is listed."""
_HEADER = ["hex", "red", "green", "blue", "thickness_nm", "stderr_nm", "probability", "delta_e"]


@dataclass(frozen=True)
class ChartInverse:
    """Colours of a film and every thickness of each of them."""

    source: np.ndarray  # (colours,), nm: where the colours were taken
    srgb: np.ndarray  # (colours, 3), rounded to 8 bits
    found: ColourThickness

    @property
    def admissible(self) -> np.ndarray:
        """True for orders that are listed, (colours, orders)."""
        return np.nan_to_num(self.found.probability) >= LEAST

    @property
    def ambiguous(self) -> float:
        """Share of the colours with more than one thickness."""
        return float(np.mean(self.admissible.sum(axis=1) > 1))


def invert_chart(
    scene: Scene,
    path: str | os.PathLike[str],
    thickness: tuple[float, float],
    angle: float,
    source: str = "",
    **how: Any,
) -> ChartInverse:
    """Invert the colours of a film at one angle and write them into a CSV file.

    Each row is one thickness of an 8-bit sRGB colour, the most probable first, for noise of 1.5 of 255 and
    the exposure at which a perfect reflector is white. ΔE is CIE 1976.

    **Arguments:** as for `pellicle.reporting.colour_figures.chart`, with one `angle` (degrees) and the name
    of the `source` for the header.

    **Raises:** UsageError where the file exists or cannot be written, and as `colour_table` does.
    """
    low = max(angle - 1.0, 0.0)  # a table needs a range of angles
    table = colour_table(scene, thickness, (low, low + 1.0), **how)
    nm = np.linspace(*table.thickness, COLOURS)
    srgb = np.round(255 * np.asarray(table(nm, np.cos(np.deg2rad(angle))).srgb)) / 255
    inverse = ChartInverse(nm, srgb, ColourInverse.build(table, angle)(srgb, orders=16))
    comments = [
        f"thicknesses of the sRGB colours of {source} at {angle:g} degrees under"
        f" {how.get('illuminant', 'D65')}",
        f"noise {SIGMA:.3g} of each channel, pellicle {version('pellicle')}",
    ]
    rows, written, films = [], set(), inverse.found
    for row, colour in enumerate(np.round(255 * srgb).astype(int).tolist()):
        name = "{:02x}{:02x}{:02x}".format(*colour)
        if name not in written:
            for order in np.flatnonzero(inverse.admissible[row]):
                numbers = (float(x[row, order]) for x in films[:4])
                texts = "{:.1f},{:.1f},{:.4f},{:.2f}".format(*numbers).split(",")
                rows.append([name, *colour, *texts])
        written.add(name)
    write_text(path, csv_rows(_HEADER, rows, comments))
    return inverse
