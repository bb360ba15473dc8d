"""What accuracy costs, as text for people."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from pellicle.accuracy.cost import Cost
from pellicle.accuracy.interval_coverage import Intervals
from pellicle.accuracy.measure import Ladder
from pellicle.accuracy.solver_comparison import Race
from pellicle.accuracy.surface import SurfaceCost
from pellicle.reporting.plain_text import COLUMNS


def text(cost: Cost, name: str) -> str:
    """Both tables, what was left out and why, and what is recommended."""
    blocks = [_ladder(cost.ladder, name)]
    if cost.race is None:
        blocks.append(f"No fits: {cost.no_race}.\n")
    else:
        blocks.append(_race(cost.race))
    if cost.intervals is not None:
        blocks.append(_intervals(cost.intervals))
    if cost.interrupted:
        blocks.append("Interrupted: this is what was measured until then.\n")
    return "\n".join(blocks)


def surface_text(cost: SurfaceCost, name: str) -> str:
    """The table of colours, if there are any, and that of values."""
    blocks = [] if cost.colours is None else [_ladder(cost.colours, name)]
    blocks.append(_ladder(cost.values, name))
    if cost.no_colours:
        blocks.append(f"No colours: {cost.no_colours}.\n")
    if cost.interrupted:
        blocks.append("Interrupted: this is what was measured until then.\n")
    return "\n".join(blocks)


def error_of(ladder: Ladder, size: str = "") -> str:
    """What the errors are, or one of this size, with their unit."""
    of = f" of {size}" if size else ""
    if ladder.unit == "relative":
        return f"relative error{of}"
    if size and ladder.unit == "degrees":
        return f"error{of} degrees"
    return f"error{of} in {ladder.unit}"


def clock_of(ladder: Ladder) -> tuple[str, float]:
    """The unit of the times of one sample, and how many of them a second has."""
    return ("µs", 1e6) if ladder.sample == "spectrum" else ("ns", 1e9)


def _about(ladder: Ladder) -> str:
    if ladder.sample != "spectrum":
        seen = f"{ladder.wavelengths} {'angles' if ladder.sample == 'colour' else 'pairs of directions'}"
        which = "mean" if ladder.sample == "colour" else "largest"
        return f"{ladder.draws} surfaces between the bounds along {seen}, the {which} error"
    several = "s" * (ladder.wavelengths > 1)
    draws = "draws between the bounds" if ladder.draws > 1 else "spectrum"
    return f"{ladder.wavelengths} wavelength{several}, the largest error of {ladder.draws} {draws}"


def _ladder(ladder: Ladder, name: str) -> str:
    clock, scale = clock_of(ladder)
    few, more = (2, 1) if scale < 1e9 else (0, 2)
    columns: _Columns = {
        "rung": lambda rung: rung.name,
        "leaves out": lambda rung: rung.leaves_out,
        error_of(ladder): lambda rung: f"{rung.error:.1e}",
        f"{clock}/{ladder.sample}": lambda rung: f"{rung.seconds * scale:.{few}f}",
        "compile s": lambda rung: f"{rung.compile_seconds:.2f}",
        "kflop": lambda rung: "" if rung.flops is None else f"{rung.flops / 1e3:.{more}f}",
    }
    found = ladder.recommended
    size = error_of(ladder, f"{ladder.tolerance:g}")
    within = f"{'a' if size.startswith('r') else 'an'} {size}"
    advice = f"{found} is the fastest within {within}"
    if not ladder.within:
        advice = f"no rung is within {within}; {found} comes nearest"
    said = f"{name}: {_about(ladder)} against {ladder.reference}"
    notes = ["* no other is both faster and as accurate", f"→ {advice}", *_left_out(ladder.left_out)]
    return _block(said, ladder.rungs, found, columns, notes)


def _race(race: Race) -> str:
    count = max((solver.datasets for solver in race.solvers), default=0)
    said = (
        f"Fits of {count} simulated spectra with noise {race.noise:g}, their truths anywhere between the "
        "bounds; errors as a share of the bounds"
    )
    columns: _Columns = {
        "solver": lambda solver: solver.name,
        "leaves out": lambda solver: solver.leaves_out,
        "failed": lambda solver: f"{solver.failures}/{solver.datasets}",
        "mean error": lambda solver: f"{solver.error:.1e}",
        "median": lambda solver: f"{solver.median_error:.1e}",
        "ms/fit": lambda solver: f"{solver.seconds * 1e3:.1f}",
        "compile s": lambda solver: f"{solver.compile_seconds:.1f}",
    }
    advice = [f"→ {race.recommended} is the fastest of those that failed least"] if race.solvers else []
    return _block(said, race.solvers, race.recommended, columns, [*advice, *_left_out(race.left_out)])


def _intervals(found: Intervals) -> str:
    count = max((way.datasets for way in found.ways), default=0)
    said = (
        f"95 % intervals of the same {count} data sets: how often they hold a parameter's truth, how wide "
        "they are as a share of the bounds, and their time after the fit"
    )
    columns: _Columns = {
        "interval": lambda way: way.name,
        "leaves out": lambda way: way.leaves_out,
        "holds the truth": lambda way: f"{100 * way.coverage:.0f} ± {100 * way.doubt:.0f} %",
        "width": lambda way: f"{way.width:.1e}",
        "ms": lambda way: f"{way.seconds * 1e3:.1f}",
        "compile s": lambda way: f"{way.compile_seconds:.1f}",
    }
    best = f"→ {found.recommended} is the fastest whose share is 95 % within two standard deviations"
    notes = [*([best] if found.ways else []), *_left_out(found.left_out)]
    return _block(said, found.ways, found.recommended, columns, notes)


_Columns = Mapping[str, Callable[[Any], str]]
"""What a table says of each of those compared, under its head."""


def _block(
    said: str, compared: Sequence[Any], recommended: str | None, columns: _Columns, notes: Sequence[str]
) -> str:
    """What is compared, the table, and what follows from it."""
    rows = [(_mark(each, recommended), *(tell(each) for tell in columns.values())) for each in compared]
    table = _aligned([("", *columns), *rows], left=3)
    return "\n".join([*textwrap.wrap(said, COLUMNS), "", *table, "", *notes]) + "\n"


def _mark(rung: Any, recommended: str | None) -> str:
    return ("→" if rung.name == recommended else " ") + ("*" if rung.pareto else " ")


def _aligned(rows: Sequence[tuple[str, ...]], left: int) -> Iterable[str]:
    """Columns, the first `left` of them flush left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = enumerate(zip(row, widths, strict=True))
        line = (cell.ljust(w) if i < left else cell.rjust(w) for i, (cell, w) in cells)
        yield "  ".join(line).rstrip()


def _left_out(given: Mapping[str, str]) -> list[str]:
    """One paragraph for each reason."""
    reasons: dict[str, list[str]] = {}
    for name, why in given.items():
        reasons.setdefault(why, []).append(name)
    told = [f"not here: {', '.join(names)}: {why}" for why, names in reasons.items()]
    return [line for one in told for line in textwrap.wrap(one, COLUMNS, subsequent_indent="    ")]
