"""Drawable description of a result: panels of lines and bands, and tables, with their units.

`data_panels.py` and `figures.py` build it from results; `matplotlib_figure.py`, `plotly_figure.py` and
`plain_text.py` render it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

GAP = 10
"""A step this many times the median step is a gap in the data, which no line crosses."""
SERIES = "fit", "blue", "green", "fourth"
"""Colours of lines side by side, one for each angle and azimuth."""
CHANNELS = "red", "green", "blue", "fourth"
"""Colours of channels R, G, B and one more."""

Style = Literal["solid", "dashed", "dotted", "point", "circle", "ring", "cross", "diamond"]
Place = Literal["", "inside", "above"]


@dataclass(frozen=True, eq=False)
class Line:
    """A line or markers through points `x`, `y` (points,); NaN interrupts a line.

    `colour` is a name that each renderer knows. A line without a name, or not `listed`, is absent from the
    legend. `model` marks what a rival's own curve is drawn beside. `hints` is a text for each point, and
    `links` what a click on it selects on a page. `errors` are standard errors.
    """

    x: np.ndarray
    y: np.ndarray
    name: str = ""
    colour: str = "data"
    style: Style = "solid"
    width: float = 1.4
    listed: bool = True
    model: bool = False
    errors: np.ndarray | None = None
    hints: Sequence[str] = ()
    links: Sequence[Mapping[str, object]] = ()

    @property
    def markers(self) -> bool:
        """True for markers that no line joins."""
        return self.style not in ("solid", "dashed", "dotted")


@dataclass(frozen=True, eq=False)
class Band:
    """The area between `low` and `high` (points,) above `x`; none where one of them is not finite."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    name: str = ""
    colour: str = "band"
    opacity: float = 0.2
    listed: bool = True


@dataclass(frozen=True, eq=False)
class Raster:
    """Values (ordinate, abscissa) in colours above `x` and `y`: symmetric around 0, or from the least to the
    largest where they are `positive`."""

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    positive: bool = False

    @property
    def limit(self) -> float:
        """The size of the values at the ends of the colours, which few exceed."""
        known = np.abs(self.values[np.isfinite(self.values)])
        return float(np.percentile(known, 99)) if known.size else 1.0


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines and bands on one pair of axes; `label` names the ordinate with its unit.

    A panel without lines and images is empty and shows its title. `legend` is its place, `zero` adds a line
    at 0, `height` is in inches. `scale` "symlog" is linear below `threshold`. `limits` are those of the
    ordinate, `span` those of the abscissa. `ticks` are words at 1, 2, ... of the abscissa, `notes` texts
    (x, y, text) above points, which a `key` beside the panel explains. `spans` are ranges (left, right, name,
    shade) of the abscissa. A `raster` fills the panel. An `image` (2, n, 3) shows patches of data above those
    of the fit, with `captions` on these.
    """

    label: str
    lines: Sequence[Line] = ()
    bands: Sequence[Band] = ()
    height: float = 1.3
    title: str = ""
    legend: Place = ""
    zero: bool = False
    scale: Literal["linear", "log", "symlog"] = "linear"
    abscissa: Literal["linear", "log"] = "linear"
    threshold: float = 1.0
    limits: tuple[float, float] | None = None
    span: tuple[float, float] | None = None
    ticks: Sequence[str] = ()
    notes: Sequence[tuple[float, float, str]] = ()
    spans: Sequence[tuple[float, float, str, float]] = ()
    image: np.ndarray | None = None
    captions: Sequence[str] = ()
    key: Sequence[str] = ()
    raster: Raster | None = None

    @property
    def empty(self) -> bool:
        """True where nothing is drawn."""
        return not self.lines and not self.bands and self.image is None and self.raster is None


@dataclass(frozen=True, eq=False)
class Section:
    """Rows of panels that share one abscissa, and the table of their numbers.

    Panels of one row stand side by side. `title` names the file where there are several.
    """

    abscissa: str
    rows: Sequence[Sequence[Panel]]
    title: str = ""
    table: Table = field(default_factory=lambda: Table({}))

    @property
    def panels(self) -> list[Panel]:
        """All panels that are not empty, row by row."""
        return [panel for row in self.rows for panel in row if not panel.empty]


@dataclass(frozen=True, eq=False)
class Table:
    """Columns (rows,) of numbers or words by name, which contains the unit, and comments above them."""

    columns: Mapping[str, Sequence[float | str | None] | np.ndarray]
    comments: Sequence[str] = ()


def labelled(name: str, unit: str) -> str:
    """`thickness (nm)`, or the name alone of what has no unit."""
    return f"{name} ({unit})" if unit else name


def stroke(
    x: np.ndarray, y: np.ndarray, rows: np.ndarray, turns: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Points `rows` of a line, with NaN between them at wide gaps, and where angles pass 360 degrees.

    **Arguments:** `x` and `y`, (points,); `rows`, indices in the order of the line.
    """
    steps = np.diff(x[rows])
    broken = steps > GAP * np.median(steps) if steps.size else np.zeros(0, dtype=bool)
    if turns:
        broken = broken | (np.abs(np.diff(y[rows])) > 180.0)
    breaks = np.flatnonzero(broken) + 1
    return np.insert(x[rows].astype(float), breaks, np.nan), np.insert(y[rows].astype(float), breaks, np.nan)
