"""The interference colour chart: a swatch against thickness and angle of incidence."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.appearance import interference_colours
from pellicle.errors import UsageError
from pellicle.report.drawing import blank, saved
from pellicle.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
ACROSS, UP = 600, 61


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
) -> float:
    """Draw a film's colours into `path` and return the share of them that sRGB cannot show.

    `thickness` (nm) and `angle` (degrees) are ranges; the rest is as `appearance.interference_colours`
    takes it. The file appears whole or not at all. Raises UsageError for another file type.
    """
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise UsageError(f"--out {target}: expected a name ending in {', '.join(FORMATS)}")
    nm, degrees = np.linspace(*thickness, ACROSS), np.linspace(*angle, UP)
    colours = interference_colours(scene, nm, degrees, layer, observer=observer, illuminant=illuminant)
    linear = np.asarray(colours.linear_srgb)
    shown = np.clip(np.asarray(colours.srgb), 0, 1)
    saved(_draw(shown, thickness, angle, f"{title}   {illuminant}"), target)
    return float(np.mean(np.any((linear < -1e-3) | (linear > 1 + 1e-3), axis=-1)))


def _draw(srgb: np.ndarray, thickness: tuple[float, float], angle: tuple[float, float], title: str) -> Figure:
    """The swatch over all angles, and under it a strip of the first one alone."""

    drawn = blank(8, 4)
    swatch, strip = drawn.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [4, 1]})
    swatch.imshow(srgb, origin="lower", aspect="auto", extent=(*thickness, *angle))
    swatch.set(ylabel="angle of incidence (°)")
    swatch.set_title(title.strip(), loc="left")
    strip.imshow(srgb[:1], origin="lower", aspect="auto", extent=(*thickness, 0, 1))
    strip.set(xlabel="thickness (nm)", yticks=[], ylabel=f"{angle[0]:g}°")
    return drawn
