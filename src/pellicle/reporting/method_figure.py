"""Figure of one film's colours by several methods, side by side, with error and time of each."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from pellicle.accuracy.colour_methods import EYE
from pellicle.accuracy.film_colours import EXACT, ColourMap, colour_maps
from pellicle.colour import linear_srgb, sensor
from pellicle.reporting.matplotlib_figure import figure_path, new_figure, save_figure
from pellicle.reporting.rendering_display import display
from pellicle.reporting.sphere_figures import DARK, DPI
from pellicle.scene.film import Scene
from pellicle.simulation.sphere import Sphere, sphere

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILMS, ANGLES = 160, 80
"""Thicknesses and angles at which colours are computed; pixels are interpolated between them."""
STEEPEST = 80.0
"""Largest angle of incidence: beyond it, at 1.5 % of the radius from the limb, colours stay the same."""
WHITE_PERCENTILE = 92.0
"""Percentile of the luminance that is shown as white: at the limb any film reflects more than elsewhere."""
LARGEST = 10.0
"""ΔE2000 at the end of the scale; two colours that differ so are different at a glance."""


def draw_methods(
    scene: Scene,
    path: str | os.PathLike[str],
    thickness: tuple[float, float],
    title: str = "",
    *,
    size: int = 240,
) -> list[ColourMap]:
    """Draw balls under a film by each method, and the ΔE2000 of each pixel, into `path`.

    The ball stands in surroundings of one radiance, so that it shows the colours of the film alone. Its
    thickness falls from the bottom to the top over the range `thickness` (nm).

    **Returns:** the colours by each method, with error and time.

    **Raises:** UsageError as `colour_maps` does, for another file type, and where the file exists.
    """
    target = figure_path(path)
    nm, degrees = np.linspace(*thickness, FILMS), np.linspace(0.0, STEEPEST, ANGLES)
    maps = colour_maps(scene, nm, degrees)
    factor = float(f"{1 / np.percentile(maps[0].xyz[..., 1], WHITE_PERCENTILE):.2g}")
    save_figure(_draw(maps, factor, thickness, title, sphere(size)), target, dpi=DPI)
    return maps


def _draw(
    maps: list[ColourMap], factor: float, thickness: tuple[float, float], title: str, pixels: Sphere
) -> Figure:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    white, scale = sensor(*EYE).white, Normalize(0.0, LARGEST)
    figure = new_figure(1.0 + 1.9 * len(maps), 5.1)
    panels = figure.subplots(2, len(maps), squeeze=False)
    for above, below, found in zip(*panels, maps, strict=True):
        linear = np.asarray(linear_srgb(found.xyz, white))
        above.imshow(
            display(pixels.rendering(_over(pixels, linear)), factor, DARK), interpolation="antialiased"
        )
        above.set_title(f"{found.name}\n{_time(found.seconds)} a colour", fontsize="small")
        error = np.full(pixels.mask.shape, np.nan)
        error[pixels.mask] = np.where(
            pixels.share > 0.5, _over(pixels, found.delta_e[..., None])[:, 0], np.nan
        )
        below.imshow(error, norm=scale, cmap="magma_r", interpolation="nearest")
        mean, largest = (_size(size) for size in (np.mean(found.delta_e), np.max(found.delta_e)))
        words = "the reference" if found.name == EXACT else f"mean {mean}, largest {largest}"
        below.set_title(words, fontsize="small")
    for axes in panels.flat:
        axes.set(xticks=[], yticks=[])
        axes.set_frame_on(False)
    mappable = ScalarMappable(norm=scale, cmap="magma_r")
    figure.colorbar(mappable, ax=panels[1], label="ΔE2000", shrink=0.85, pad=0.01, extend="max")
    figure.suptitle(title.replace("$", r"\$"), x=0.01, ha="left", fontsize="medium")
    note = (
        f"D65, surroundings of one radiance; exposure × {factor:g}; {thickness[0]:g} nm at the top to"
        f" {thickness[1]:g} nm at the bottom; 0° in the middle to {STEEPEST:g}° at the limb"
    )
    figure.supxlabel(note, x=0.01, ha="left", fontsize="x-small")
    return figure


def _size(delta_e: float) -> str:
    return f"{delta_e:.2g}" if delta_e >= 1e-3 else "below 0.001"


def _time(seconds: float) -> str:
    return f"{seconds * 1e9:.0f} ns" if seconds < 1e-6 else f"{seconds * 1e6:.1f} µs"


def _over(pixels: Sphere, values: np.ndarray) -> np.ndarray:
    """Values (thicknesses, angles, channels) at the pixels of a sphere, by bilinear interpolation."""
    from scipy.ndimage import map_coordinates  # slow to import

    row = (1 - pixels.normal[:, 1]) / 2 * (values.shape[0] - 1)
    column = np.rad2deg(np.arccos(pixels.cosine)) / STEEPEST * (values.shape[1] - 1)
    at = np.stack([row, np.minimum(column, values.shape[1] - 1)])
    return np.stack([map_coordinates(each, at, order=1) for each in np.moveaxis(values, -1, 0)], axis=-1)
