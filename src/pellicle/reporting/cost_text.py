"""Report of accuracy against time: tables of methods, of solvers and of intervals."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pellicle.reporting.plain_text import COLUMNS

if TYPE_CHECKING:
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
    return f"error{of} in {'Mueller elements' if methods.unit == 'mueller' else methods.unit}"


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
