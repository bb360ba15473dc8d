"""Figure setup, colours and files, shared by all figures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
BLACK, ORANGE, BLUE, GREEN, GREY = "#000000", "#D55E00", "#0072B2", "#009E73", "#777777"
"""Okabe and Ito's colours, which the colour-blind can distinguish."""
FITTED = {"color": ORANGE, "linewidth": 1.4}
ABOVE: dict[str, Any] = {
    "frameon": False,
    "loc": "lower right",
    "bbox_to_anchor": (1, 1),
    "borderaxespad": 0,
}
"""Place of a legend above its panel, where it hides nothing."""
GAP = 10
"""A step this many times the median step is a gap in the data, which no line crosses."""


def new_figure(width: float, height: float, constrained: bool = True) -> Figure:
    """Make an empty figure (inches) without a window or pyplot's global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    layout: Any = "constrained" if constrained else "none"  # "none" is missing in Matplotlib's types
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def save_figure(
    figure: Figure,
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    dpi: float = 150,
    bbox_inches: str | None = None,
) -> Path:
    """Write a figure into `path` (.png, .pdf or .svg), complete or not at all, and return the path.

    Raises UsageError where the file exists, without `overwrite`, or cannot be written.
    """
    target = Path(path)
    with replacing(target, overwrite=overwrite) as draft:
        figure.savefig(draft, dpi=dpi, bbox_inches=bbox_inches)
    return target


def figure_path(path: str | os.PathLike[str]) -> Path:
    """The path of a figure that is to be written. Raises UsageError for another file type."""
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise UsageError(f"`path` {target}: expected a name ending in {', '.join(FORMATS)}")
    return target


def marker_size(points: int) -> float:
    """Size of a marker in points that leaves room between this many of them."""
    return float(np.clip(900 / max(points, 1), 1.5, 4.0))
