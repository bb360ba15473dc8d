"""Axes of a map: pixels of an image, sites of a wafer or points of a line, and perhaps a series of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from xarray import Dataset

TIMES = ("time", "t", "frame")
"""Names of an axis of time."""
PIXELS = "pixels"
"""Unit of coordinates that count pixels."""


@dataclass(frozen=True, eq=False)
class Axis:
    """Coordinates of pixels in one direction, `values` (n,) in `unit`."""

    name: str
    unit: str
    values: np.ndarray

    @property
    def label(self) -> str:
        """`x (mm)`."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def step(self) -> float:
        """Median distance of neighbours."""
        steps = np.diff(np.sort(self.values))
        steps = steps[steps > 1e-6 * np.ptp(self.values)]  # sites share coordinates
        return float(np.median(steps)) if steps.size else 1.0

    @property
    def is_even(self) -> bool:
        """True where all steps are equal, within a hundredth of one."""
        steps = np.diff(self.values)
        return bool(np.all(np.abs(steps - steps.mean()) <= 0.01 * abs(steps.mean()))) if steps.size else True

    def number(self, value: float) -> str:
        """Format a coordinate with the digits that tell neighbours apart."""
        off = 0.02 * self.step
        decimals = next(
            (d for d in range(9) if np.all(abs(np.round(self.values, d) - self.values) <= off)), 9
        )
        return f"{value:.{decimals}f}"

    def span(self, first: float, last: float) -> str:
        """`x = 0.2 to 1.4 mm`."""
        low, high = sorted((first, last))
        ends = self.number(low) if low == high else f"{self.number(low)} to {self.number(high)}"
        return f"{self.name} = {ends} {self.unit}".rstrip()

    def edges(self) -> np.ndarray:
        """Borders (n + 1,) of the pixels."""
        middles = (self.values[1:] + self.values[:-1]) / 2
        if not middles.size:
            return self.values[0] + self.step * np.array([-0.5, 0.5])
        return np.concatenate(
            [[2 * self.values[0] - middles[0]], middles, [2 * self.values[-1] - middles[-1]]]
        )


@dataclass(frozen=True, eq=False)
class MapAxes:
    """Axes of a map. `frames` gives its arrays the shape (series, *pixels), one frame if there is no series.

    Images are (y, x). Sites and lines are (x,), sites with a `y` for each.
    """

    kind: str  # "image", "sites" or "line"
    x: Axis
    y: Axis | None
    series: Axis | None
    shape: tuple[int, ...]

    @property
    def points(self) -> str:
        """The word for places of the map: pixels or sites."""
        return "sites" if self.kind == "sites" else "pixels"

    @property
    def downward(self) -> bool:
        """True where y increases downward, as in images; lengths increase upward."""
        return self.y is not None and self.y.unit == PIXELS

    def frames(self, array: np.ndarray) -> np.ndarray:
        """Reshape an array of the map to (series, *pixels)."""
        return np.reshape(array, (-1, *self.shape[-2 if self.kind == "image" else -1 :]))

    def place(self, *index: int) -> str:
        """`x = 1.2, y = 3.4 mm`: coordinates of a pixel of an image (row, column), or of a site."""
        column, row = index[-1], index[0]  # the same of a site
        if self.y is None:
            return self.x.span(*2 * (self.x.values[column],))
        x, y = self.x.number(self.x.values[column]), self.y.number(self.y.values[row])
        unit = "" if self.x.unit == self.y.unit else f" {self.x.unit}"
        return f"{self.x.name} = {x}{unit}, {self.y.name} = {y} {self.y.unit}".rstrip()


def map_axes(dataset: Dataset) -> MapAxes:
    """Find the axes of a map from the dimensions of its variable `status`."""
    status = dataset["status"]
    dims, shape = [str(dim) for dim in status.dims], status.shape
    every = int(dataset.attrs.get("preview", 1))

    def axis(dim: str, coordinate: str | None = None) -> Axis:
        name = coordinate or dim
        if name not in dataset.coords:
            unit = PIXELS if dim in ("x", "y") else ""
            return Axis(dim, unit, np.arange(dataset.sizes[dim], dtype=float) * every)
        values, unit = np.asarray(dataset.coords[name]), str(dataset.coords[name].attrs.get("units", ""))
        if values.dtype.kind == "M":  # seconds since the first
            values, unit = (values - values[0]) / np.timedelta64(1, "s"), "s"
        elif values.dtype.kind not in "iuf":  # names
            values, unit = np.arange(values.size), ""
        elif not unit and values.dtype.kind in "iu":
            unit = PIXELS if name in ("x", "y") else ""
        return Axis(name, unit, np.asarray(values, dtype=float))

    last, on_line = dims[-1], len(dims) == 1 or (len(dims) == 2 and dims[0] in TIMES)
    before = dims[:-1] if on_line else dims[:-2]
    series = None
    if len(before) == 1:
        series = axis(before[0])
    elif before:
        series = Axis(" x ".join(before), "", np.arange(np.prod(shape[: len(before)])))
    if not on_line:
        return MapAxes("image", axis(last), axis(dims[-2]), series, shape)
    if all(name != last and dataset.coords.get(name) is not None for name in ("x", "y")):
        return MapAxes("sites", axis(last, "x"), axis(last, "y"), series, shape)
    return MapAxes("line", axis(last), None, series, shape)
