"""The panels of an ellipsometric fit: Ψ, Δ and their residuals against wavelength or angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.result import Fit
from pellicle.reporting.drawing import BLACK, BLUE, FITTED, GAP, GREEN, GREY, ORANGE, marker_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_NAMED = 8
"""Lines of one angle each that can be told apart by a label."""
_COLOURS = (ORANGE, BLUE, GREEN, BLACK)
_DASHES = ("-", "--")


def psi(axes: Axes, fit: Fit) -> None:
    """Ψ of data and model, one line for each angle."""
    _pair(axes, fit, fit.curve.data, fit.curve.model)
    axes.set_ylabel("Ψ (degrees)")
    axes.legend(frameon=False, markerscale=3, ncols=2, fontsize="small")


def delta(axes: Axes, fit: Fit) -> None:
    """Δ of data and model, one line for each angle, broken where it passes 360 degrees."""
    curve = fit.curve
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    _pair(axes, fit, curve.delta_data, curve.delta_model, turns=True)
    axes.set_ylabel("Δ (degrees)")


def residuals(axes: Axes, fit: Fit) -> None:
    """Data less model: Ψ solid, Δ dashed, both in degrees."""
    x, label = abscissa(fit)
    of_psi: dict[str, Any] = {"color": BLACK, "linewidth": 0.9, "marker": ".", "markersize": 2}
    of_delta: dict[str, Any] = of_psi | {"color": BLUE, "linestyle": "--"}
    for i, (line, _) in enumerate(_lines(fit)):
        for part in _unbroken(x, fit.curve.residual, line, turns=False):
            hidden = "_" if i or part[0] != line[0] else ""
            axes.plot(x[part], fit.curve.residual[part], **of_psi, label=hidden or "Ψ")
            axes.plot(x[part], fit.curve.delta_residual[part], **of_delta, label=hidden or "Δ")
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel=label, ylabel="data − fit (degrees)")
    axes.legend(frameon=False, ncols=2, fontsize="small")


def abscissa(fit: Fit) -> tuple[np.ndarray, str]:
    """What is drawn against, with its label: the angle of incidence where there is but one wavelength."""
    if _sweeps_angle(fit):
        return np.asarray(fit.spectrum.angle), "angle of incidence (degrees)"
    return fit.curve.wavelength, "wavelength (nm)"


def _sweeps_angle(fit: Fit) -> bool:
    angle = fit.spectrum.angle
    return np.unique(fit.curve.wavelength).size == 1 and angle is not None and np.unique(angle).size > 1


def _lines(fit: Fit) -> list[tuple[np.ndarray, float | None]]:
    """The points of each line in rising order, with its angle; None if there is nothing to tell apart."""
    x, _ = abscissa(fit)
    angle = fit.spectrum.angle
    if angle is None or _sweeps_angle(fit) or np.unique(angle).size == 1:
        return [(np.argsort(x, kind="stable"), None)]
    groups = [(np.flatnonzero(angle == value), float(value)) for value in np.unique(angle)]
    return [(points[np.argsort(x[points], kind="stable")], value) for points, value in groups]


def _pair(axes: Axes, fit: Fit, data: np.ndarray, model: np.ndarray, turns: bool = False) -> None:
    x, _ = abscissa(fit)
    axes.plot(x, data, ".", color=GREY, markersize=marker_size(x.size), label="data")
    lines = _lines(fit)
    for i, (points, angle) in enumerate(lines):
        color, style = _COLOURS[i % len(_COLOURS)], _DASHES[i // len(_COLOURS) % len(_DASHES)]
        name = "fit" if angle is None else f"fit, {angle:g}°"
        for j, part in enumerate(_unbroken(x, model, points, turns)):
            label = "_" if j or len(lines) > MOST_NAMED else name
            axes.plot(x[part], model[part], **{**FITTED, "color": color}, linestyle=style, label=label)
    axes.tick_params(labelbottom=False)
    axes.margins(x=0.01)


def _unbroken(x: np.ndarray, y: np.ndarray, points: np.ndarray, turns: bool) -> list[np.ndarray]:
    """The points that one stroke joins: without a wide gap or, in Δ, a step over 0 or 360 degrees."""
    steps = np.diff(x[points])
    broken = steps > GAP * np.median(steps) if steps.size else np.zeros(0, dtype=bool)
    if turns:
        broken = broken | (np.abs(np.diff(y[points])) > 180.0)
    return np.split(points, np.flatnonzero(broken) + 1)
