"""Figure of accuracy against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.cost_text import error_label, time_unit
from pellicle.reporting.label_placement import Label, place_labels
from pellicle.reporting.matplotlib_figure import ABOVE, BLUE, GREY, ORANGE, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pellicle.accuracy.cost import Cost
    from pellicle.accuracy.registry import Comparison
    from pellicle.accuracy.surface import SurfaceCost

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
    count = len(kinds) + (solvers is not None)
    figure = new_figure(8.0, 0.4 + 4.6 * count)
    panels = np.atleast_1d(figure.subplots(count, 1))
    labels = [_methods(axes, methods, name) for axes, methods in zip(panels, kinds, strict=False)]
    if solvers is not None:
        axes = panels[-1]
        labels.append(_scatter(axes, solvers.results, solvers.recommended, 1e3))
        axes.set(xlabel="time of one fit (ms)", ylabel="mean error of the parameters,\nshare of the bounds")
    figure.draw_without_rendering()  # gives the panels the size in which labels are placed
    for axes, names in zip(panels, labels, strict=True):
        place_labels(axes, names)
    return figure


def _methods(axes: Axes, methods: Comparison, name: str) -> list[Label]:
    """Draw methods of simulation, and return the labels of their points."""
    unit, scale = time_unit(methods)
    labels = _scatter(axes, methods.results, methods.recommended, scale)
    label = f"{error_label(methods, f'{methods.tolerance:g}')} (tolerance)"
    axes.axhline(methods.tolerance, color=BLUE, linewidth=0.8, linestyle=":", label=label)
    axes.legend(**ABOVE, fontsize="x-small")
    which = "mean" if methods.sample == "colour" else "largest"
    axes.set(
        xlabel=f"time of one {methods.sample} ({unit})",
        ylabel=f"{which} {error_label(methods)},\nagainst {methods.reference}",
    )
    axes.set_title(name.replace("$", r"\$"), loc="left", fontsize="medium")
    return labels


def _scatter(axes: Axes, items: Sequence[Any], recommended: str | None, scale: float) -> list[Label]:
    """Draw points, join the Pareto front, and draw an error of zero at the bottom; return their labels."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    points = [(item.seconds * scale, max(item.error, FLOOR)) for item in items]
    front = sorted(point for point, item in zip(points, items, strict=True) if item.pareto)
    axes.plot(*zip(*front, strict=True), color=ORANGE, linewidth=1.0, zorder=1)
    labels = []
    for point, item in zip(points, items, strict=True):
        if not np.isfinite(point[1]):
            continue
        colour = ORANGE if item.pareto else GREY
        axes.plot(*point, "D" if item.name == recommended else "o", color=colour, markersize=5)
        labels.append(Label(item.name, *point, colour))
    axes.set(xscale="log", yscale="log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.margins(x=0.14, y=0.1)
    axes.grid(alpha=0.2)
    return labels
