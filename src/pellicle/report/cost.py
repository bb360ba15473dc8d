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
from pellicle.ladder.race import Race
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
    if cost.interrupted:
        blocks.append("Interrupted: this is what was measured until then.\n")
    return "\n".join(blocks)


def unit_of(ladder: Ladder) -> str:
    """The unit of the errors, as it is written behind a number."""
    return " degrees" if ladder.unit == "degrees" else f" in {ladder.unit}"


def _ladder(ladder: Ladder, name: str) -> str:
    several = "s" * (ladder.wavelengths > 1)
    draws = "draws between the bounds" if ladder.draws > 1 else "spectrum"
    said = (
        f"{name}: {ladder.wavelengths} wavelength{several}, the largest error of {ladder.draws} {draws} "
        f"against {ladder.reference}"
    )
    rows = [("", "rung", "leaves out", f"error in {ladder.unit}", "µs/spectrum", "compile s", "kflop")]
    rows += [
        (
            _mark(rung, ladder.recommended),
            rung.name,
            rung.leaves_out,
            f"{rung.error:.1e}",
            f"{rung.seconds * 1e6:.2f}",
            f"{rung.compile_seconds:.2f}",
            "" if rung.flops is None else f"{rung.flops / 1e3:.1f}",
        )
        for rung in ladder.rungs
    ]
    found = ladder.recommended
    within = f"an error of {ladder.tolerance:g}{unit_of(ladder)}"
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


def draw(cost: Cost, name: str) -> Figure:
    """The figure itself, bound to no window and to no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    raced = cost.race is not None and bool(cost.race.solvers)
    drawn = Figure(figsize=(8.0, 9.6 if raced else 5.0), layout="constrained")
    FigureCanvasAgg(drawn)
    axes = np.atleast_1d(drawn.subplots(2 if raced else 1, 1))
    ladder = cost.ladder
    _scatter(axes[0], ladder.rungs, ladder.recommended, 1e6)
    axes[0].axhline(ladder.tolerance, color=BLUE, linewidth=0.8, linestyle=":")
    axes[0].set(
        xlabel="time of one spectrum (µs)",
        ylabel=f"largest error in {ladder.unit}, against {ladder.reference}",
        title=name.replace("$", r"\$"),
    )
    if raced:
        assert cost.race is not None
        _scatter(axes[1], cost.race.solvers, cost.race.recommended, 1e3)
        axes[1].set(xlabel="time of one fit (ms)", ylabel="mean error of the parameters, share of the bounds")
    return drawn


def _scatter(axes: Axes, rungs: Sequence[Any], recommended: str | None, scale: float) -> None:
    """Points with their names, the Pareto front joined, an error of nothing at the foot."""
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
    axes.margins(x=0.12, y=0.08)
    axes.grid(alpha=0.2)
