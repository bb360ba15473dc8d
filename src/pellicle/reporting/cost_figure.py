"""What accuracy costs, as a figure of error against time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.accuracy.cost import Cost
from pellicle.accuracy.measure import Ladder
from pellicle.accuracy.surface import SurfaceCost
from pellicle.reporting.cost import clock_of, error_of
from pellicle.reporting.drawing import BLUE, GREY, ORANGE, blank, saved

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLOOR = 1e-17
"""Where an error of nothing is drawn."""


def figure(cost: Cost, name: str, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Draw error against time into `path` (.png, .pdf or .svg), complete or not at all."""
    saved(draw(cost, name), path, overwrite=overwrite)


def surface_figure(
    cost: SurfaceCost, name: str, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """The same of a surface: its colours above its values."""
    ladders = [ladder for ladder in (cost.colours, cost.values) if ladder is not None]
    drawn, axes = _panels(len(ladders))
    for at, ladder in zip(axes, ladders, strict=True):
        _panel(at, ladder, name)
    saved(drawn, path, overwrite=overwrite)


def _panels(count: int) -> tuple[Figure, Any]:
    """A figure of panels one above the other."""
    drawn = blank(8.0, 0.4 + 4.6 * count)
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
    for i, (point, rung) in enumerate(zip(seen, rungs, strict=True)):  # neighbours in time: they are sorted
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
