"""Figure of accuracy against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.cost_text import error_label, time_unit
from pellicle.reporting.drawing import BLUE, GREY, ORANGE, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pellicle.accuracy.cost import Cost
    from pellicle.accuracy.measure import Ladder
    from pellicle.accuracy.surface import SurfaceCost

FLOOR = 1e-17
"""Height at which an error of zero is drawn."""


def draw(cost: Cost | SurfaceCost, name: str = "scene") -> Figure:
    """Draw error against time: of a film's methods and solvers, or of a surface's colours and values."""
    from pellicle.accuracy.surface import SurfaceCost

    if isinstance(cost, SurfaceCost):
        ladders = [ladder for ladder in (cost.colours, cost.values) if ladder is not None]
        race = None
    else:
        ladders, race = [cost.ladder], cost.race if cost.race and cost.race.solvers else None
    count = len(ladders) + (race is not None)
    figure = new_figure(8.0, 0.4 + 4.6 * count)
    panels = np.atleast_1d(figure.subplots(count, 1))
    for axes, ladder in zip(panels, ladders, strict=False):
        _methods(axes, ladder, name)
    if race is not None:
        axes = panels[-1]
        _scatter(axes, race.solvers, race.recommended, 1e3)
        axes.set(xlabel="time of one fit (ms)", ylabel="mean error of the parameters, share of the bounds")
    return figure


def _methods(axes: Axes, ladder: Ladder, name: str) -> None:
    unit, scale = time_unit(ladder)
    _scatter(axes, ladder.rungs, ladder.recommended, scale)
    axes.axhline(ladder.tolerance, color=BLUE, linewidth=0.8, linestyle=":")
    which = "mean" if ladder.sample == "colour" else "largest"
    axes.set(
        xlabel=f"time of one {ladder.sample} ({unit})",
        ylabel=f"{which} {error_label(ladder)}, against {ladder.reference}",
        title=name.replace("$", r"\$"),
    )


def _scatter(axes: Axes, items: Sequence[Any], recommended: str | None, scale: float) -> None:
    """Draw points with their names, join the Pareto front, and draw an error of zero at the bottom."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    points = [(item.seconds * scale, max(item.error, FLOOR)) for item in items]
    front = sorted(point for point, item in zip(points, items, strict=True) if item.pareto)
    axes.plot(*zip(*front, strict=True), color=ORANGE, linewidth=1.0, zorder=1)
    for i, (point, item) in enumerate(zip(points, items, strict=True)):  # neighbours in time: they are sorted
        if not np.isfinite(point[1]):
            continue
        colour = ORANGE if item.pareto else GREY
        axes.plot(*point, "D" if item.name == recommended else "o", color=colour, markersize=5)
        axes.annotate(
            item.name,
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
