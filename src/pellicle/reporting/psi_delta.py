"""Panels of an ellipsometric fit: Ψ, Δ, their residuals and depolarisation against wavelength or angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pellicle.reporting.drawing import ABOVE, BLACK, BLUE, GREY
from pellicle.reporting.measured_lines import abscissa, data_and_fit, lines_of, unbroken

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pellicle.fitting.result import Part


def psi(axes: Axes, part: Part) -> None:
    """Draw Ψ of data and model, one line for each angle and azimuth."""
    data_and_fit(axes, part.spectrum, part.spectral.data, part.spectral.model)
    axes.set_ylabel("Ψ (degrees)")
    axes.legend(frameon=False, markerscale=3, ncols=2, fontsize="small")


def delta(axes: Axes, part: Part) -> None:
    """Draw Δ of data and model, one line for each angle and azimuth, interrupted where Δ passes
    360 degrees."""
    curve = part.spectral
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    data_and_fit(axes, part.spectrum, curve.delta_data, curve.delta_model, turns=True)
    axes.set_ylabel("Δ (degrees)")


def depolarisation(axes: Axes, part: Part) -> None:
    """Draw the depolarisation of data and model, one line for each angle and azimuth."""
    curve = part.spectral
    assert curve.depolarisation_data is not None
    assert curve.depolarisation_model is not None
    data_and_fit(axes, part.spectrum, curve.depolarisation_data, curve.depolarisation_model)
    axes.set_ylabel("depolarisation")


def residuals(axes: Axes, part: Part) -> None:
    """Draw data − model in degrees: Ψ solid, Δ dashed."""
    x, label = abscissa(part.spectrum)
    of_psi: dict[str, Any] = {"color": BLACK, "linewidth": 0.9, "marker": ".", "markersize": 2}
    of_delta: dict[str, Any] = of_psi | {"color": BLUE, "linestyle": "--"}
    for i, (line, _) in enumerate(lines_of(part.spectrum)):
        for points in unbroken(x, line):
            hidden = "_" if i or points[0] != line[0] else ""
            axes.plot(x[points], part.spectral.residual[points], **of_psi, label=hidden or "Ψ")
            axes.plot(x[points], part.spectral.delta_residual[points], **of_delta, label=hidden or "Δ")
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel=label, ylabel="data − fit (degrees)")
    axes.legend(**ABOVE, ncols=2, fontsize="small")
