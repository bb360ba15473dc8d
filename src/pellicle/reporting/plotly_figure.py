"""Rendering of panels as Plotly's dictionaries, which the script of a page draws.

Plotly's basic bundle of version 4.1.1 (npm plotly.js-basic-dist-min, MIT licence) is a file of this package,
1.2 MB or compressed 0.4 MB, which each page includes. The script in the Python package plotly has 4.8 MB,
that of Bokeh 1.3 MB (versions 7.1.0 and 3.9.2), and both would be an optional dependency: these
dictionaries need no Python package.

Colours are names of the page's style, `var(--fit)`, which differ between light and dark pages. Labels of
Plotly take some HTML: names of files are escaped.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from pellicle.reporting.drawable import CHANNELS, Band, Line, Panel, Section

Trace = dict[str, Any]
MOST_POINTS = 4000
"""Points of a line or a cloud of markers above which every other one, or fewer, is drawn."""
_MOST_NAMED = 8
"""Most names in the legend of a figure."""
_GAP, _AROUND, _INCH = 34, 98, 100
"""Pixels between panels, above and below them, and of an inch of their height."""
_LINEAR = 0.8
"""Height of the linear part of a scale that is logarithmic above a threshold, in decades."""
_ENVELOPE = 1500
"""Ranges of a scan of which the least and the largest value are drawn: it may have 400 000 points."""
_COLOURS = {"points": "data", "residual": "data", **{f"C{i}": CHANNELS[i % len(CHANNELS)] for i in range(10)}}
_BANDS = {"band": "var(--band)", "index-n": "var(--band-n)", "index-k": "var(--band-k)"}
_SYMBOLS = {
    "point": "circle",
    "circle": "circle",
    "ring": "circle-open",
    "cross": "x-thin-open",
    "diamond": "diamond",
}
_DASHES = {"solid": "solid", "dashed": "dash", "dotted": "dot"}


def figure(
    name: str,
    caption: str,
    section: Section,
    rivals: Sequence[tuple[str, Sequence[Panel]]] = (),
    axis: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """A figure of panels above each other, as the page's script takes it.

    **Arguments:** `name`, the id of its element; `caption`, which describes it in words; `section`, its
    panels and the table behind it; `rivals`, the label and the panels of each rival, of which the model is
    drawn; `axis`, added to the abscissa's layout.
    """
    panels = [panel for panel in section.panels if panel.image is None]
    heights = np.array([_INCH * panel.height for panel in panels])
    inside = heights.sum() + _GAP * (len(panels) - 1)
    layout: dict[str, Any] = {
        "meta": caption,
        "height": int(inside) + _AROUND,
        "margin": {"l": 68, "r": 12, "t": 50, "b": 48},
        "paper_bgcolor": "var(--page)",
        "plot_bgcolor": "var(--page)",
        "font": {"color": "var(--text)", "size": 13},
        "hovermode": "closest" if any(line.hints for panel in panels for line in panel.lines) else "x",
        "hoversubplots": "axis",
        "hoverlabel": {"bgcolor": "var(--panel)", "font": {"color": "var(--text)"}},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0, "bgcolor": "rgba(0,0,0,0)"},
        "xaxis": _abscissa(section.abscissa, panels) | dict(axis or {}),
    }
    top = 1.0
    for number, (panel, share) in enumerate(zip(panels, (heights / inside).tolist(), strict=True), start=1):
        place = {"domain": [max(top - share, 0.0), top], "anchor": "x"}
        layout[_numbered("yaxis", number)] = _axis(panel.label) | place | _scale(panel)
        top -= share + _GAP / inside
    step = thinning(max((len(column) for column in section.table.columns.values()), default=0))
    return {
        "id": name,
        "traces": _listed([trace for i, panel in enumerate(panels, start=1) for trace in _traces(panel, i)]),
        "layout": layout,
        "rivals": [_rival(label, panels) for label, panels in rivals],
        "columns": [
            {"name": column, "values": numbers(values[::step])}
            for column, values in section.table.columns.items()
        ],
    }


def thinning(count: int) -> int:
    """Every so-many-th of `count` points is drawn."""
    return -(-count // MOST_POINTS) or 1


def numbers(values: Iterable[Any], digits: int = 6) -> list[float | None]:
    """Numbers of so many digits, None for those that are absent or not finite."""
    form, listed = f".{digits}g", values.tolist() if isinstance(values, np.ndarray) else values
    return [None if x is None or not math.isfinite(x) else float(format(x, form)) for x in listed]


def _numbered(word: str, number: int) -> str:
    return word if number == 1 else f"{word}{number}"


def _axis(label: str) -> dict[str, Any]:
    line = "var(--line)"
    title = {"text": escape(label, quote=False), "standoff": 6}
    return {"title": title, "gridcolor": line, "zerolinecolor": line, "linecolor": line}


def _abscissa(label: str, panels: Sequence[Panel]) -> dict[str, Any]:
    axis: dict[str, Any] = _axis(label) | {"anchor": _numbered("y", len(panels))}
    span = next((panel.span for panel in panels if panel.span is not None), None)
    ticks = next((panel.ticks for panel in panels if panel.ticks), ())
    axis |= {} if span is None else {"range": list(span)}
    if ticks:
        axis |= {"tickvals": list(range(1, len(ticks) + 1)), "ticktext": list(ticks)}
    return axis


def _scale(panel: Panel) -> dict[str, Any]:
    """Layout of a logarithmic ordinate; below a threshold it is linear, with ticks at transformed places."""
    if panel.scale == "log":
        return {"type": "log", "dtick": "D2"}
    if panel.scale == "linear":
        return {}
    largest = max(float(np.max(line.y)) for line in panel.lines)
    decades = np.arange(1 if largest < 1000 * panel.threshold else 2, 9)
    words = [f"{10 ** int(i)}" if i < 5 else f"10<sup>{i}</sup>" for i in decades]
    values = numbers(_ordinate(np.array([0.0, panel.threshold, *10.0**decades]), panel))
    return {"tickvals": values, "ticktext": ["0", f"{panel.threshold:g}", *words], "zeroline": False}


def _ordinate(y: np.ndarray, panel: Panel) -> np.ndarray:
    """Places of values on the axis of a panel: decades above the threshold, linear below it."""
    if panel.scale != "symlog":
        return y
    above = np.maximum(y, panel.threshold)
    return np.where(
        y > panel.threshold, _LINEAR + np.log10(above / panel.threshold), _LINEAR * y / panel.threshold
    )


def _traces(panel: Panel, number: int) -> list[Trace]:
    axes = {"xaxis": "x", "yaxis": _numbered("y", number)}
    return [
        *(_band(band) | axes for band in panel.bands),
        *(_line(line, panel) | axes for line in panel.lines),
    ]


def _listed(traces: list[Trace]) -> list[Trace]:
    """List each name once, and no more than fit into a legend."""
    named: set[str] = set()
    for trace in traces:
        trace["showlegend"] = trace["showlegend"] and trace["name"] not in named and len(named) < _MOST_NAMED
        named |= {trace["name"]} if trace["showlegend"] else set()
    return traces


def _rival(label: str, panels: Sequence[Panel]) -> list[Trace]:
    """The lines of a model in the colour of rivals, dashed or with open markers, listed once."""
    shown = [panel for panel in panels if panel.image is None]
    traces: list[Trace] = [
        _line(line, panel) | {"xaxis": "x", "yaxis": _numbered("y", number)}
        for number, panel in enumerate(shown, start=1)
        for line in panel.lines
        if line.model
    ]
    return [
        {
            **trace,
            "line": {"color": "var(--rival)", "width": 2, "dash": "dash"},
            "marker": dict(trace.get("marker", {})) | {"color": "var(--rival)", "symbol": "diamond-open"},
            "name": escape(label),
            "showlegend": not i,
        }
        for i, trace in enumerate(traces)
    ]


def _line(line: Line, panel: Panel) -> Trace:
    colour = f"var(--{_COLOURS.get(line.colour, line.colour)})"
    x, y = _thinned(line, panel)
    trace: Trace = {
        "type": "scatter",
        "mode": "markers" if line.markers else "lines",
        "name": escape(line.name),
        "showlegend": line.listed and bool(line.name),
        "x": numbers(x),
        "y": numbers(_ordinate(y, panel)),
    }
    if line.markers:
        size = 11 if line.links else 18 if line.width > 9 else 7 if len(line.x) < 100 else 4
        trace["marker"] = {"color": colour, "symbol": _SYMBOLS[line.style], "size": size}
    else:
        width = 1 if line.width < 0.9 or line.style == "dotted" else 2
        trace["line"] = {"color": colour, "width": width, "dash": _DASHES[line.style]}
    if line.errors is not None:
        trace["error_y"] = {"array": numbers(line.errors), "color": colour, "thickness": 1}
    if line.hints:
        trace |= {"text": list(line.hints), "hovertemplate": "%{text}<extra></extra>"}
    elif panel.scale == "symlog":
        words = [f"{at:.5g} nm: {panel.label} {value:.4g}" for at, value in zip(x, y, strict=True)]
        trace |= {"text": words, "hovertemplate": "%{text}<extra></extra>"}
    if line.links:
        trace["customdata"] = [dict(link) for link in line.links]
    return trace


def _thinned(line: Line, panel: Panel) -> tuple[np.ndarray, np.ndarray]:
    """Some of the points of a line, with its interruptions; of a scan the least and the largest of ranges."""
    count = len(line.x)
    if panel.scale == "symlog" and count > 2 * _ENVELOPE:
        groups = np.array_split(np.arange(count), _ENVELOPE)
        kept = sorted(
            {int(group[pick(line.y[group])]) for group in groups for pick in (np.argmin, np.argmax)}
        )
        return line.x[kept], line.y[kept]
    step = thinning(count)
    chosen = np.arange(count) % step == 0
    chosen |= np.isnan(line.x) & (not line.markers)
    return line.x[chosen], line.y[chosen]


def _band(band: Band) -> Trace:
    """The area between two lines, in one piece for each run of finite values."""
    step = thinning(len(band.x))
    x, low, high = (np.asarray(values)[::step] for values in (band.x, band.low, band.high))
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    runs = np.split(np.arange(len(x)), np.flatnonzero(np.diff(known)) + 1)
    outline: list[list[Any]] = [[], []]
    for run in (run for run in runs if run.size and known[run[0]]):
        for values, (forth, back) in zip(outline, ((x, x), (low, high)), strict=True):
            values += [*([None] if values else []), *forth[run].tolist(), *back[run][::-1].tolist()]
    return {
        "type": "scatter",
        "mode": "lines",
        "name": escape(band.name),
        "showlegend": band.listed and bool(band.name),
        "x": numbers(outline[0]),
        "y": numbers(outline[1]),
        "fill": "toself",
        "fillcolor": _BANDS.get(band.colour, "var(--band)"),
        "line": {"width": 0},
        "hoverinfo": "skip",
    }
