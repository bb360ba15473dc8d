"""Report, JSON record, table, figure and folder of accuracy against time."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.accuracy.cost import Cost
from pellicle.accuracy.registry import Comparison
from pellicle.accuracy.surface import SurfaceCost
from pellicle.reporting import matplotlib_figure
from pellicle.reporting.drawable import Line, Panel, Section, Style
from pellicle.reporting.json_record import taken, versions, write_result
from pellicle.reporting.plain_text import COLUMNS, aligned, csv_rows
from pellicle.signals.registry import KINDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_Columns = Mapping[str, Callable[[Any], str]]
"""The cell of each column, by its head."""


def text(cost: Cost | SurfaceCost, name: str = "scene") -> str:
    """Format each table with the recommended row, and the reason for what was left out."""
    parts = _parts(cost)
    blocks = [_table(part, name) for part in parts]
    if isinstance(cost, SurfaceCost):
        blocks += [f"No colours: {cost.no_colours}.\n"] if cost.no_colours else []
    elif cost.solvers is None:
        blocks.append(f"No fits: {cost.no_solvers}.\n")
    if not cost.interrupted and any(_done(part) < part.requested for part in parts):
        blocks.append("The time limit ended the data sets early: --time-limit 600 allows ten minutes.\n")
    blocks += ["Interrupted: these are the measurements until then.\n"] if cost.interrupted else []
    return "\n".join(blocks)


def _parts(cost: Cost | SurfaceCost) -> list[Comparison]:
    """Comparisons of methods, solvers and intervals of a film, of colours and of values of a surface."""
    if isinstance(cost, Cost):
        parts = (cost.methods, cost.solvers, cost.intervals)
    else:
        parts = (cost.colours, cost.values)
    return [part for part in parts if part is not None]


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


def _table(part: Comparison, name: str) -> str:
    """A title, aligned columns (a mark and two names flush left), and notes."""
    if part.kind == "inverse":
        title, columns, notes = _solvers(part)
    elif part.kind == "interval":
        title, columns, notes = _intervals(part)
    else:
        title, columns, notes = _methods(part, name)
    rows = [("", *columns)]
    for result in part.results:
        mark = ("→" if result.name == part.recommended else " ") + ("*" if result.pareto else " ")
        rows.append((mark, *(cell(result) for cell in columns.values())))
    lines = [*textwrap.wrap(title, COLUMNS), "", *aligned(rows, left=3), "", *notes]
    return "\n".join([*lines, *_omitted(part.left_out)]) + "\n"


def _methods(methods: Comparison, name: str) -> tuple[str, _Columns, list[str]]:
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
    return title, columns, ["* no other method is both faster and as accurate", f"→ {advice}"]


def _compared(methods: Comparison) -> str:
    if methods.sample != "spectrum":
        each = f"{methods.wavelengths} {'angles' if methods.sample == 'colour' else 'pairs of directions'}"
        which = "mean" if methods.sample == "colour" else "largest"
        return f"{methods.draws} draws between the bounds along {each}, the {which} error"
    several = "s" * (methods.wavelengths > 1)
    draws = "draws between the bounds" if methods.draws > 1 else "spectrum"
    return f"{methods.wavelengths} wavelength{several}, the largest error of {methods.draws} {draws}"


def _done(comparison: Comparison) -> int:
    """Number of data sets that were fitted; 0 of methods of simulation, which have none."""
    return max((result.details.get("datasets", 0) for result in comparison.results), default=0)


def _counted(comparison: Comparison) -> str:
    """Number of data sets, and of how many where the time limit or Ctrl-C ended them."""
    done, requested = _done(comparison), comparison.requested
    return f"{done}" if done == requested else f"{done} (of {requested})"


def _solvers(solvers: Comparison) -> tuple[str, _Columns, list[str]]:
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
    advice = f"→ {solvers.recommended} is the fastest of those that failed least"
    return title, columns, [advice] if solvers.results else []


def _intervals(intervals: Comparison) -> tuple[str, _Columns, list[str]]:
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
    return title, columns, [best] if intervals.results else []


def _omitted(left_out: Mapping[str, str]) -> list[str]:
    """One paragraph for each reason."""
    reasons: dict[str, list[str]] = {}
    for name, why in left_out.items():
        reasons.setdefault(why, []).append(name)
    texts = [f"left out: {', '.join(names)}: {why}" for why, names in reasons.items()]
    return [line for item in texts for line in textwrap.wrap(item, COLUMNS, subsequent_indent="    ")]


_SUMMARY = ("reference", "tolerance", "unit", "recommended", "within")
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
    parts = _parts(cost)
    record = {
        "schema": "pellicle.cost/1",
        "recipe": recipe,
        **taken(parts[0], *_SUMMARY, *(["wavelengths"] if isinstance(cost, Cost) else ()), "draws"),
        "rungs": [{"kind": part.kind, **result.record()} for part in parts for result in part.results],
    }
    left_out = {name: why for part in parts for name, why in part.left_out.items()}
    if isinstance(cost, Cost):
        solvers, intervals = cost.solvers, cost.intervals
        record |= {
            "recommended_solver": None if solvers is None else solvers.recommended,
            "recommended_interval": None if intervals is None else intervals.recommended,
            "noise": None if solvers is None else solvers.noise,
            "left_out": left_out,
            "no_fits": cost.no_solvers or None,
        }
    else:
        record["brdf"] = taken(cost.values, *_SUMMARY)
        record |= {"left_out": left_out, "no_colours": cost.no_colours or None}
    return record | {"interrupted": cost.interrupted, "versions": versions()}


def write_cost(folder: str | os.PathLike[str], cost: Cost | SurfaceCost, recipe: str = "scene") -> Path:
    """Write result.json, report.txt, cost.csv and cost.png into a folder, each complete or not at all.

    Columns of the table that a kind of method lacks are empty. Returns the folder. Raises UsageError where it
    holds files that pellicle did not write, or cannot be written.
    """
    name, record = Path(recipe).name, to_json(cost, recipe)
    cells = [[rung.get(column) for column in _CSV_COLUMNS] for rung in record["rungs"]]
    rows = [["" if cell is None else str(cell) for cell in row] for row in cells]
    contents = {
        "report.txt": text(cost, name),
        "cost.csv": csv_rows(_CSV_COLUMNS, rows),
        "cost.png": draw(cost, name),
    }
    return write_result(folder, record, contents)


FLOOR = 1e-17
"""Height at which an error of zero is drawn."""


def draw(cost: Cost | SurfaceCost, name: str = "scene") -> Figure:
    """Draw error against time: of a film's methods and solvers, or of a surface's colours and values."""
    parts = [part for part in _parts(cost) if part.kind != "interval" and part.results]
    return matplotlib_figure.draw([_section(part) for part in parts], name)


def _section(part: Comparison) -> Section:
    """Numbered points and the tolerance, the Pareto front joined; an error of zero is drawn at the bottom."""
    shown = sorted((item for item in part.results if np.isfinite(item.error)), key=lambda item: item.seconds)
    if part.kind == "inverse":
        unit, scale, sample = "ms", 1e3, "fit"
        label, tolerance = "mean error of the parameters,\nshare of the bounds", ""
    else:
        (unit, scale), sample = time_unit(part), part.sample
        which = "mean" if sample == "colour" else "largest"
        label = f"{which} {error_label(part)},\nagainst {part.reference}"
        tolerance = f"{error_label(part, f'{part.tolerance:g}')} (tolerance)"
    x = np.array([item.seconds * scale for item in shown])
    y = np.array([max(item.error, FLOOR) for item in shown])
    front = np.array([item.pareto for item in shown], dtype=bool)
    best = np.array([item.name == part.recommended for item in shown], dtype=bool)
    lines = [Line(x[front], y[front], "", "fit", width=1.0)]
    if tolerance:
        lines.append(Line(x[[0, -1]], np.full(2, part.tolerance), tolerance, "blue", "dotted", 0.8))
    groups: tuple[tuple[np.ndarray, str, str, Style], ...] = (
        (front & ~best, "fastest at its accuracy", "fit", "circle"),
        (~front & ~best, "", "data", "circle"),
        (best, "recommended", "fit", "diamond"),
    )
    lines += [Line(x[rows], y[rows], name, colour, style) for rows, name, colour, style in groups]
    notes = [(*place, str(i)) for i, place in enumerate(zip(x, y, strict=True), start=1)]
    key = [f"{i}  {item.name}" for i, item in enumerate(shown, start=1)]
    axes: Any = {"scale": "log", "abscissa": "log", "legend": "above"}
    panel = Panel(label, lines, height=4.0, notes=notes, key=key, **axes)
    return Section(f"time of one {sample} ({unit})", [[panel]])
