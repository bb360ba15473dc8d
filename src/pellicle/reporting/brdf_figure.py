"""The figure of a fit of a BRDF: samples and model against the half angle, and what is left between them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.data.half_angles import vectors
from pellicle.fitting.result import Fit
from pellicle.reporting.drawing import BLACK, BLUE, GREEN, GREY, ORANGE, blank, marker_size, saved

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 120
_COLOURS = {"R": ORANGE, "G": GREEN, "B": BLUE}


def brdf_figure(fit: Fit, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Draw a fit into `path` (.png, .pdf or .svg), which is returned.

    The file appears complete or not at all. Raises UsageError where it exists, without `overwrite`,
    or cannot be written.
    """
    return saved(draw(fit), path, overwrite=overwrite, dpi=DPI)


def draw(fit: Fit) -> Figure:
    """The figure itself, bound to no window and to no global state."""
    drawn = blank(8.0, 5.6)
    above, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 1.3))
    _samples(above, fit)
    _left(below, fit)
    drawn.suptitle(f"{fit.surface.model}: {fit.status}", fontsize="medium", x=0.01, ha="left")
    return drawn


def half_angle(fit: Fit) -> np.ndarray:
    """Between the normal and the bisector of light and eye, in degrees, (samples,)."""
    at = {name: np.deg2rad(getattr(fit.samples, name)) for name in ("theta_i", "phi_i", "theta_o", "phi_o")}
    half = vectors(at["theta_i"], at["phi_i"]) + vectors(at["theta_o"], at["phi_o"])
    return np.rad2deg(np.arctan2(np.hypot(half[0], half[1]), half[2]))


def _samples(axes: Axes, fit: Fit) -> None:
    """Where nothing is below zero the axis is logarithmic: a lobe spans decades."""
    angle, size = half_angle(fit), marker_size(len(fit.samples))
    for i, name in enumerate(fit.samples.channels):
        axes.plot(angle, fit.samples.values[:, i], "o", color=BLACK, markersize=size, markerfacecolor="none")
        colour = _COLOURS.get(name, ORANGE)
        axes.plot(angle, fit.model[:, i], ".", color=colour, markersize=size, label=f"{name}: model")
    axes.plot([], [], "o", color=BLACK, markerfacecolor="none", markersize=size, label="samples")
    axes.set_yscale("log" if min(fit.samples.values.min(), fit.model.min()) > 0 else "linear")
    axes.set_ylabel("BRDF (1/sr)")
    axes.legend(fontsize="small")


def _left(axes: Axes, fit: Fit) -> None:
    """Samples less model, in σ where that is known."""
    sigma = fit.samples.sigma
    left = (fit.samples.values - fit.model) / (1.0 if sigma is None else sigma)
    for i, name in enumerate(fit.samples.channels):
        colour = _COLOURS.get(name, ORANGE)
        axes.plot(half_angle(fit), left[:, i], ".", color=colour, markersize=marker_size(len(fit.samples)))
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylabel("residual (1/sr)" if sigma is None else "residual / σ")
    axes.set_xlabel("half angle (degrees)")
