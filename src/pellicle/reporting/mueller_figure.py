"""Panels of a Mueller matrix, 4 × 4: elements of a fit or of a measurement against wavelength or angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.drawing import ABOVE, BLACK, BLUE, FITTED, GREEN, GREY, ORANGE, marker_size
from pellicle.reporting.measured_lines import abscissa, lines_of, unbroken

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pellicle.fitting.result import Part

_COLOURS = (ORANGE, BLUE, GREEN, BLACK)
MOST_NAMED = 6
"""Most angles and azimuths that the first panel lists."""
_GAPS = (0.06, 0.055)
"""Gaps between panels, as shares of the width and the height of the matrix."""
_MARGIN = 0.08
SMALLEST = 0.02
"""Least height of a panel: an element of 0 shows its noise, without magnifying it."""


def matrix(axes: Axes, part: Part) -> None:
    """Draw data and model of each measured element at its place of the matrix, those in a row side by side.

    The first panel lists angles and azimuths; residuals have panels of their own below (`residuals`).
    """
    curve = part.spectral
    x, label = abscissa(part.spectrum)
    lines = lines_of(part.spectrum)
    cells = _grid(axes)
    _list_settings(cells[0], [name for _, name in lines])
    for place, cell in cells.items():
        name = f"m{place // 4 + 1}{place % 4 + 1}"
        if name not in part.spectrum.elements:
            if place:
                _unmeasured(cell, name)
            continue
        column = part.spectrum.elements.index(name)
        data, model = curve.data[:, column], curve.model[:, column]
        cell.plot(x, data, ".", color=GREY, markersize=0.6 * marker_size(x.size))
        for i, (points, _) in enumerate(lines):
            for stroke in unbroken(x, points):
                color = _COLOURS[i % len(_COLOURS)]
                cell.plot(x[stroke], model[stroke], **{**FITTED, "color": color, "linewidth": 0.9})
        _finish(cell, name, part.spectrum.elements, np.concatenate([data, model]))
    axes.set_xlabel(label, labelpad=16)
    axes.set_ylabel("normalised element", labelpad=30)


def residuals(axes: Axes, part: Part) -> None:
    """Draw data − model of all elements in one panel, the first ten solid and the others dashed."""
    curve = part.spectral
    x, label = abscissa(part.spectrum)
    lines = lines_of(part.spectrum)
    for column, name in enumerate(part.spectrum.elements):
        style: dict[str, Any] = {"linewidth": 0.7, "color": f"C{column % 10}"}
        style["linestyle"] = "-" if column < 10 else "--"
        for i, (points, _) in enumerate(lines):
            for j, stroke in enumerate(unbroken(x, points)):
                residual = curve.residual[stroke, column]
                axes.plot(x[stroke], residual, **style, label="_" if i or j else name)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel=label, ylabel="data − fit")
    axes.legend(**{**ABOVE, "ncols": 8}, fontsize="x-small")
    axes.margins(x=0.01)


def draw_measured(
    axes: Axes, elements: Sequence[str], x: np.ndarray, lines: Sequence[tuple[np.ndarray, str | None]],
    values: np.ndarray, sigma: np.ndarray | None,
) -> None:  # fmt: skip
    """Draw measured elements at their places of the matrix, with ± σ."""
    cells = _grid(axes)
    _list_settings(cells[0], [name for _, name in lines])
    for place, cell in cells.items():
        name = f"m{place // 4 + 1}{place % 4 + 1}"
        if name not in elements:
            if place:
                _unmeasured(cell, name)
            continue
        own = values[:, elements.index(name)]
        for i, (points, _) in enumerate(lines):
            color = _COLOURS[i % len(_COLOURS)]
            cell.plot(x[points], own[points], ".-", color=color, markersize=1.5, linewidth=0.6)
            if sigma is not None:
                error = sigma[points, elements.index(name)]
                band = own[points] - error, own[points] + error
                cell.fill_between(x[points], *band, color=color, alpha=0.2, linewidth=0)
        _finish(cell, name, elements, own)


def _grid(axes: Axes) -> dict[int, Axes]:
    """Sixteen axes within one, row by row; that one keeps its labels only."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    width, height = ((1 - 3 * gap) / 4 for gap in _GAPS)
    cells = {}
    for place in range(16):
        row, column = divmod(place, 4)
        low = column * (width + _GAPS[0]), (3 - row) * (height + _GAPS[1])
        cells[place] = axes.inset_axes((*low, width, height))
    return cells


def _list_settings(cell: Axes, names: Sequence[str | None]) -> None:
    """Write m11 and the colour of each angle and azimuth into the first panel."""
    cell.set_axis_off()
    cell.text(0.5, 0.9, "m11 = 1", ha="center", va="top", fontsize="small", transform=cell.transAxes)
    named = [(i, name) for i, name in enumerate(names) if name is not None][:MOST_NAMED]
    for line, (i, name) in enumerate(named):
        where = (0.5, 0.68 - 0.13 * line)
        style: dict[str, Any] = {"color": _COLOURS[i % len(_COLOURS)], "fontsize": "x-small"}
        cell.text(*where, name, ha="center", va="top", transform=cell.transAxes, **style)


def _unmeasured(cell: Axes, name: str) -> None:
    cell.set(xticks=[], yticks=[])
    cell.spines[:].set_color("0.85")
    cell.text(0.5, 0.5, name, ha="center", va="center", color="0.7", transform=cell.transAxes)


def _finish(cell: Axes, name: str, elements: Sequence[str], shown: np.ndarray) -> None:
    """Limits and labels of a panel; the lowest of its column that was measured has numbers below it."""
    lowest = name == max(other for other in elements if other[2] == name[2])
    low, high = float(np.min(shown)), float(np.max(shown))
    room = max(high - low, SMALLEST) * (1 + 2 * _MARGIN) / 2
    cell.set_ylim((low + high) / 2 - room, (low + high) / 2 + room)
    cell.tick_params(labelsize="x-small", labelbottom=lowest, pad=1, length=2)
    cell.locator_params(nbins=3)
    cell.margins(x=0.02)
    cell.set_title(name, fontsize="x-small", loc="left", pad=2)
