"""Interactive figures as Plotly's dictionaries: panels that share one abscissa, and overlays of rivals.

Plotly's basic bundle of version 4.1.1 (npm plotly.js-basic-dist-min, MIT licence) is a file of this package,
1.2 MB or compressed 0.4 MB, which each page includes. The script in the Python package plotly has 4.8 MB,
that of Bokeh 1.3 MB (versions 7.1.0 and 3.9.2), and both would be an optional dependency: these
dictionaries need no Python package.

Colours are names of the page's style, `var(--fit)`, which differ between light and dark pages. Labels of
Plotly take some HTML: names of files must be escaped.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

Trace = dict[str, Any]
_GAP, _AROUND = 34, 98
"""Pixels between panels, and above and below them."""
MOST_POINTS = 4000
"""Points of a line or a cloud of markers above which every other one, or fewer, is drawn."""


class Column(NamedTuple):
    """A column of the table behind a figure."""

    name: str
    values: Sequence[float | None] | np.ndarray


class Panel(NamedTuple):
    """One panel: label of its ordinate, height in pixels, traces of the data and of the model.

    A rival's traces of the model are drawn beside those of the fit. `axis` is added to the ordinate's layout.
    """

    label: str
    height: int
    data: list[Trace]
    model: list[Trace]
    axis: Mapping[str, Any] = {}


def figure(
    name: str,
    caption: str,
    abscissa: str,
    panels: Sequence[Panel],
    columns: Iterable[Column],
    rivals: Sequence[tuple[str, Sequence[Panel]]] = (),
    axis: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """A figure of panels above each other, as the page's script takes it.

    **Arguments:** `name`, the id of its element; `caption`, which describes it in words; `abscissa`, the
    label of the common axis; `columns` of the table behind it; `rivals`, the label and the panels of
    each rival, of which the model is drawn; `axis`, added to the abscissa's layout.
    """
    heights = np.array([panel.height for panel in panels], dtype=float)
    inside = heights.sum() + _GAP * (len(panels) - 1)
    layout: dict[str, Any] = {
        "meta": caption,
        "height": int(inside) + _AROUND,
        "margin": {"l": 68, "r": 12, "t": 50, "b": 48},
        "paper_bgcolor": "var(--page)",
        "plot_bgcolor": "var(--page)",
        "font": {"color": "var(--text)", "size": 13},
        "hovermode": "x",
        "hoversubplots": "axis",
        "hoverlabel": {"bgcolor": "var(--panel)", "font": {"color": "var(--text)"}},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0, "bgcolor": "rgba(0,0,0,0)"},
        "xaxis": _axis(abscissa) | {"anchor": _axis_name("y", len(panels))} | dict(axis or {}),
    }
    top = 1.0
    for number, (panel, share) in enumerate(zip(panels, (heights / inside).tolist(), strict=True), start=1):
        place = {"domain": [max(top - share, 0.0), top], "anchor": "x"}
        layout[_axis_name("yaxis", number)] = _axis(panel.label) | place | dict(panel.axis)
        top -= share + _GAP / inside
    return {
        "id": name,
        "traces": _placed([[*panel.data, *panel.model] for panel in panels]),
        "layout": layout,
        "rivals": [
            _named(_placed([_as_rival(panel.model) for panel in own]), label) for label, own in rivals
        ],
        "columns": [{"name": each.name, "values": numbers(each.values)} for each in columns],
    }


def _axis_name(word: str, number: int) -> str:
    return word if number == 1 else f"{word}{number}"


def _axis(label: str) -> dict[str, Any]:
    return {
        "title": {"text": label, "standoff": 6},
        "gridcolor": "var(--line)",
        "zerolinecolor": "var(--line)",
        "linecolor": "var(--line)",
    }


def _placed(panels: list[list[Trace]]) -> list[Trace]:
    return [
        {**trace, "xaxis": "x", "yaxis": _axis_name("y", number)}
        for number, traces in enumerate(panels, start=1)
        for trace in traces
    ]


def _as_rival(traces: Iterable[Trace]) -> list[Trace]:
    """The traces of a model in the colour of rivals, dashed or with open markers."""
    return [
        {
            **trace,
            "line": {"color": "var(--rival)", "width": 2, "dash": "dash"},
            "marker": {**trace.get("marker", {}), "color": "var(--rival)", "symbol": "diamond-open"},
        }
        for trace in traces
    ]


def _named(traces: list[Trace], label: str) -> list[Trace]:
    """Traces of one name, which is listed once."""
    return [{**each, "name": label, "showlegend": not i} for i, each in enumerate(traces)]


def line(x: np.ndarray, y: np.ndarray, strokes: Sequence[np.ndarray], name: str, colour: str) -> Trace:
    """A line through points in `strokes`, arrays of their positions; between strokes it is interrupted."""
    drawn = [stroke[:: thinning(len(x))] for stroke in strokes]
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": _interrupted(x, drawn),
        "y": _interrupted(y, drawn),
        "line": {"color": colour, "width": 2},
    }


def markers(x: np.ndarray, y: np.ndarray, name: str, colour: str, symbol: str = "circle") -> Trace:
    """Markers, fewer than `MOST_POINTS`."""
    step = thinning(len(x))
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": numbers(x[::step]),
        "y": numbers(y[::step]),
        "marker": {"color": colour, "symbol": symbol, "size": 7 if len(x) < 100 else 4},
    }


def band(x: np.ndarray, below: np.ndarray, above: np.ndarray, name: str, colour: str) -> Trace:
    """The area between two lines."""
    step = thinning(len(x))
    x, below, above = (np.asarray(each)[::step] for each in (x, below, above))
    known = np.isfinite(below) & np.isfinite(above)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": numbers([*x[known], *x[known][::-1]]),
        "y": numbers([*below[known], *above[known][::-1]]),
        "fill": "toself",
        "fillcolor": colour,
        "line": {"width": 0},
        "hoverinfo": "skip",
    }


def thinning(count: int) -> int:
    """Every so-many-th of `count` points is drawn."""
    return -(-count // MOST_POINTS) or 1


def numbers(values: Iterable[Any]) -> list[float | None]:
    """Numbers of six digits, None for those that are not finite."""
    return [float(f"{x:.6g}") if np.isfinite(x) else None for x in values]


def _interrupted(values: np.ndarray, strokes: Sequence[np.ndarray]) -> list[float | None]:
    result: list[float | None] = []
    for stroke in strokes:
        result += [*([None] if result else []), *numbers(values[stroke])]
    return result
