"""Panels of the figures of a map: values in colours, hatching by status, statuses, histograms.

Pixels of a large map are drawn in blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.batch.data import CODES, NO_DATA, STATUSES
from pellicle.reporting.drawable import labelled
from pellicle.reporting.map_places import MapAxes
from pellicle.reporting.map_summary import DECIDED, MapSummary, is_decided, parameter_name, thinned, unit_of
from pellicle.reporting.map_text import share
from pellicle.reporting.matplotlib_figure import ABOVE, BLACK, BLUE, GREY, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from xarray import DataArray, Dataset

VALUES, ERRORS = "viridis", "cividis"
"""Perceptually uniform colour maps, which the colour-blind can read."""
WIDE = 20.0
"""Ratio of the 98th and 2nd percentiles of standard errors from which their colours are logarithmic."""
SPOT = 60.0
"""Area of the circle of a site, in square points, where there are few."""
FLAT = 0.12
"""Ratio of height and width below which an image is stretched."""
COLOURS = {
    NO_DATA: "#FFFFFF",
    "failed": "#000000",
    "not-converged": "#777777",
    "misfit": "#D55E00",
    "not-identifiable": "#CC79A7",
    "ambiguous": "#E69F00",
    "at-bound": "#F0E442",
    "converged": "#C6DCEC",
    "by-neighbours": "#56B4E9",
}
"""Colours of the statuses: Okabe and Ito's, pale where all is well."""
HATCHES = {
    "failed": "++++",
    "not-converged": "||||",
    "misfit": "xxxx",
    "not-identifiable": "....",
    "ambiguous": "////",
    "at-bound": "----",
}
"""Hatching of pixels whose numbers should not be used."""
PALE, DARK = 0.88, 0.55
"""Greys of the hatching."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A map that is drawn: its data, axes and summary."""

    data: Dataset
    axes: MapAxes
    made: MapSummary

    @property
    def side(self) -> int:
        """Side of the blocks of pixels that are one point of an image."""
        side = int(np.ceil(max(self.axes.shape[-2:]) / MOST_POINTS))
        return side if self.axes.kind == "image" else 1

    @property
    def frames(self) -> list[int]:
        """The first, the middle and the last one of a series, or the only one."""
        number = 1 if self.axes.series is None else self.axes.series.values.size
        return sorted({0, number // 2, number - 1})

    def codes(self, frame: int) -> np.ndarray:
        """Statuses of all pixels of a frame."""
        return np.asarray(self.frame("status", frame))

    def frame(self, variable: str, frame: int) -> DataArray:
        """A variable at the pixels of one frame, unread."""
        array = self.data[variable]
        before = array.dims[: len(array.dims) - (2 if self.axes.kind == "image" else 1)]
        index = np.unravel_index(frame, [self.data.sizes[dim] for dim in before])
        return array.isel(dict(zip(before, map(int, index), strict=True)))

    def label(self, variable: str, of: str = "") -> str:
        """`thickness (nm)`, or `standard error of thickness (nm)`."""
        name = str(self.data[variable].attrs.get("long_name", parameter_name(self.data, variable)))
        return of + labelled(name, unit_of(self.data, variable))


def to_scale(axes: MapAxes) -> float | None:
    """Ratio of height to width at equal scales, None for different units and for very flat images."""
    if axes.y is None or axes.y.unit != axes.x.unit:
        return None
    ends = [axis.edges() if axes.kind == "image" else axis.values for axis in (axes.y, axes.x)]
    height, width = (float(np.ptp(values)) for values in ends)
    return height / width if FLAT * width <= height <= width / FLAT and width > 0 else None


def overlay(codes: np.ndarray) -> np.ndarray:
    """Hatching (height, width, 4) of points that should not be used, transparent elsewhere."""
    scale = max(round(MOST_POINTS / max(codes.shape)), 1)
    fine = codes.repeat(scale, axis=0).repeat(scale, axis=1)
    rows, columns = np.ogrid[: fine.shape[0], : fine.shape[1]]
    period, width = 14, 3
    up, down = (rows + columns) % period < width, (rows - columns) % period < width
    level, upright = (rows + 0 * columns) % period < width, (columns + 0 * rows) % period < width
    dots = (rows % period < width + 1) & (columns % period < width + 1)
    marks = {"/": up, "x": up | down, "-": level, "|": upright, "+": level | upright, ".": dots}
    image = np.zeros((*fine.shape, 4), np.float32)
    for word, hatch in HATCHES.items():
        own = fine == CODES[word]
        if own.any():
            image[own, :3], image[own, 3] = PALE, 1.0
            image[own & marks[hatch[0]], :3] = DARK
    return image


def label_axes(panel: Axes, axes: MapAxes) -> None:
    """Name the axes of an image, with equal scales where both have one unit."""
    panel.set_xlabel(plain(axes.x.label))
    assert axes.y is not None
    panel.set_ylabel(plain(axes.y.label))
    if to_scale(axes):
        panel.set_aspect("equal", anchor="NW")
    if axes.kind == "image":
        panel.set_xlim(*sorted(axes.x.edges()[[0, -1]]))
        panel.set_ylim(*sorted(axes.y.edges()[[0, -1]]))
        panel.locator_params(integer=axes.downward)  # pixels are counted
    else:  # also where some sites are without data
        for limits, axis in ((panel.set_xlim, axes.x), (panel.set_ylim, axes.y)):
            margin = 0.08 * np.ptp(axis.values) or axis.step
            limits(axis.values.min() - margin, axis.values.max() + margin)
    if axes.downward:
        panel.invert_yaxis()


def unusable(codes: np.ndarray) -> list[str]:
    """Statuses that occur and whose numbers should not be used."""
    return [STATUSES[code] for code in np.unique(codes) if STATUSES[code] not in (*DECIDED, NO_DATA)]


def read(sheet: Sheet, variable: str, frame: int, used: np.ndarray) -> np.ndarray:
    """A variable at the used pixels of a frame, reduced to the points of an image; NaN elsewhere."""
    array = sheet.frame(variable, frame)
    if sheet.axes.kind == "image":
        return block_means(array, used, sheet.side)
    return np.where(used, np.asarray(array, dtype=float), np.nan)


def decided_panel(sheet: Sheet, panel: Axes, variable: str, errors: bool = False) -> None:
    """Draw the decided values of a variable with their colour bar, or their standard `errors`, these on a
    logarithmic scale where they differ much."""
    from matplotlib.colors import LogNorm

    codes = sheet.codes(0)
    values = read(sheet, f"{variable}_stderr" if errors else variable, 0, is_decided(codes))
    low, high, extend = limits(values)
    known, style = values[values > 0], {"vmin": low, "vmax": high}
    if errors and known.size and np.percentile(known, 98) > WIDE * np.percentile(known, 2):
        style, extend = {"norm": LogNorm(*np.percentile(known, [1, 99]))}, "both"
    drawn = paint(sheet, panel, values, codes, ERRORS if errors else VALUES, **style)
    colour_bar(panel, drawn, sheet.label(variable, "standard error of " * errors), extend)


def paint(
    sheet: Sheet, panel: Axes, values: np.ndarray, codes: np.ndarray | None, cmap: Any, **style: Any
) -> Any:
    """Draw values in colours and hatch what should not be used; return what a colour bar needs."""
    axes = sheet.axes
    assert axes.y is not None
    if axes.kind == "sites":  # filled circles, nothing between them
        x, y, known = axes.x.values, axes.y.values, np.isfinite(values)
        area = SPOT * float(np.clip(60 / x.size, 0.05, 1.5))
        for word in unusable(codes) if codes is not None else ():
            own = codes == CODES[word]
            panel.scatter(x[own], y[own], area, facecolor="0.88", edgecolor="0.55", hatch=2 * HATCHES[word])
        panel.margins(0.08)
        style |= {"cmap": cmap, "edgecolor": GREY, "linewidth": 0.3}
        drawn = panel.scatter(x[known], y[known], area, c=values[known], **style)
    else:
        (left, *_, right), (top, *_, bottom) = axes.x.edges().tolist(), axes.y.edges().tolist()
        extent = (left, right, bottom, top)  # the first row is drawn first
        place: dict[str, Any] = {"extent": extent, "aspect": "auto", "origin": "upper"}
        shown = evenly(values, axes, sheet.side)
        drawn = panel.imshow(shown, cmap=cmap, interpolation="nearest", **place, **style)
        if codes is not None:
            layer = overlay(evenly(block_codes(codes, sheet.side), axes, sheet.side))
            panel.imshow(layer, interpolation="antialiased", **place)
    label_axes(panel, axes)
    return drawn


def colour_bar(panel: Axes, drawn: Any, label: str, extend: str) -> Any:
    """Draw a colour bar as high as its panel, with its label above the panel."""
    panel.set_title(plain(label), fontsize="medium", loc="left")
    root: Any = panel.figure
    width = panel.get_position().width * root.get_size_inches()[0]
    bar = root.colorbar(drawn, cax=panel.inset_axes((1 + 0.1 / width, 0.0, 0.16 / width, 1.0)), extend=extend)
    if hasattr(bar.formatter, "set_useOffset"):
        bar.formatter.set_useOffset(False)
    return bar


def status_panel(sheet: Sheet, panel: Axes, codes: np.ndarray, legend: bool) -> None:
    """Statuses in colours, with their shares among the pixels with data as a legend."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    colours = ListedColormap([COLOURS[word] for word in STATUSES])
    style = {"vmin": -0.5, "vmax": len(STATUSES) - 0.5}
    shown = block_codes(codes, sheet.side) if sheet.axes.kind == "image" else codes
    paint(sheet, panel, shown.astype(float), None, colours, **style)
    if not legend:
        return
    made = sheet.made
    entries = []
    for word, count in made.counts.items():
        total, among = (made.pixels, " of all") if word == NO_DATA else (made.with_data, "")
        text = f"{word} {share(count, total)} %{among}"
        entries.append(Patch(facecolor=COLOURS[word], edgecolor=GREY, linewidth=0.5, label=text))
    beside: Any = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.02), "borderaxespad": 0.2}
    panel.legend(handles=entries, fontsize="small", frameon=False, **beside)


def histogram_panel(sheet: Sheet, panel: Axes, variable: str) -> None:
    """Values of the decided pixels."""
    thin = thinned(sheet.data, sheet.made.axes)
    values = np.asarray(thin[variable], dtype=float)[is_decided(np.asarray(thin["status"]))]
    values = values[np.isfinite(values)]
    panel.set(xlabel=sheet.label(variable), ylabel=sheet.axes.points)
    panel.spines[["top", "right"]].set_visible(False)
    if not values.size:
        text = "no pixel has numbers\nthat can be used"
        panel.text(0.5, 0.5, text, ha="center", va="center", transform=panel.transAxes)
        return
    low, high, _ = limits(values)
    bins = int(np.clip(2 * values.size ** (1 / 3), 10, 80))
    weights = np.full(values.size, float(sheet.made.sampled ** (2 if sheet.axes.kind == "image" else 1)))
    panel.locator_params(axis="x", nbins=5)  # labels of an index have six digits
    panel.hist(np.clip(values, low, high), bins=bins, range=(low, high), weights=weights, color=BLUE)
    q05, middle, q95 = np.percentile(values, [5, 50, 95])
    panel.axvline(middle, color=BLACK, linewidth=1.2, label="median")
    panel.axvspan(q05, q95, color=GREY, alpha=0.18, linewidth=0, zorder=0, label="5 to 95 %")
    panel.legend(fontsize="small", **ABOVE | {"ncols": 2, "borderaxespad": 0.1})
    if np.any((values < low) | (values > high)):
        panel.set_xlabel(f"{sheet.label(variable)}\n(the outermost bars contain all beyond them)")


MOST_POINTS = 800
"""Most points of an image in each direction: more than a printed panel shows."""
SLAB = 2**22
"""Most pixels that are read at once."""


def block_codes(codes: np.ndarray, side: int) -> np.ndarray:
    """Most frequent status of each block of an image."""
    known = np.unique(codes)
    counts = [_sums((codes == code).astype(np.int32), side) for code in known]
    return known[np.argmax(counts, axis=0)]


def block_means(array: Any, used: np.ndarray, side: int) -> np.ndarray:
    """Means of an image over the used pixels of each block, NaN where there are none.

    The array is read in slabs of whole rows of blocks: it may be larger than memory.
    """
    rows = max(SLAB // max(used.shape[1] * side, 1), 1) * side
    means = []
    for start in range(0, used.shape[0], rows):
        values = np.asarray(array[start : start + rows], dtype=float)
        own = used[start : start + rows] & np.isfinite(values)
        count = _sums(own.astype(np.int32), side)
        total = _sums(np.where(own, values, 0.0), side)
        means.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    return np.concatenate(means)


def _sums(array: np.ndarray, side: int) -> np.ndarray:
    """Sums over blocks; those at the end may be smaller."""
    for along in (0, 1):
        array = np.add.reduceat(array, np.arange(0, array.shape[along], side), axis=along)
    return array


def evenly(array: np.ndarray, axes: MapAxes, side: int) -> np.ndarray:
    """Repeat rows and columns of an image whose coordinates are uneven, so that all points have one size."""
    assert axes.y is not None
    for along, axis in enumerate((axes.y, axes.x)):
        if axis.is_even:
            continue
        edges = np.append(axis.edges()[:-1:side], axis.edges()[-1])
        points = np.linspace(edges[0], edges[-1], 2 * MOST_POINTS + 1)[1::2]
        sign = 1 if edges[-1] > edges[0] else -1
        index = np.searchsorted(sign * edges, sign * points) - 1
        array = np.take(array, np.clip(index, 0, array.shape[along] - 1), axis=along)
    return array


def limits(values: np.ndarray) -> tuple[float, float, str]:
    """Limits of the colours that outliers do not set, and the ends at which a colour bar is extended."""
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0, "neither"
    low, high = np.percentile(known, [1, 99])
    least, largest = known.min(), known.max()
    room = 0.25 * (high - low)
    low, high = (least if least >= low - room else low), (largest if largest <= high + room else high)
    if high - low <= 1e-9 * max(abs(high), abs(low), 1e-300):
        middle = (high + low) / 2
        half = 0.01 * abs(middle) or 0.5
        return middle - half, middle + half, "neither"
    ends = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
    return float(low), float(high), ends[bool(least < low), bool(largest > high)]
