"""Report, JSON record, table, figure and folder of accuracy against time."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.accuracy.registry import Comparison, Cost
from pellicle.reporting import matplotlib_figure
from pellicle.reporting.drawable import Line, Panel, Section, Style
from pellicle.reporting.json_record import taken, versions, write_result
from pellicle.reporting.plain_text import COLUMNS, aligned, csv_rows
from pellicle.signals.registry import KINDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_Columns = Mapping[str, Callable[[Any], str]]
"""The cell of each column, by its head."""


def text(cost: Cost, name: str = "scene") -> str:
    """Format each table with the recommended row, and the reason for what was left out."""
    blocks = [_table(part, name) for part in cost.parts]
    absent = (("colours", cost.no_colours), ("fits", cost.no_solvers))
    blocks += [f"No {what}: {why}.\n" for what, why in absent if why]
    if cost.interrupted:
        blocks.append("Interrupted: these are the measurements until then.\n")
    elif any(_done(part) < part.requested for part in cost.parts):
        blocks.append("The time limit ended the data sets early: --time-limit 600 allows ten minutes.\n")
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


def _table(part: Comparison, name: str) -> str:
    """A title, aligned columns (a mark and two names flush left), notes, and a paragraph for each reason why
    methods were left out."""
    on_data = part.kind in ("inverse", "interval")
    title, columns, notes = _on_data(part) if on_data else _methods(part, name)
    rows = [("", *columns)]
    for result in part.results:
        mark = ("→" if result.name == part.recommended else " ") + ("*" if result.pareto else " ")
        rows.append((mark, *(cell(result) for cell in columns.values())))
    reasons: dict[str, list[str]] = {}
    for method, why in part.left_out.items():
        reasons.setdefault(why, []).append(method)
    lines = [*textwrap.wrap(title, COLUMNS), "", *aligned(rows, left=3), "", *notes]
    for why, names in reasons.items():
        omitted = f"left out: {', '.join(names)}: {why}"
        lines += textwrap.wrap(omitted, COLUMNS, subsequent_indent="    ")
    return "\n".join(lines) + "\n"


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
    several, colours = "s" * (methods.wavelengths > 1), methods.sample == "colour"
    draws = "draws between the bounds" if methods.draws > 1 else "spectrum"
    about = f"{methods.wavelengths} wavelength{several}, the largest error of {methods.draws} {draws}"
    if methods.sample != "spectrum":
        each = f"{methods.wavelengths} {'angles' if colours else 'pairs of directions'}"
        which = "mean" if colours else "largest"
        about = f"{methods.draws} draws between the bounds along {each}, the {which} error"
    title = f"{name}: {about} against {methods.reference}"
    return title, columns, ["* no other method is both faster and as accurate", f"→ {advice}"]


def _done(comparison: Comparison) -> int:
    """Number of data sets that were fitted; 0 of methods of simulation, which have none."""
    return max((result.details.get("datasets", 0) for result in comparison.results), default=0)


def _on_data(part: Comparison) -> tuple[str, _Columns, list[str]]:
    """Title, columns and advice of solvers or intervals, with the number of their data sets, and of how many
    where the time limit or Ctrl-C ended them."""
    done = _done(part)
    count = f"{done}" if done == part.requested else f"{done} (of {part.requested})"
    if part.kind == "inverse":
        name, unit, best = "solver", "ms/fit", "of those that failed least"
        title = (
            f"Fits of {count} simulated spectra with noise {part.noise:g}, their true values"
            " anywhere between the bounds; errors as a share of the bounds"
        )
        errors: _Columns = {
            "failed": lambda one: f"{one.details['failures']}/{one.details['datasets']}",
            "mean error": lambda one: f"{one.error:.1e}",
            "median": lambda one: f"{one.details['median_error']:.1e}",
        }
    else:
        name, unit, best = "interval", "ms", "whose coverage is 95 % within two standard deviations"
        title = (
            f"95 % intervals of {count} of these data sets: share that contains the true value,"
            " width as a share of the bounds, and time after the fit"
        )
        errors = {
            "coverage": lambda one: (
                f"{100 * one.details['coverage']:.0f} ± {100 * one.details['doubt']:.0f} %"
            ),
            "width": lambda one: f"{one.details['width']:.1e}",
        }
    columns: _Columns = {
        name: lambda one: one.name,
        "leaves out": lambda one: one.leaves_out,
        **errors,
        unit: lambda one: f"{one.seconds * 1e3:.1f}",
        "compile s": lambda one: f"{one.compile_seconds:.1f}",
    }
    return title, columns, [f"→ {part.recommended} is the fastest {best}"] if part.results else []


_SUMMARY = ("reference", "tolerance", "unit", "recommended", "within")
_CSV_COLUMNS = (
    *("kind", "name", "leaves_out", "error", "seconds", "compile_seconds", "flops", "pareto"),
    *("median_error", "failures", "datasets", "coverage", "doubt", "width"),
)


def to_json(cost: Cost, recipe: str) -> dict[str, Any]:
    """Convert to dictionaries: all methods in one list, `rungs`, each with its `kind`.

    Kinds of a film are "forward", "inverse" (a solver) and "interval" (its error is the distance of its
    coverage from 95 %), or of its colours "colour" (mean ΔE2000); of a surface "colour" and "brdf" (relative
    error). `recommended` names a forward method, or one for colours; `within` says whether it meets the
    tolerance. `brdf` has the same keys for a surface's values. Infinite errors are None.
    """
    parts, of_film = cost.parts, cost.values is None
    record = {
        "schema": "pellicle.cost/1",
        "recipe": recipe,
        **taken(parts[0], *_SUMMARY, *(["wavelengths"] if of_film else ()), "draws"),
        "rungs": [{"kind": part.kind, **result.record()} for part in parts for result in part.results],
    }
    left_out = {name: why for part in parts for name, why in part.left_out.items()}
    if of_film:
        record |= {
            "recommended_solver": getattr(cost.solvers, "recommended", None),
            "recommended_interval": getattr(cost.intervals, "recommended", None),
            "noise": getattr(cost.solvers, "noise", None),
            "left_out": left_out,
            "no_fits": cost.no_solvers or None,
        }
    else:
        record["brdf"] = taken(cost.values, *_SUMMARY)
        record |= {"left_out": left_out, "no_colours": cost.no_colours or None}
    return record | {"interrupted": cost.interrupted, "versions": versions()}


def write_cost(folder: str | os.PathLike[str], cost: Cost, recipe: str = "scene") -> Path:
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


def draw(cost: Cost, name: str = "scene") -> Figure:
    """Draw error against time: of a film's methods and solvers, or of a surface's colours and values."""
    parts = [part for part in cost.parts if part.kind != "interval" and part.results]
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
