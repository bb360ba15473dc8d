"""Figure of accuracy against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting import matplotlib_figure
from pellicle.reporting.cost_text import error_label, time_unit
from pellicle.reporting.drawable import Line, Panel, Section, Style

if TYPE_CHECKING:
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
    sections = [_methods(methods) for methods in kinds]
    if solvers is not None:
        label = "mean error of the parameters,\nshare of the bounds"
        panel = _panel(solvers.results, solvers.recommended, 1e3, label)
        sections.append(Section("time of one fit (ms)", [[panel]]))
    return matplotlib_figure.draw(sections, name)


def _methods(methods: Comparison) -> Section:
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
