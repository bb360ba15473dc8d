"""Report, JSON record, table, figure and folder of accuracy against time."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import MARKER, new_folder, write_text
from pellicle.reporting import matplotlib_figure
from pellicle.reporting.csv_text import csv_rows
from pellicle.reporting.drawable import Line, Panel, Section, Style
from pellicle.reporting.json_record import indented, versions
from pellicle.reporting.plain_text import COLUMNS
from pellicle.signals.registry import KINDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pellicle.accuracy.cost import Cost
    from pellicle.accuracy.registry import Comparison
    from pellicle.accuracy.surface import SurfaceCost

_Columns = Mapping[str, Callable[[Any], str]]
"""The cell of each column, by its head."""


def text(cost: Cost | SurfaceCost, name: str = "scene") -> str:
    """Format each table with the recommended row, and the reason for what was left out."""
    from pellicle.accuracy.surface import SurfaceCost

    if isinstance(cost, SurfaceCost):
        blocks = [] if cost.colours is None else [_methods(cost.colours, name)]
        blocks.append(_methods(cost.values, name))
        blocks += [f"No colours: {cost.no_colours}.\n"] if cost.no_colours else []
    else:
        blocks = [_methods(cost.methods, name)]
        blocks.append(f"No fits: {cost.no_solvers}.\n" if cost.solvers is None else _solvers(cost.solvers))
        blocks += [] if cost.intervals is None else [_intervals(cost.intervals)]
        parts = [part for part in (cost.solvers, cost.intervals) if part is not None]
        if not cost.interrupted and any(_done(part) < part.requested for part in parts):
            blocks.append("The time limit ended the data sets early: --time-limit 600 allows ten minutes.\n")
    blocks += ["Interrupted: these are the measurements until then.\n"] if cost.interrupted else []
    return "\n".join(blocks)


def error_label(methods: Comparison, size: str = "") -> str:
    """`error in R`, or of one size: `error of 0.1 degrees`."""
    of = f" of {size}" if size else ""
    if methods.unit == "relative":
        return f"relative error{of}"
    if size and methods.unit == "degrees":
        return f"error{of} degrees"
    kind = KINDS.get(methods.unit)
    return f"error{of} in {kind.noun if kind is not None and kind().parts else methods.unit}"


def time_unit(methods: Comparison) -> tuple[str, float]:
    """The unit for the time of one sample, and the number of them in a second."""
    return ("µs", 1e6) if methods.sample == "spectrum" else ("ns", 1e9)


def _methods(methods: Comparison, name: str) -> str:
    unit, scale = time_unit(methods)
    few, more = (2, 1) if scale < 1e9 else (0, 2)
    columns: _Columns = {
        "method": lambda method: method.name,
        "leaves out": lambda method: method.leaves_out,
        error_label(methods): lambda method: f"{method.error:.1e}",
        f"{unit}/{methods.sample}": lambda method: f"{method.seconds * scale:.{few}f}",
        "compile s": lambda method: f"{method.compile_seconds:.2f}",
        "kflop": lambda method: (
            "" if method.details["flops"] is None else f"{method.details['flops'] / 1e3:.{more}f}"
        ),
    }
    size = error_label(methods, f"{methods.tolerance:g}")
    within = f"{'a' if size.startswith('r') else 'an'} {size}"
    advice = f"{methods.recommended} is the fastest within {within}"
    if not methods.within:
        advice = f"no method is within {within}; {methods.recommended} comes nearest"
    title = f"{name}: {_compared(methods)} against {methods.reference}"
    notes = [
        "* no other method is both faster and as accurate",
        f"→ {advice}",
        *_omitted(methods.left_out),
    ]
    return _table(title, methods.results, methods.recommended, columns, notes)


def _compared(methods: Comparison) -> str:
    if methods.sample != "spectrum":
        each = f"{methods.wavelengths} {'angles' if methods.sample == 'colour' else 'pairs of directions'}"
        which = "mean" if methods.sample == "colour" else "largest"
        return f"{methods.draws} draws between the bounds along {each}, the {which} error"
    several = "s" * (methods.wavelengths > 1)
    draws = "draws between the bounds" if methods.draws > 1 else "spectrum"
    return f"{methods.wavelengths} wavelength{several}, the largest error of {methods.draws} {draws}"


def _done(comparison: Comparison) -> int:
    return max((result.details["datasets"] for result in comparison.results), default=0)


def _counted(comparison: Comparison) -> str:
    """Number of data sets, and of how many where the time limit or Ctrl-C ended them."""
    done, requested = _done(comparison), comparison.requested
    return f"{done}" if done == requested else f"{done} (of {requested})"


def _solvers(solvers: Comparison) -> str:
    title = (
        f"Fits of {_counted(solvers)} simulated spectra with noise {solvers.noise:g}, their true values"
        " anywhere between the bounds; errors as a share of the bounds"
    )
    columns: _Columns = {
        "solver": lambda solver: solver.name,
        "leaves out": lambda solver: solver.leaves_out,
        "failed": lambda solver: f"{solver.details['failures']}/{solver.details['datasets']}",
        "mean error": lambda solver: f"{solver.error:.1e}",
        "median": lambda solver: f"{solver.details['median_error']:.1e}",
        "ms/fit": lambda solver: f"{solver.seconds * 1e3:.1f}",
        "compile s": lambda solver: f"{solver.compile_seconds:.1f}",
    }
    advice = [f"→ {solvers.recommended} is the fastest of those that failed least"] if solvers.results else []
    return _table(
        title, solvers.results, solvers.recommended, columns, [*advice, *_omitted(solvers.left_out)]
    )


def _intervals(intervals: Comparison) -> str:
    title = (
        f"95 % intervals of {_counted(intervals)} of these data sets: share that contains the true value,"
        " width as a share of the bounds, and time after the fit"
    )
    columns: _Columns = {
        "interval": lambda way: way.name,
        "leaves out": lambda way: way.leaves_out,
        "coverage": lambda way: f"{100 * way.details['coverage']:.0f} ± {100 * way.details['doubt']:.0f} %",
        "width": lambda way: f"{way.details['width']:.1e}",
        "ms": lambda way: f"{way.seconds * 1e3:.1f}",
        "compile s": lambda way: f"{way.compile_seconds:.1f}",
    }
    best = f"→ {intervals.recommended} is the fastest whose coverage is 95 % within two standard deviations"
    notes = [*([best] if intervals.results else []), *_omitted(intervals.left_out)]
    return _table(title, intervals.results, intervals.recommended, columns, notes)


def _table(
    title: str, items: Sequence[Any], recommended: str | None, columns: _Columns, notes: Sequence[str]
) -> str:
    """A title, aligned columns (a mark and two names flush left), and notes."""
    rows = [("", *columns)]
    for item in items:
        mark = ("→" if item.name == recommended else " ") + ("*" if item.pareto else " ")
        rows.append((mark, *(cell(item) for cell in columns.values())))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        padded = zip(row, widths, strict=True)
        cells = (cell.ljust(w) if i < 3 else cell.rjust(w) for i, (cell, w) in enumerate(padded))
        lines.append("  ".join(cells).rstrip())
    return "\n".join([*textwrap.wrap(title, COLUMNS), "", *lines, "", *notes]) + "\n"


def _omitted(left_out: Mapping[str, str]) -> list[str]:
    """One paragraph for each reason."""
    reasons: dict[str, list[str]] = {}
    for name, why in left_out.items():
        reasons.setdefault(why, []).append(name)
    texts = [f"left out: {', '.join(names)}: {why}" for why, names in reasons.items()]
    return [line for item in texts for line in textwrap.wrap(item, COLUMNS, subsequent_indent="    ")]


SCHEMA = "pellicle.cost/1"
_CSV_COLUMNS = (
    *("kind", "name", "leaves_out", "error", "seconds", "compile_seconds", "flops", "pareto"),
    *("median_error", "failures", "datasets", "coverage", "doubt", "width"),
)


def to_json(cost: Cost | SurfaceCost, recipe: str) -> dict[str, Any]:
    """Convert to dictionaries: all methods in one list, `rungs`, each with its `kind`.

    Kinds of a film are "forward", "inverse" (a solver) and "interval" (its error is the distance of its
    coverage from 95 %), or of its colours "colour" (mean ΔE2000); of a surface "colour" and "brdf" (relative
    error). `recommended` names a forward method, or one for colours; `within` says whether it meets the
    tolerance. `brdf` has the same keys for a surface's values. Infinite errors are None.
    """
    from pellicle.accuracy.surface import SurfaceCost

    details = _surface(cost) if isinstance(cost, SurfaceCost) else _film(cost)
    end = {"interrupted": cost.interrupted, "versions": versions()}
    return {"schema": SCHEMA, "recipe": recipe} | details | end


def _film(cost: Cost) -> dict[str, Any]:
    methods, solvers, intervals = cost.methods, cost.solvers, cost.intervals
    omitted = [part.left_out for part in (methods, solvers, intervals) if part is not None]
    return {
        **_summary(methods),
        "wavelengths": methods.wavelengths,
        "draws": methods.draws,
        "rungs": _rungs(methods, solvers, intervals),
        "recommended_solver": None if solvers is None else solvers.recommended,
        "recommended_interval": None if intervals is None else intervals.recommended,
        "noise": None if solvers is None else solvers.noise,
        "left_out": {name: why for left_out in omitted for name, why in left_out.items()},
        "no_fits": cost.no_solvers or None,
    }


def _surface(cost: SurfaceCost) -> dict[str, Any]:
    parts = [part for part in (cost.colours, cost.values) if part is not None]
    first = parts[0]
    return {
        **_summary(first),
        "draws": first.draws,
        "rungs": _rungs(*parts),
        "brdf": _summary(cost.values),
        "left_out": {name: why for methods in parts for name, why in methods.left_out.items()},
        "no_colours": cost.no_colours or None,
    }


def _rungs(*comparisons: Comparison | None) -> list[dict[str, Any]]:
    return [
        {"kind": part.kind, **result.record()}
        for part in comparisons
        if part is not None
        for result in part.results
    ]


def _summary(methods: Comparison) -> dict[str, Any]:
    names = ("reference", "tolerance", "unit", "recommended", "within")
    return {name: getattr(methods, name) for name in names}


def to_csv(rungs: list[dict[str, Any]]) -> str:
    """Format the methods of a record as rows; columns that a kind of method lacks are empty."""
    cells = [[rung.get(name) for name in _CSV_COLUMNS] for rung in rungs]
    return csv_rows(_CSV_COLUMNS, [["" if cell is None else str(cell) for cell in row] for row in cells])


def write_cost(folder: str | os.PathLike[str], cost: Cost | SurfaceCost, recipe: str = "scene") -> Path:
    """Write result.json, report.txt, cost.csv and cost.png into a folder, each complete or not at all.

    Returns the folder. Raises UsageError where it holds files that pellicle did not write, or cannot be
    written.
    """
    from pellicle.reporting.matplotlib_figure import save_figure

    name, record = Path(recipe).name, to_json(cost, recipe)
    target = new_folder(folder)
    write_text(target / MARKER, indented(record), overwrite=True)  # first: it marks the folder
    write_text(target / "report.txt", text(cost, name), overwrite=True)
    write_text(target / "cost.csv", to_csv(record["rungs"]), overwrite=True)
    save_figure(draw(cost, name), target / "cost.png", overwrite=True)
    return target


FLOOR = 1e-17
"""Height at which an error of zero is drawn."""


def draw(cost: Cost | SurfaceCost, name: str = "scene") -> Figure:
    """Draw error against time: of a film's methods and solvers, or of a surface's colours and values."""
    from pellicle.accuracy.surface import SurfaceCost

    if isinstance(cost, SurfaceCost):
        kinds = [methods for methods in (cost.colours, cost.values) if methods is not None]
        solvers = None
    else:
        kinds, solvers = [cost.methods], cost.solvers if cost.solvers and cost.solvers.results else None
    sections = [_methods_section(methods) for methods in kinds]
    if solvers is not None:
        label = "mean error of the parameters,\nshare of the bounds"
        panel = _panel(solvers.results, solvers.recommended, 1e3, label)
        sections.append(Section("time of one fit (ms)", [[panel]]))
    return matplotlib_figure.draw(sections, name)


def _methods_section(methods: Comparison) -> Section:
    """Error against time of methods of simulation, and the tolerance."""
    unit, scale = time_unit(methods)
    which = "mean" if methods.sample == "colour" else "largest"
    label = f"{which} {error_label(methods)},\nagainst {methods.reference}"
    tolerance = f"{error_label(methods, f'{methods.tolerance:g}')} (tolerance)", methods.tolerance
    panel = _panel(methods.results, methods.recommended, scale, label, tolerance)
    return Section(f"time of one {methods.sample} ({unit})", [[panel]])


def _panel(
    items: Sequence[Any],
    recommended: str | None,
    scale: float,
    label: str,
    tolerance: tuple[str, float] | None = None,
) -> Panel:
    """Numbered points, the Pareto front joined; an error of zero is drawn at the bottom."""
    shown = sorted((item for item in items if np.isfinite(item.error)), key=lambda item: item.seconds)
    x = np.array([item.seconds * scale for item in shown])
    y = np.array([max(item.error, FLOOR) for item in shown])
    front = np.array([item.pareto for item in shown], dtype=bool)
    best = np.array([item.name == recommended for item in shown], dtype=bool)
    lines = [Line(x[front], y[front], "", "fit", width=1.0)]
    if tolerance is not None:
        lines.append(Line(x[[0, -1]], np.full(2, tolerance[1]), tolerance[0], "blue", "dotted", 0.8))
    groups: tuple[tuple[np.ndarray, str, str, Style], ...] = (
        (front & ~best, "fastest at its accuracy", "fit", "circle"),
        (~front & ~best, "", "data", "circle"),
        (best, "recommended", "fit", "diamond"),
    )
    lines += [Line(x[rows], y[rows], name, colour, style) for rows, name, colour, style in groups]
    notes = [(*place, str(i)) for i, place in enumerate(zip(x, y, strict=True), start=1)]
    key = [f"{i}  {item.name}" for i, item in enumerate(shown, start=1)]
    axes: Any = {"scale": "log", "abscissa": "log", "legend": "above"}
    return Panel(label, lines, height=4.0, notes=notes, key=key, **axes)
