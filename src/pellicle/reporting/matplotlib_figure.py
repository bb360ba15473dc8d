"""Rendering of panels by Matplotlib, and the files of figures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.files import check_new, replacing
from pellicle.reporting.drawable import Line, Panel, Section

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
BLACK, ORANGE, BLUE, GREEN, GREY = "#000000", "#D55E00", "#0072B2", "#009E73", "#777777"
"""Okabe and Ito's colours, which the colour-blind can distinguish."""
COLOURS = {
    **{"data": GREY, "points": GREY, "residual": BLACK, "rival": BLUE, "band": BLUE, "fourth": BLACK},
    **{"fit": ORANGE, "red": ORANGE, "index-k": ORANGE, "blue": BLUE, "index-n": BLUE, "green": GREEN},
}
"""Colours of lines and bands; C0 to C9 are Matplotlib's own."""
ABOVE: dict[str, Any] = {
    "frameon": False,
    "loc": "lower right",
    "bbox_to_anchor": (1, 1),
    "borderaxespad": 0,
}
"""Place of a legend above its panel, where it hides nothing."""
WIDTH_INCHES = 8.0
_TEXT, _AXIS, _GAP = 0.2, 0.55, 0.1
"""Heights in inches: a line of text, an axis with numbers and label, a gap."""
_NUMBERS = 0.22
"""Height in inches of the numbers of an axis without label."""
_RIGHT, _KEY = 0.02, 0.24
"""Shares of the width right of the panels, without and with a key of their notes."""
_STYLES = {"solid": "-", "dashed": "--", "dotted": ":"}
_MARKERS = {"point": ".", "circle": "o", "ring": "o", "cross": "x", "diamond": "D"}
_NOTE: dict[str, Any] = {
    "xytext": (0, 6),
    "textcoords": "offset points",
    "ha": "center",
    "va": "bottom",
    "fontsize": "small",
}
_BOX = {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.5}


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
    # a fifth of the time of a figure is saved, for a tenth more bytes than Pillow's default of 6
    packed: Any = {"pil_kwargs": {"compress_level": 3}} if target.suffix.lower() == ".png" else {}
    with replacing(target, overwrite=overwrite) as draft:
        figure.savefig(draft, dpi=dpi, bbox_inches=bbox_inches, **packed)
    return target


def figure_path(path: str | os.PathLike[str], name: str = "path") -> Path:
    """The path of a figure that is to be written, which is the argument `name`.

    **Raises:** UsageError for another file type, and where no new file can be written there.
    """
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise UsageError(f"`{name}` {target}: expected a name ending in {', '.join(FORMATS)}")
    check_new(target, name=name)
    return target


def plain(text: str) -> str:
    """Text in which Matplotlib finds no mathematics, such as a file's name."""
    return text.replace("$", r"\$")


def marker_size(points: int) -> float:
    """Size of a marker in points that leaves room between this many of them."""
    return float(np.clip(900 / max(points, 1), 1.5, 4.0))


def draw(sections: Sequence[Section], title: str, width: float = WIDTH_INCHES) -> Figure:
    """Draw sections below each other and below the title."""
    figure = new_figure(width, 1.0, constrained=False)
    rows = [(section, row) for section in sections for row in section.rows]
    grid = [[figure.add_subplot(len(rows), len(row), i * len(row) + j + 1) for j in range(len(row))]
            for i, (_, row) in enumerate(rows)]  # fmt: skip
    first = 0
    for section in sections:
        axes_rows = grid[first : first + len(section.rows)]
        first += len(section.rows)
        panels = [
            (axes, panel, axes_row)
            for axes_row, row in zip(axes_rows, section.rows, strict=True)
            for axes, panel in zip(axes_row, row, strict=True)
        ]
        top = axes_rows[0][0]
        for axes, panel, axes_row in panels:
            if len(axes_row) == 1 and axes is not top and len(axes_rows[0]) == 1:
                axes.sharex(top)
            draw_panel(axes, panel)
        for i, row in enumerate(section.rows):  # the lowest panel of each column has numbers
            for j, panel in enumerate(row):
                below = [later[j] for later in section.rows[i + 1 :] if len(later) == len(row)]
                hidden = panel.empty or any(not other.empty for other in below)
                axes_rows[i][j].tick_params(labelbottom=not hidden)
        for axes in axes_rows[-1]:
            axes.set_xlabel(plain(section.abscissa))
        if len(sections) > 1 and section.title:
            top.set_title(plain(section.title), fontsize="small", loc="left")
        for axes, panel, axes_row in panels:
            if panel.legend and axes.get_legend_handles_labels()[1]:
                _legend(axes, axes_row[-1], panel)
    _arrange(figure, grid, [row for _, row in rows], title)
    return figure


def draw_panel(axes: Axes, panel: Panel) -> None:
    """Draw one panel into axes."""
    if panel.image is not None:
        _patches(axes, panel)
    if panel.raster is not None:
        at, limit = panel.raster, panel.raster.limit
        style: dict[str, Any] = {"shading": "nearest", "rasterized": True, "cmap": "RdBu_r"}
        style |= {"cmap": "viridis"} if at.positive else {"vmin": -limit, "vmax": limit}
        axes.pcolormesh(at.x, at.y, at.values, **style)
        axes.set_ylabel(panel.label)
    points = max((line.x.size for line in panel.lines), default=0)
    listed: set[str] = set()
    for band in panel.bands:
        label = band.name if band.listed and band.name and band.name not in listed else "_"
        listed.add(band.name)
        known = np.isfinite(band.low) & np.isfinite(band.high)
        style = {"color": COLOURS.get(band.colour, band.colour), "alpha": band.opacity, "lw": 0}
        axes.fill_between(band.x, band.low, band.high, where=known, label=label, **style)
    for line in panel.lines:
        _line(axes, line, points, listed)
    if panel.zero:
        axes.axhline(0, color=GREY, linewidth=0.6)
    for left, right, name, shade in panel.spans:
        # shade a range of the abscissa and write its name, upright where it is narrow
        axes.axvspan(left, right, color=GREY, alpha=shade, linewidth=0)
        low, high = panel.span or (left, right)
        narrow = (right - left) / (high - low) < 0.07 + 0.018 * len(name)
        turned, place = 90 if narrow else 0, axes.get_xaxis_transform()
        style: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": "small", "rotation": turned}
        axes.text((left + right) / 2, 0.97, plain(name), transform=place, **style)
    upright: Any = {} if panel.key else {"rotation": 90, "bbox": _BOX}
    for x, y, text in panel.notes:
        axes.annotate(text, (x, y), **_NOTE, **upright)
    if panel.key:
        names = plain("\n".join(panel.key))
        axes.text(1.02, 1.0, names, transform=axes.transAxes, va="top", fontsize="small")
        axes.grid(alpha=0.2)
    axes.margins(x=0.02 if panel.title else 0.01)
    axes.yaxis.get_offset_text().set_verticalalignment("top")  # a factor such as 1e-6 stands inside
    _scale(axes, panel)
    if panel.empty:
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_color("0.85")
        axes.text(0.5, 0.5, panel.title, ha="center", va="center", color="0.5", transform=axes.transAxes)
    elif panel.title:
        axes.set_title(panel.title, fontsize="small", loc="left", pad=3)
        axes.tick_params(labelsize="x-small", pad=1, length=2)
        axes.locator_params(axis="y", nbins=4)
    elif panel.image is None:
        axes.set_ylabel(panel.label)


def _line(axes: Axes, line: Line, points: int, listed: set[str]) -> None:
    style: dict[str, Any] = {"color": COLOURS.get(line.colour, line.colour)}
    style["label"] = line.name if line.listed and line.name and line.name not in listed else "_"
    listed.add(line.name)
    if not line.markers:
        axes.plot(line.x, line.y, _STYLES[line.style], linewidth=line.width, **style)
        return
    size = marker_size(points) if line.style == "point" or points > 100 else 6.0
    size = {"diamond": 5.0, "cross": 5.0}.get(line.style, size)
    style |= {"markersize": size} | ({"markerfacecolor": "none"} if line.style == "ring" else {})
    axes.plot(line.x, line.y, _MARKERS[line.style], **style)


def _patches(axes: Axes, panel: Panel) -> None:
    """Colours of data above those of the fit, with a caption on each of the fit."""
    assert panel.image is not None
    count = panel.image.shape[1]
    extent = (0.5, count + 0.5, 1.5, -0.5)
    axes.imshow(panel.image, aspect="auto", interpolation="nearest", extent=extent)
    axes.set_yticks([0, 1], ["data", "fit"])
    for i, caption in enumerate(panel.captions):
        dark = panel.image[1, i] @ (0.2126, 0.7152, 0.0722) < 0.5
        colour = "white" if dark else BLACK
        axes.text(i + 1, 1, caption, ha="center", va="center", fontsize="small", color=colour)
    axes.axhline(0.5, color="white", linewidth=1.5)
    axes.tick_params(length=0)


def _scale(axes: Axes, panel: Panel) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    if panel.abscissa == "log":  # plain numbers at 1, 2 and 5 of each decade
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.margins(x=0.05, y=0.1)
    if panel.scale == "log":
        axes.set_yscale("log")
    if panel.limits is not None:
        axes.set_ylim(panel.limits)
    if panel.scale == "symlog":
        assert panel.limits is not None
        decades = int(np.log10(panel.limits[1]))
        powers = range(1, decades + 1, 1 + decades // 5)
        axes.set_yscale("symlog", linthresh=panel.threshold, linscale=0.8)
        labels = [str(10**i) if i < 4 else f"$10^{{{i}}}$" for i in powers]
        axes.set_yticks([0, *(10.0**i for i in powers)], ["0", *labels])
        axes.set_yticks([], minor=True)
        axes.set_ylim(panel.limits)
    if panel.span is not None:
        axes.set_xlim(panel.span)
    if panel.ticks:
        axes.set_xticks(np.arange(len(panel.ticks)) + 1.0, list(panel.ticks))


def _legend(axes: Axes, last: Axes, panel: Panel) -> None:
    """List the names of a panel inside it or above it; of a row of panels above the title of the last one."""
    handles, names = axes.get_legend_handles_labels()
    small = "x-small" if len(names) > 5 else "small"
    if panel.legend == "inside":
        scale = 1 if any(line.style in ("ring", "cross") for line in panel.lines) else 3
        axes.legend(frameon=False, markerscale=scale, ncols=1 + (len(names) > 3), fontsize="small")
        return
    raised = 1 + (_TEXT / panel.height if panel.title else 0)
    last.legend(handles, names, **ABOVE | {"ncols": 8, "bbox_to_anchor": (1, raised)}, fontsize=small)


def _arrange(figure: Figure, grid: list[list[Axes]], rows: list[Sequence[Panel]], title: str) -> None:
    """Place the rows below each other and below the title.

    Matplotlib's constrained layout measures every text twice at each drawing: half of the time of a figure.
    Here heights are those of lines of text, and only the labels beside the panels are measured.
    """
    heights = [row[0].height for row in rows]
    above, below = [], []
    for axes_row, row in zip(grid, rows, strict=True):
        legend = axes_row[-1].get_legend()
        lines = int(any(axes.get_title(loc="left") for axes in axes_row))
        if legend is not None and any(panel.legend == "above" for panel in row):
            lines += -(-len(legend.get_texts()) // 8)  # in rows of eight names
        above.append(_TEXT * lines)
        numbered = any(axes.xaxis.get_tick_params().get("labelbottom", True) for axes in axes_row)
        named = any(axes.get_xlabel() for axes in axes_row)
        below.append(_AXIS if named else _NUMBERS if numbered else _GAP)
    top = _TEXT * (title.count("\n") + 1) + 2 * _GAP if title else _GAP
    width, height = figure.get_figwidth(), top + sum(above) + sum(heights) + sum(below)
    figure.set_size_inches(width, height)
    figure.suptitle(plain(title), fontsize="medium", x=0.01, y=1 - _GAP / height, ha="left", va="top")
    bottoms = []
    for axes_row, over, own, under in zip(grid, above, heights, below, strict=True):
        top += over + own
        bottoms.append(1 - top / height)
        for axes in axes_row:  # the number of ticks depends on the height
            axes.set_position((0.1, bottoms[-1], 0.8 / len(axes_row), own / height))
        top += under
    renderer: Any = figure.canvas.get_renderer()  # pyright: ignore[reportAttributeAccessIssue]

    def room(axes: Axes) -> float:
        """Width of the labels left of axes, as a share of the figure."""
        inside = axes.get_window_extent(renderer)
        box = axes.yaxis.get_tightbbox(renderer) or inside
        return max(inside.x0 - box.x0, 0.0) / figure.dpi / width

    left = max(room(axes_row[0]) for axes_row in grid) + 0.01
    between = max((room(axes) for axes_row in grid for axes in axes_row[1:]), default=0.0) + 0.015
    right = _KEY if any(panel.key for row in rows for panel in row) else _RIGHT
    for axes_row, bottom, own in zip(grid, bottoms, heights, strict=True):
        each = (1 - left - right - between * (len(axes_row) - 1)) / len(axes_row)
        for j, axes in enumerate(axes_row):
            axes.set_position((left + j * (each + between), bottom, each, own / height))
