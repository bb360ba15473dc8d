"""Panels of an ellipsometric fit: Ψ, Δ, their residuals and depolarisation against wavelength or angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.drawing import ABOVE, BLACK, BLUE, FITTED, GAP, GREEN, GREY, ORANGE, marker_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pellicle.fitting.result import Part

MOST_NAMED = 8
"""Most lines, one for each angle, that get a label."""
_COLOURS = (ORANGE, BLUE, GREEN, BLACK)
_DASHES = ("-", "--")


def psi(axes: Axes, part: Part) -> None:
    """Draw Ψ of data and model, one line for each angle."""
    _pair(axes, part, part.spectral.data, part.spectral.model)
    axes.set_ylabel("Ψ (degrees)")
    axes.legend(frameon=False, markerscale=3, ncols=2, fontsize="small")


def delta(axes: Axes, part: Part) -> None:
    """Draw Δ of data and model, one line for each angle, interrupted where Δ passes 360 degrees."""
    curve = part.spectral
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    _pair(axes, part, curve.delta_data, curve.delta_model, turns=True)
    axes.set_ylabel("Δ (degrees)")


def depolarisation(axes: Axes, part: Part) -> None:
    """Draw the depolarisation of data and model, one line for each angle."""
    curve = part.spectral
    assert curve.depolarisation_data is not None
    assert curve.depolarisation_model is not None
    _pair(axes, part, curve.depolarisation_data, curve.depolarisation_model)
    axes.set_ylabel("depolarisation")


def residuals(axes: Axes, part: Part) -> None:
    """Draw data − model in degrees: Ψ solid, Δ dashed."""
    x, label = abscissa(part)
    of_psi: dict[str, Any] = {"color": BLACK, "linewidth": 0.9, "marker": ".", "markersize": 2}
    of_delta: dict[str, Any] = of_psi | {"color": BLUE, "linestyle": "--"}
    for i, (line, _) in enumerate(lines_of(part)):
        for points in unbroken(x, part.spectral.residual, line, turns=False):
            hidden = "_" if i or points[0] != line[0] else ""
            axes.plot(x[points], part.spectral.residual[points], **of_psi, label=hidden or "Ψ")
            axes.plot(x[points], part.spectral.delta_residual[points], **of_delta, label=hidden or "Δ")
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel=label, ylabel="data − fit (degrees)")
    axes.legend(**ABOVE, ncols=2, fontsize="small")


def abscissa(part: Part) -> tuple[np.ndarray, str]:
    """The x axis and its label: wavelength, or the angle of incidence if there is one wavelength only."""
    if _sweeps_angle(part):
        return np.asarray(part.spectrum.angle), "angle of incidence (degrees)"
    return part.spectral.wavelength, "wavelength (nm)"


def _sweeps_angle(part: Part) -> bool:
    angle = part.spectrum.angle
    return np.unique(part.spectral.wavelength).size == 1 and angle is not None and np.unique(angle).size > 1


def lines_of(part: Part) -> list[tuple[np.ndarray, float | None]]:
    """Indices of the points of each line in rising order, and its angle, None if there is one line."""
    x, _ = abscissa(part)
    angle = part.spectrum.angle
    if angle is None or _sweeps_angle(part) or np.unique(angle).size == 1:
        return [(np.argsort(x, kind="stable"), None)]
    groups = [(np.flatnonzero(angle == value), float(value)) for value in np.unique(angle)]
    return [(points[np.argsort(x[points], kind="stable")], value) for points, value in groups]


def _pair(axes: Axes, part: Part, data: np.ndarray, model: np.ndarray, turns: bool = False) -> None:
    x, _ = abscissa(part)
    axes.plot(x, data, ".", color=GREY, markersize=marker_size(x.size), label="data")
    lines = lines_of(part)
    for i, (points, angle) in enumerate(lines):
        color, style = _COLOURS[i % len(_COLOURS)], _DASHES[i // len(_COLOURS) % len(_DASHES)]
        name = "fit" if angle is None else f"fit, {angle:g}°"
        for j, stroke in enumerate(unbroken(x, model, points, turns)):
            label = "_" if j or len(lines) > MOST_NAMED else name
            axes.plot(x[stroke], model[stroke], **{**FITTED, "color": color}, linestyle=style, label=label)
    axes.tick_params(labelbottom=False)
    axes.margins(x=0.01)


def unbroken(x: np.ndarray, y: np.ndarray, points: np.ndarray, turns: bool) -> list[np.ndarray]:
    """Indices of the points of each stroke, split at wide gaps and, in Δ, where it passes 360 degrees."""
    steps = np.diff(x[points])
    broken = steps > GAP * np.median(steps) if steps.size else np.zeros(0, dtype=bool)
    if turns:
        broken = broken | (np.abs(np.diff(y[points])) > 180.0)
    return np.split(points, np.flatnonzero(broken) + 1)
