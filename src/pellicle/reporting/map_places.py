"""Axes of a map, and places of its pixels in words: along the edge, in a patch, in rows, scattered.

A map is an image, sites of a wafer or points of a line, or a series of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.drawable import labelled

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
        return labelled(self.name, self.unit)

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
        enough = (d for d in range(9) if np.all(abs(np.round(self.values, d) - self.values) <= off))
        return f"{value:.{next(enough, 9)}f}"

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
        ends = 2 * self.values[[0, -1]] - middles[[0, -1]]
        return np.concatenate([ends[:1], middles, ends[1:]])


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


MOST = 0.8
"""Share of the pixels that a description must cover."""
MOST_PIXELS = 2_000_000
"""Pixels beyond which the edge is sought on every second, third, ... pixel of each row and column."""
FEW = 3
"""Most pixels, patches or runs that are listed one by one."""
CLUSTERED = 0.15
"""Least excess of neighbours with the same property over that of pixels at random, 0 to 1."""
FILLED = 0.4
"""Least share of others within the rectangle that encloses them, for pixels all around it."""
COVERED = 0.25
"""Share of the band along the edge from which pixels lie along the edge rather than in a patch at it."""
WHOLE = 0.95
"""Share from which a description is not called mostly true."""
DEEP = 0.2
"""Largest depth of that band, as a share of the distance from the edge to the middle."""


def place(marked: np.ndarray, known: np.ndarray, axes: MapAxes) -> str:
    """Describe where pixels are.

    **Arguments:**

    - `marked`: True for the pixels, at least one, in the shape of the map.
    - `known`: True for pixels among which they are: those with data.

    **Returns:** words such as "along the edge" or "in one patch of 84 pixels around x = 1.2, y = 3.4 mm".
    """
    marked, known = axes.frames(marked), axes.frames(known)
    if axes.series is None or len(marked) == 1:
        return _in_frame(marked[0], known[0], axes)
    each = marked.reshape(len(marked), -1).sum(axis=1)
    share = each / np.maximum(known.reshape(len(marked), -1).sum(axis=1), 1)
    whole = _runs(share > 0.5)
    if sum(each[a:b].sum() for a, b in whole) >= MOST * each.sum():
        return "in all pixels at " + _spans(whole, axes.series)
    first, last = np.flatnonzero(each)[[0, -1]]
    when = ""
    if last - first + 1 <= 0.5 * len(marked):
        when = f"at {axes.series.span(*axes.series.values[[first, last]])}, "
    often = marked.sum(axis=0)
    return when + _in_frame(often >= max(0.5 * often.max(), 1), np.any(known, axis=0), axes, counted=False)


def _in_frame(marked: np.ndarray, known: np.ndarray, axes: MapAxes, counted: bool = True) -> str:
    """Describe where pixels of one image, one set of sites or one line are."""
    count = int(marked.sum())
    if count <= FEW and axes.kind != "line":
        return "at " + " and at ".join(axes.place(*index) for index in np.argwhere(marked).tolist())
    if axes.kind == "line":
        runs = sorted(_runs(marked), key=lambda run: run[0] - run[1])[:FEW]
        if sum(b - a for a, b in runs) < MOST * marked.sum():
            return "in scattered pixels"
        return "at " + _spans(sorted(runs), axes.x)
    if axes.kind == "sites":
        # sites far from the centre of all, near it, or neither
        assert axes.y is not None
        x, y = axes.x.values, axes.y.values
        radius = np.hypot(x - (x.min() + x.max()) / 2, y - (y.min() + y.max()) / 2)
        order = np.flatnonzero(known)[np.argsort(radius[known])]
        size = min(int(np.ceil(1.25 * marked.sum())), len(order) // 2)
        for word, end in (("outer", order[::-1][:size]), ("inner", order[:size])):
            if size and marked[end].sum() >= MOST * marked.sum():
                return f"at the {word} sites"
        return "at scattered sites"
    if count == known.sum():
        return "everywhere"
    if around := _around(marked, axes):
        return _edge(marked, known) or around
    return _rows(marked, known, axes) or _edge(marked, known) or _patches(marked, known, axes, counted)


def _around(marked: np.ndarray, axes: MapAxes) -> str:
    """All around one region, as outside a mask, or nothing."""
    border = np.concatenate([marked[0], marked[-1], marked[:, 0], marked[:, -1]])
    rows, columns = (np.flatnonzero(~np.all(marked, axis=i)) for i in (1, 0))
    if border.mean() < WHOLE or not rows.size:
        return ""
    box = marked[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    if box.mean() > 1 - FILLED or box.size > MOST * marked.size:
        return ""
    assert axes.y is not None
    x, y = (axis.span(*axis.values[at[[0, -1]]]) for axis, at in ((axes.x, columns), (axes.y, rows)))
    return f"all around {x}, {y}"


def _rows(marked: np.ndarray, known: np.ndarray, axes: MapAxes) -> str:
    """Whole rows or columns, or nothing; those at a border of the image are along an edge."""
    assert axes.y is not None
    top, bottom = ("top", "bottom") if axes.downward else ("bottom", "top")
    for along, word, axis, ends in (
        (1, "row", axes.y, (top, bottom)),
        (0, "column", axes.x, ("left", "right")),
    ):
        each = marked.sum(axis=along)
        runs = _runs(each > 0.5 * np.maximum(known.sum(axis=along), 1))
        covered = sum(each[a:b].sum() for a, b in runs) / marked.sum()
        if covered < MOST:
            continue
        mostly = _mostly(covered)
        if len(runs) > FEW:
            return f"{mostly}in {sum(b - a for a, b in runs)} {word}s"
        if len(runs) == 1:
            [(first, last)] = runs
            edges = [end for end, at in zip(ends, (first == 0, last == each.size), strict=True) if at]
            if len(edges) == 1:
                return f"{mostly}along the {edges[0]} edge, {_spans(runs, axis)}"
        number = sum(b - a for a, b in runs)
        count = "one" if number == 1 else number
        return f"{mostly}in {count} {word}{'s' * (number > 1)}, {_spans(runs, axis)}"
    return ""


def _edge(marked: np.ndarray, known: np.ndarray) -> str:
    """Along the border of the pixels with data, or nothing."""
    from scipy.ndimage import binary_fill_holes, distance_transform_edt  # slow to import

    step = int(np.ceil(np.sqrt(marked.size / MOST_PIXELS)))  # distances take 30 bytes a pixel
    marked, known = marked[::step, ::step], known[::step, ::step]
    if not marked.any():
        return ""
    inside = np.asarray(binary_fill_holes(known))
    depth = np.asarray(distance_transform_edt(np.pad(inside, 1)))[1:-1, 1:-1]
    for covered in (0.97, 0.85):
        reach = np.quantile(depth[marked], covered)
        band = inside & (depth <= reach)
        if reach <= max(2.0, DEEP * depth.max()) and (marked & band).sum() >= COVERED * band.sum():
            return _mostly(covered) + "along the edge"
    return ""


def _patches(marked: np.ndarray, known: np.ndarray, axes: MapAxes, counted: bool) -> str:
    """One patch, a few, many, or pixels scattered at random."""
    from scipy.ndimage import convolve, find_objects, label  # slow to import

    x_axis, y_axis = axes.x, axes.y
    assert y_axis is not None
    ring = np.ones((3, 3), np.uint8)
    ring[1, 1] = 0
    around = convolve(marked.astype(np.uint8), ring, mode="constant")[marked].sum()
    neighbours = convolve(known.astype(np.uint8), ring, mode="constant")[marked].sum()
    density = marked.sum() / known.sum()
    if around / max(neighbours, 1) - density < CLUSTERED * (1 - density):
        return "in scattered pixels"
    labelled: Any = label(marked, np.ones((3, 3)))
    labels, number = labelled
    sizes = np.bincount(labels.ravel())[1:]
    largest = np.argsort(-sizes)
    boxes = find_objects(labels)
    listed = next((n for n in range(1, FEW + 1) if sizes[largest[:n]].sum() >= MOST * marked.sum()), 0)
    if not listed:
        return f"in {number} patches of up to {sizes.max()} pixels"

    def described(which: int) -> str:
        rows, columns = boxes[which]
        size = f"of {sizes[which]} pixels " if counted else ""
        if sizes[which] >= 0.4 * (rows.stop - rows.start) * (columns.stop - columns.start):
            middle = [round(float(np.mean(i))) for i in np.nonzero(labels == which + 1)]
            return f"{size}around {axes.place(*middle)}"
        x = x_axis.span(*x_axis.values[[columns.start, columns.stop - 1]])
        return f"{size}at {x}, {y_axis.span(*y_axis.values[[rows.start, rows.stop - 1]])}"

    texts = " and ".join(described(i) for i in largest[:listed].tolist())
    mostly = _mostly(sizes[largest[:listed]].sum() / marked.sum())
    return f"{mostly}in one patch {texts}" if listed == 1 else f"{mostly}in {listed} patches, {texts}"


def _mostly(covered: float) -> str:
    return "" if covered >= WHOLE else "mostly "


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Start and end of each run of True."""
    steps = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(steps[::2], steps[1::2], strict=True)]


def _spans(runs: list[tuple[int, int]], axis: Axis) -> str:
    return " and ".join(axis.span(axis.values[a], axis.values[b - 1]) for a, b in runs)
