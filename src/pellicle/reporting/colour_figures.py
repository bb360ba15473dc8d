"""Interference colour chart of a film, and picture of a surface with its BRDF."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import srgb
from pellicle.errors import UsageError
from pellicle.reporting.drawing import figure_path, new_figure, save_figure
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface
from pellicle.synthetic.colours import interference_colours
from pellicle.synthetic.sphere import in_plane, render

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pellicle.reporting.colour_inverse import ChartInverse

ACROSS, UP = 600, 61
"""Pixels of the chart: thicknesses, angles."""
INCIDENCES = (15.0, 45.0, 70.0)
LEAVING = np.linspace(-88.0, 88.0, 353)
"""Angles (degrees) of the polar plots: of the light, and to the eye."""
BACKGROUND = 0.12
WHITE_PERCENTILE = 99.0
"""Percentile of the radiance that is shown as white: a lobe has no upper end."""
_CHANNELS = ("#c03030", "#2f8f2f", "#3050c0")


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
    those of `pellicle.synthetic.colours.interference_colours`. `inverse` adds a panel with every thickness
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
    return float(np.mean(np.any((linear < -1e-3) | (linear > 1 + 1e-3), axis=-1)))


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


def sphere(
    surface: Surface, path: str | os.PathLike[str], light: tuple[float, float], title: str = ""
) -> None:
    """Draw a sphere of the surface and polar plots of its BRDF into `path` (.png, .pdf or .svg).

    `light` is the polar angle of the light from the line of sight and its azimuth, in degrees. Raises
    UsageError for a surface without red, green and blue, for another file type, and where the file exists or
    cannot be written.
    """
    target = figure_path(path)
    if surface.channels != 3:
        raise UsageError(f"a picture needs three wavelengths, red, green and blue, not {surface.channels}")
    with jax.enable_x64(True):
        radiance = render(surface, light)
        lobes = {angle: in_plane(surface, angle, LEAVING) for angle in INCIDENCES}
    save_figure(_draw_sphere(shown(radiance), lobes, title), target)


def shown(radiance: np.ndarray) -> np.ndarray:
    """Convert linear RGB (height, width, 3) to sRGB with one exposure; NaN is the background."""
    lit = radiance[np.isfinite(radiance) & (radiance > 0)]
    white = np.percentile(lit, WHITE_PERCENTILE) if lit.size else 1.0
    linear = np.clip(radiance / max(white, 1.0), 0, 1)
    return np.nan_to_num(np.asarray(srgb(jnp.asarray(linear))), nan=BACKGROUND)


def _draw_sphere(image: np.ndarray, lobes: dict[float, np.ndarray], title: str) -> Figure:
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(10, 6)
    grid = figure.add_gridspec(len(lobes), 2, width_ratios=[2, 1])
    ball = figure.add_subplot(grid[:, 0])
    ball.imshow(image)
    ball.set_axis_off()
    ball.set_title(title, loc="left")
    for row, (angle, values) in enumerate(lobes.items()):
        axes = figure.add_subplot(grid[row, 1], projection="polar")
        for channel, colour in enumerate(_CHANNELS):
            axes.plot(np.deg2rad(LEAVING), values[:, channel], color=colour, linewidth=1.2)
        axes.axvline(np.deg2rad(-angle), color="#777777", linestyle=":", linewidth=1.0)
        axes.set(theta_zero_location="N", theta_direction=-1, thetamin=-90, thetamax=90)
        axes.tick_params(labelsize="x-small")
        axes.yaxis.set_major_locator(MaxNLocator(2))
        axes.set_title(f"light at {angle:g}°, BRDF in 1/sr", fontsize="small")
    return figure
