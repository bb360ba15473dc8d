"""What every figure needs around its panels: a sheet, and a file that appears whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pellicle.io.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
