"""Interactive figure of a search: misfit against thickness with the best fit and its rivals."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.status import RIVAL
from pellicle.reporting import fit_figure
from pellicle.reporting.page.data_figures import label
from pellicle.reporting.page.figure import Column, Panel, Trace, figure, line, markers, numbers

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit, Rival

_PROFILE_POINTS = 1500
"""Ranges of thickness of which the least and the largest misfit are drawn: a scan may have 400 000 points."""
_LINEAR = 0.8
"""Height of the linear part of the axis of misfits, in decades."""


def of_misfit(fit: Fit) -> dict[str, Any] | None:
    """Δχ² against thickness with the minima; None where no thickness was scanned."""
    if fit.profile is None or fit.profile.thickness.size < 2:
        return None
    minima = fit_figure.minima_of(fit)
    thickness, misfit = fit_figure.completed(fit.profile, minima)
    left, right = fit_figure.span(thickness, misfit)
    shown = (thickness >= left) & (thickness <= right)
    x, y = _envelope(thickness[shown], misfit[shown])
    scan = {
        **line(x, _height(y), [np.arange(len(x))], "misfit", "var(--data)"),
        "text": [f"{value:.4g}" for value in y],
        "hovertemplate": "%{x:.5g} nm: Δχ² %{text}<extra></extra>",
    }
    limit = {
        "type": "scatter",
        "mode": "lines",
        "name": f"ambiguous below {RIVAL:g}",
        "x": [left, right],
        "y": numbers(_height(np.array([RIVAL, RIVAL]))),
        "line": {"color": "var(--fourth)", "width": 1, "dash": "dot"},
        "hoverinfo": "skip",
    }
    traces = [scan, limit]
    if minima:
        traces.append(
            _points([minima[0]], "best", "circle", "var(--fit)", ["best fit: show it alone"], [None])
        )
    found = [(i, rival) for i, rival in enumerate(fit.rivals) if minima and _depth(fit) in rival.parameters]
    if found:
        places = [(rival.parameters[_depth(fit)], rival.delta_chi2) for _, rival in found]
        numbered = [i if rival.curves else None for i, rival in found]
        traces.append(
            _points(
                places, "rivals", "diamond", "var(--rival)", ["click to see its curve"] * len(found), numbered
            )
        )
    decades = np.arange(1 if y.max() < 1000 * RIVAL else 2, 9)
    axis = {
        "tickvals": numbers(_height(np.array([0.0, RIVAL, *10.0**decades]))),
        "ticktext": [
            "0",
            f"{RIVAL:g}",
            *(f"{10 ** int(i)}" if i < 5 else f"10<sup>{i}</sup>" for i in decades),
        ],
        "zeroline": False,
    }
    rivals = [(f"rival: {escape(label(rival, fit))}", [_highlight(rival, fit)]) for rival in fit.rivals]
    columns = [
        Column("thickness (nm)", [place for place, _ in minima]),
        Column("misfit", [delta for _, delta in minima]),
    ]
    caption = (
        f"Misfit Δχ² against thickness, searched from {thickness.min():.5g} to {thickness.max():.5g} nm,"
        f" linear below {RIVAL:g} and logarithmic above. Its minima are the best fit and"
        f" {len(found) or 'no'} rival{'s' * (len(found) != 1)}."
    )
    panel = Panel("misfit Δχ²", 260, traces, [], axis)
    drawn = figure("misfit", caption, "thickness (nm)", [panel], columns, rivals, {"range": [left, right]})
    drawn["layout"]["hovermode"] = "closest"
    return drawn


def _depth(fit: Fit) -> str:
    """Name of the thickness of `fit_figure.minima_of`."""
    return next(p.name for p in fit.free if p.name.split(".")[-1] == "thickness")


def _highlight(rival: Rival, fit: Fit) -> Panel:
    """A ring around a rival's minimum."""
    name = next((p.name for p in fit.free if p.name.split(".")[-1] == "thickness"), None)
    if name not in rival.parameters:
        return Panel("", 1, [], [])
    at, height = np.array([rival.parameters[name]]), _height(np.array([rival.delta_chi2]))
    ring = markers(at, height, "", "var(--rival)")
    return Panel("", 1, [], [ring | {"marker": {"size": 18, "line": {"width": 3}}, "hoverinfo": "skip"}])


def _points(
    places: list[tuple[float, float]],
    name: str,
    symbol: str,
    colour: str,
    hints: list[str],
    rivals: list[int | None],
) -> Trace:
    x, y = np.transpose(places)
    texts = [
        f"{at:.5g} nm: Δχ² {delta:.3g}<br>{hint}" for (at, delta), hint in zip(places, hints, strict=True)
    ]
    return {
        **markers(x, _height(y), name, colour, symbol),
        "marker": {"color": colour, "symbol": symbol, "size": 11},
        "text": texts,
        "hovertemplate": "%{text}<extra></extra>",
        "customdata": [{"rival": rival} for rival in rivals],
    }


def _height(misfit: np.ndarray) -> np.ndarray:
    """Place of a misfit on an axis that is linear below the threshold of rivals and logarithmic above."""
    above = np.maximum(misfit, RIVAL)
    return np.where(misfit > RIVAL, _LINEAR + np.log10(above / RIVAL), _LINEAR * misfit / RIVAL)


def _envelope(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest value of each range of positions, where there are many points."""
    if len(x) <= 2 * _PROFILE_POINTS:
        return x, y
    groups = np.array_split(np.arange(len(x)), _PROFILE_POINTS)
    kept = sorted({int(group[pick(y[group])]) for group in groups for pick in (np.argmin, np.argmax)})
    return x[kept], y[kept]
