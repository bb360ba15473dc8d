"""What accuracy costs, as text for people and as a figure of error against time."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.io.atomic import replacing
from pellicle.ladder.climb import Ladder
from pellicle.ladder.cost import Cost
from pellicle.ladder.intervals import Intervals
from pellicle.ladder.race import Race
from pellicle.ladder.surface import SurfaceCost
from pellicle.report.style import BLUE, GREY, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 100
DPI = 150
FLOOR = 1e-17
"""Where an error of nothing is drawn."""


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
    said = f"{name}: {_about(ladder)} against {ladder.reference}"
    clock, scale = clock_of(ladder)
    timed = f"{clock}/{ladder.sample}"
    rows = [("", "rung", "leaves out", error_of(ladder), timed, "compile s", "kflop")]
    rows += [
        (
            _mark(rung, ladder.recommended),
            rung.name,
            rung.leaves_out,
            f"{rung.error:.1e}",
            f"{rung.seconds * scale:.{2 if scale < 1e9 else 0}f}",
            f"{rung.compile_seconds:.2f}",
            "" if rung.flops is None else f"{rung.flops / 1e3:.{1 if scale < 1e9 else 2}f}",
        )
        for rung in ladder.rungs
    ]
    found = ladder.recommended
    size = error_of(ladder, f"{ladder.tolerance:g}")
    within = f"{'a' if size.startswith('r') else 'an'} {size}"
    advice = f"→ {found} is the fastest within {within}"
    if not ladder.within:
        advice = f"→ no rung is within {within}; {found} comes nearest"
    notes = ["* no other is both faster and as accurate", advice, *_left_out(ladder.left_out)]
    table = _aligned(rows, left=3)
    return "\n".join([*textwrap.wrap(said, COLUMNS), "", *table, "", *notes]) + "\n"


def _race(race: Race) -> str:
    count = max((solver.datasets for solver in race.solvers), default=0)
    said = (
        f"Fits of {count} simulated spectra with noise {race.noise:g}, their truths anywhere between the "
        "bounds; errors as a share of the bounds"
    )
    rows = [("", "solver", "leaves out", "failed", "mean error", "median", "ms/fit", "compile s")]
    rows += [
        (
            _mark(solver, race.recommended),
            solver.name,
            solver.leaves_out,
            f"{solver.failures}/{solver.datasets}",
            f"{solver.error:.1e}",
            f"{solver.median_error:.1e}",
            f"{solver.seconds * 1e3:.1f}",
            f"{solver.compile_seconds:.1f}",
        )
        for solver in race.solvers
    ]
    advice = f"→ {race.recommended} is the fastest of those that failed least"
    lines = [*textwrap.wrap(said, COLUMNS), "", *_aligned(rows, left=3), ""]
    return "\n".join([*lines, *([advice] if race.solvers else []), *_left_out(race.left_out)]) + "\n"


def _intervals(found: Intervals) -> str:
    count = max((way.datasets for way in found.ways), default=0)
    said = (
        f"95 % intervals of the same {count} data sets: how often they hold a parameter's truth, how wide "
        "they are as a share of the bounds, and their time after the fit"
    )
    rows = [("", "interval", "leaves out", "holds the truth", "width", "ms", "compile s")]
    rows += [
        (
            _mark(way, found.recommended),
            way.name,
            way.leaves_out,
            f"{100 * way.coverage:.0f} ± {100 * way.doubt:.0f} %",
            f"{way.width:.1e}",
            f"{way.seconds * 1e3:.1f}",
            f"{way.compile_seconds:.1f}",
        )
        for way in found.ways
    ]
    advice = f"→ {found.recommended} is the fastest whose share is 95 % within two standard deviations"
    lines = [*textwrap.wrap(said, COLUMNS), "", *_aligned(rows, left=3), ""]
    return "\n".join([*lines, *([advice] if found.ways else []), *_left_out(found.left_out)]) + "\n"


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


def figure(cost: Cost, name: str, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Draw error against time into `path` (.png, .pdf or .svg), complete or not at all."""
    with replacing(path, overwrite=overwrite) as draft:
        draw(cost, name).savefig(draft, dpi=DPI)


def surface_figure(
    cost: SurfaceCost, name: str, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """The same of a surface: its colours above its values."""
    ladders = [ladder for ladder in (cost.colours, cost.values) if ladder is not None]
    drawn, axes = _panels(len(ladders))
    for at, ladder in zip(axes, ladders, strict=True):
        _panel(at, ladder, name)
    with replacing(path, overwrite=overwrite) as draft:
        drawn.savefig(draft, dpi=DPI)


def _panels(count: int) -> tuple[Figure, Any]:
    """A figure, bound to no window and to no global state, of panels one above the other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(8.0, 0.4 + 4.6 * count), layout="constrained")
    FigureCanvasAgg(drawn)
    return drawn, np.atleast_1d(drawn.subplots(count, 1))


def _panel(axes: Axes, ladder: Ladder, name: str) -> None:
    clock, scale = clock_of(ladder)
    _scatter(axes, ladder.rungs, ladder.recommended, scale)
    axes.axhline(ladder.tolerance, color=BLUE, linewidth=0.8, linestyle=":")
    which = "mean" if ladder.sample == "colour" else "largest"
    axes.set(
        xlabel=f"time of one {ladder.sample} ({clock})",
        ylabel=f"{which} {error_of(ladder)}, against {ladder.reference}",
        title=name.replace("$", r"\$"),
    )


def draw(cost: Cost, name: str) -> Figure:
    """The figure itself."""
    raced = cost.race is not None and bool(cost.race.solvers)
    drawn, axes = _panels(2 if raced else 1)
    _panel(axes[0], cost.ladder, name)
    if raced:
        assert cost.race is not None
        _scatter(axes[1], cost.race.solvers, cost.race.recommended, 1e3)
        axes[1].set(xlabel="time of one fit (ms)", ylabel="mean error of the parameters, share of the bounds")
    return drawn


def _scatter(axes: Axes, rungs: Sequence[Any], recommended: str | None, scale: float) -> None:
    """Points with their names, the Pareto front joined, an error of nothing at the foot."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    seen = [(rung.seconds * scale, max(rung.error, FLOOR)) for rung in rungs]
    front = sorted(point for point, rung in zip(seen, rungs, strict=True) if rung.pareto)
    axes.plot(*zip(*front, strict=True), color=ORANGE, linewidth=1.0, zorder=1)
    for i, (point, rung) in enumerate(
        zip(seen, rungs, strict=True)
    ):  # neighbours in time, as they are sorted
        if not np.isfinite(point[1]):
            continue
        colour = ORANGE if rung.pareto else GREY
        axes.plot(*point, "D" if rung.name == recommended else "o", color=colour, markersize=5)
        axes.annotate(
            rung.name,
            point,
            xytext=(5, -8 if i % 2 else 3),
            textcoords="offset points",
            fontsize="x-small",
            color=colour,
        )
    axes.set(xscale="log", yscale="log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.margins(x=0.12, y=0.08)
    axes.grid(alpha=0.2)
