"""What every figure needs around its panels: a sheet, and a file that appears whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pellicle.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

import numpy as np


def blank(width: float, height: float, constrained: bool = True) -> Figure:
    """An empty figure (inches), bound to no window and to no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(width, height), layout="constrained" if constrained else None)
    FigureCanvasAgg(drawn)
    return drawn


def saved(
    drawn: Figure,
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    dpi: float = 150,
    bbox_inches: str | None = None,
) -> Path:
    """Write a figure into `path` (.png, .pdf or .svg), which is returned.

    Raises UsageError where it exists, without `overwrite`, or cannot be written.
    """
    target = Path(path)
    with replacing(target, overwrite=overwrite) as draft:
        drawn.savefig(draft, dpi=dpi, bbox_inches=bbox_inches)
    return target


BLACK, ORANGE, BLUE, GREEN, GREY = "#000000", "#D55E00", "#0072B2", "#009E73", "#777777"
"""Okabe and Ito's colours, which the colour-blind tell apart."""


FITTED = {"color": ORANGE, "linewidth": 1.4}


GAP = 10
"""A step this many times the usual one is a gap in the data, which no line crosses."""


def marker_size(points: int) -> float:
    """The size (points) of a marker that leaves room between as many of them."""
    return float(np.clip(900 / max(points, 1), 1.5, 4.0))
