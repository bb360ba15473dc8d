"""Panels of generalised Ψ and Δ: Ψ above Δ, a column for each ratio, of a fit or of a measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.drawing import ABOVE, BLACK, BLUE, FITTED, GREEN, GREY, ORANGE, marker_size
from pellicle.reporting.measured_lines import abscissa, lines_of, unbroken

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pellicle.data.spectrum import Spectrum
    from pellicle.fitting.result import Part

NAMES = {"ane": "AnE", "aps": "Aps", "asp": "Asp"}
"""Ratios as Woollam's programs write them."""
FORMULAS = {"ane": "$r_{pp}/r_{ss}$", "aps": "$r_{ps}/r_{pp}$", "asp": "$r_{sp}/r_{ss}$"}
_COLOURS = (ORANGE, BLUE, GREEN, BLACK)
_GAPS = (0.07, 0.07)
"""Gaps between panels, as shares of the width and the height of all."""
MOST_NAMED = 8
"""Most lines, one for each angle and azimuth, that get a label."""
SMALLEST = 0.5
"""Least height of a panel in degrees: a ratio of 0 shows its noise, without magnifying it."""


def ratios(axes: Axes, part: Part) -> None:
    """Draw Ψ and Δ of data and model of each ratio; residuals have a panel of their own (`residuals`)."""
    curve, spectrum = part.spectral, part.spectrum
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    x, label = abscissa(spectrum)
    lines = lines_of(spectrum)
    for (i, turns), cell in _grid(axes, spectrum).items():
        data, model = (curve.delta_data, curve.delta_model) if turns else (curve.data, curve.model)
        own, fitted = data[:, i], model[:, i]
        cell.plot(x, own, ".", color=GREY, markersize=0.7 * marker_size(x.size), label="data")
        for j, (points, name) in enumerate(lines):
            style = {**FITTED, "color": _COLOURS[j % len(_COLOURS)], "linewidth": 0.9}
            for k, stroke in enumerate(unbroken(x, points, fitted if turns else None)):
                shown = "_" if k or len(lines) > MOST_NAMED else "fit" if name is None else f"fit, {name}"
                cell.plot(x[stroke], fitted[stroke], **style, label=shown)
        _finish(cell, np.concatenate([own, fitted]), turns)
    axes.set_xlabel(label, labelpad=16)
    _legend(axes)


def weighted_delta(part: Part) -> np.ndarray:
    """Residuals of Δ times ½ sin 2Ψ, (points, ratios): what they are on the sphere, in degrees of Ψ.

    Where a ratio is nearly 0, its Δ is noise alone.
    """
    return 0.5 * np.sin(2 * np.deg2rad(part.spectral.model)) * part.spectral.delta_residual


def residuals(axes: Axes, part: Part) -> None:
    """Draw data − model of all ratios in one panel: Ψ solid, Δ times ½ sin 2Ψ dashed."""
    curve, spectrum = part.spectral, part.spectrum
    x, label = abscissa(spectrum)
    for i, ratio in enumerate(spectrum.ratios):
        for sign, residual, dash in (("Ψ", curve.residual, "-"), ("½ sin 2Ψ Δ", weighted_delta(part), "--")):
            style: dict[str, Any] = {"linewidth": 0.7, "color": _COLOURS[i], "linestyle": dash}
            for j, (points, _) in enumerate(lines_of(spectrum)):
                for k, stroke in enumerate(unbroken(x, points)):
                    name = "_" if j or k else f"{sign} {NAMES[ratio]}"
                    axes.plot(x[stroke], residual[stroke, i], **style, label=name)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel=label, ylabel="data − fit (degrees)")
    axes.legend(**{**ABOVE, "ncols": 6}, fontsize="x-small")
    axes.margins(x=0.01)


def draw_measured(axes: Axes, spectrum: Spectrum) -> None:
    """Draw measured Ψ and Δ of each ratio, with ± σ."""
    assert spectrum.delta is not None
    x, label = abscissa(spectrum)
    for (i, turns), cell in _grid(axes, spectrum).items():
        own = (spectrum.delta if turns else spectrum.values)[:, i]
        sigma = spectrum.delta_sigma if turns else spectrum.sigma
        for j, (points, name) in enumerate(lines_of(spectrum)):
            colour = _COLOURS[j % len(_COLOURS)]
            for k, stroke in enumerate(unbroken(x, points, own if turns else None)):
                style: dict[str, Any] = {"color": colour, "markersize": 1.5, "linewidth": 0.6}
                cell.plot(x[stroke], own[stroke], ".-", **style, label="_" if k else name)
                if sigma is not None:
                    band = own[stroke] - sigma[stroke, i], own[stroke] + sigma[stroke, i]
                    cell.fill_between(x[stroke], *band, color=colour, alpha=0.2, linewidth=0)
        _finish(cell, own, turns)
    axes.set_xlabel(label, labelpad=16)
    if any(name is not None for _, name in lines_of(spectrum)[:MOST_NAMED]):
        _legend(axes)


def _legend(axes: Axes) -> None:
    """Lines of the first panel, above the titles of all."""
    first: Any = axes.child_axes[0]
    handles = first.get_legend_handles_labels()
    place = {"loc": "lower right", "bbox_to_anchor": (1, 1.05), "borderaxespad": 0, "ncols": 5}
    axes.legend(*handles, frameon=False, fontsize="small", **place)


def _grid(axes: Axes, spectrum: Spectrum) -> dict[tuple[int, bool], Axes]:
    """A panel for Ψ and one for Δ below it of each ratio, within one that keeps its labels only."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    count = len(spectrum.ratios)
    width, height = (1 - (count - 1) * _GAPS[0]) / count, (1 - _GAPS[1]) / 2
    cells = {}
    for i, ratio in enumerate(spectrum.ratios):
        for turns in (False, True):
            low = i * (width + _GAPS[0]), 0.0 if turns else height + _GAPS[1]
            cell = cells[i, turns] = axes.inset_axes((*low, width, height))
            cell.tick_params(labelsize="x-small", labelbottom=turns)
            if not turns:
                cell.set_title(f"{NAMES[ratio]} = {FORMULAS[ratio]}", fontsize="small", loc="left", pad=3)
            if not i:
                cell.set_ylabel("Δ (degrees)" if turns else "Ψ (degrees)")
    return cells


def _finish(cell: Axes, shown: np.ndarray, turns: bool) -> None:
    low, high = float(np.min(shown)), float(np.max(shown))
    room = 0.54 * max(high - low, SMALLEST)
    bottom = (low + high) / 2 - room
    cell.set_ylim(bottom if turns else max(bottom, -0.04 * (high + SMALLEST)), (low + high) / 2 + room)
    cell.margins(x=0.02)
