"""Figure of a BRDF fit: samples and model against the half angle, and their residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pellicle.data.half_angles import vectors
from pellicle.reporting.drawing import BLACK, BLUE, GREEN, GREY, ORANGE, marker_size, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.fitting.result import Fit, Part

_COLOURS = {"R": ORANGE, "G": GREEN, "B": BLUE}


def draw(fit: Fit) -> Figure:
    """Draw samples and model above their residuals, for each set of samples."""
    count = len(fit.parts)
    figure = new_figure(8.0, 5.6 * count)
    panels = figure.subplots(2 * count, 1, sharex=True, height_ratios=(3, 1.3) * count)
    for part, above, below in zip(fit.parts, panels[::2], panels[1::2], strict=True):
        draw_samples(above, part)
        draw_residuals(below, part)
        if fit.joint:
            above.set_title(part.name.replace("$", r"\$"), fontsize="small", loc="left")
    figure.suptitle(f"{fit.surface.model}: {fit.status}", fontsize="medium", x=0.01, ha="left")
    return figure


def half_angle(samples: BrdfSamples) -> np.ndarray:
    """Angle between the normal and the bisector of light and eye, in degrees, shape (samples,)."""
    theta_i, phi_i, theta_o, phi_o = (
        np.deg2rad(angle) for angle in (samples.theta_i, samples.phi_i, samples.theta_o, samples.phi_o)
    )
    half = vectors(theta_i, phi_i) + vectors(theta_o, phi_o)
    return np.rad2deg(np.arctan2(np.hypot(half[0], half[1]), half[2]))


def draw_samples(axes: Axes, part: Part) -> None:
    """Draw samples and model, on a logarithmic axis if all are positive: a lobe spans decades."""
    samples, model = part.samples, part.curve.model
    angle, size = half_angle(samples), marker_size(len(samples))
    for i, name in enumerate(samples.channels):
        axes.plot(angle, samples.values[:, i], "o", color=BLACK, markersize=size, markerfacecolor="none")
        colour = _COLOURS.get(name, ORANGE)
        axes.plot(angle, model[:, i], ".", color=colour, markersize=size, label=f"{name}: model")
    axes.plot([], [], "o", color=BLACK, markerfacecolor="none", markersize=size, label="samples")
    axes.set_yscale("log" if min(samples.values.min(), model.min()) > 0 else "linear")
    axes.set_ylabel("BRDF (1/sr)")
    axes.legend(fontsize="small")


def draw_residuals(axes: Axes, part: Part) -> None:
    """Draw samples − model, in σ where that is known."""
    samples, sigma = part.samples, part.samples.sigma
    residuals = (samples.values - part.curve.model) / (1.0 if sigma is None else sigma)
    for i, name in enumerate(samples.channels):
        colour = _COLOURS.get(name, ORANGE)
        axes.plot(
            half_angle(samples), residuals[:, i], ".", color=colour, markersize=marker_size(len(samples))
        )
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylabel("residual (1/sr)" if sigma is None else "residual / σ")
    axes.set_xlabel("half angle (degrees)")
