"""A picture of a surface: a sphere under a directional light, and polar plots of its BRDF."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import srgb
from pellicle.errors import UsageError
from pellicle.report.charts import FORMATS
from pellicle.report.drawing import blank, saved
from pellicle.sphere import in_plane, render
from pellicle.surfaces.surface import Surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INCIDENCES = (15.0, 45.0, 70.0)
LEAVING = np.linspace(-88.0, 88.0, 353)
BACKGROUND = 0.12
EXPOSED = 99.0
"""Percentile of the lit radiance that is shown as white: a lobe has no upper end."""
_CHANNELS = ("#c03030", "#2f8f2f", "#3050c0")


def sphere(
    surface: Surface, path: str | os.PathLike[str], light: tuple[float, float], title: str = ""
) -> None:
    """Draw the surface into `path`; `light` is its polar angle from the line of sight and its azimuth.

    Raises UsageError for a surface that has no three channels to show, and for another file type.
    """
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise UsageError(f"--out {target}: expected a name ending in {', '.join(FORMATS)}")
    if surface.channels != 3:
        raise UsageError(f"a picture needs three wavelengths, red, green and blue, not {surface.channels}")
    with jax.enable_x64(True):
        seen = render(surface, light)
        lobes = {angle: in_plane(surface, angle, LEAVING) for angle in INCIDENCES}
    saved(_draw(shown(seen), lobes, title), target)


def shown(radiance: np.ndarray) -> np.ndarray:
    """sRGB of linear RGB (height, width, 3) by one exposure; what is NaN is the background."""
    lit = radiance[np.isfinite(radiance) & (radiance > 0)]
    white = np.percentile(lit, EXPOSED) if lit.size else 1.0
    linear = np.clip(radiance / max(white, 1.0), 0, 1)
    return np.nan_to_num(np.asarray(srgb(jnp.asarray(linear))), nan=BACKGROUND)


def _draw(image: np.ndarray, lobes: dict[float, np.ndarray], title: str) -> Figure:
    from matplotlib.ticker import MaxNLocator

    drawn = blank(10, 6)
    grid = drawn.add_gridspec(len(lobes), 2, width_ratios=[2, 1])
    ball = drawn.add_subplot(grid[:, 0])
    ball.imshow(image)
    ball.set_axis_off()
    ball.set_title(title, loc="left")
    for row, (angle, values) in enumerate(lobes.items()):
        axes = drawn.add_subplot(grid[row, 1], projection="polar")
        for channel, colour in enumerate(_CHANNELS):
            axes.plot(np.deg2rad(LEAVING), values[:, channel], color=colour, linewidth=1.2)
        axes.axvline(np.deg2rad(-angle), color="#777777", linestyle=":", linewidth=1.0)
        axes.set(theta_zero_location="N", theta_direction=-1, thetamin=-90, thetamax=90)
        axes.tick_params(labelsize="x-small")
        axes.yaxis.set_major_locator(MaxNLocator(2))
        axes.set_title(f"light at {angle:g}°, BRDF in 1/sr", fontsize="small")
    return drawn
