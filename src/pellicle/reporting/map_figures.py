"""Figures of the map of a cube: values, errors, statuses, rivals and histograms; its page and its folder."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import write_text
from pellicle.fitting.batch.data import CODES, NO_DATA
from pellicle.mapping.map_result import Map
from pellicle.reporting.folders import PAGE, REPORT
from pellicle.reporting.json_record import write_result
from pellicle.reporting.map_panels import (
    COLOURS,
    DARK,
    HATCHES,
    PALE,
    VALUES,
    Sheet,
    colour_bar,
    decided_panel,
    histogram_panel,
    limits,
    paint,
    read,
    status_panel,
    to_scale,
    unusable,
)
from pellicle.reporting.map_sites import SITES, sites_csv
from pellicle.reporting.map_summary import (
    MapSummary,
    dataset_of,
    free_parameters,
    is_decided,
    summarise,
    thinned,
)
from pellicle.reporting.map_text import (
    ERRORS,
    cube_json,
    cube_report,
    decided_in_words,
    file_rows,
    in_words,
    ordinal,
    parameter_rows,
    plan_rows,
    rate_rows,
    status_rows,
)
from pellicle.reporting.matplotlib_figure import (
    ABOVE,
    BLUE,
    ORANGE,
    marker_size,
    new_figure,
    plain,
    save_figure,
)
from pellicle.reporting.page.document import Table, page, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset


RIVALS = "magma"
PANEL, TALLEST, LEAST, WIDE = 3.5, 5.0, 1.3, 2.0
"""Inches: width of a panel, its largest and least height, height of a panel as wide as the page."""
_LEFT, _RIGHT, _ABOVE, _BELOW, _LINE = 0.75, 1.85, 0.32, 0.62, 0.175
"""Inches beside a panel: labels, colour bar or legend, its title, its axis; a line of text."""


def figures(made: Dataset | Map, summary: MapSummary | None = None) -> Iterator[tuple[str, Figure]]:
    """Draw a map: yield the name of each figure's file, without suffix, and the figure.

    "map" has the first thickness, its standard error, the statuses and a histogram. Each other free parameter
    has a figure of its name, and "rival" shows how close the second best answers are. Large images are drawn
    by means over blocks of pixels.
    """
    summary = summarise(made) if summary is None else summary
    dataset = dataset_of(made)
    axes = summary.axes
    if axes.kind == "line" and axes.series is not None:  # as an image of position and time
        axes = replace(axes, kind="image", y=axes.series, series=None)
    sheet = Sheet(dataset, axes, summary)
    first, *others = sorted(free_parameters(dataset), key=lambda name: not name.endswith("thickness"))
    yield "map", _draw(sheet, first, first=True)
    for variable in others:
        yield variable, _draw(sheet, variable)
    if "rival_delta_chi2" in dataset and axes.series is None and axes.kind != "line":
        yield "rival", draw_rival(sheet)


def _draw(sheet: Sheet, variable: str, first: bool = False) -> Figure:
    """Draw a parameter, its standard error and a histogram, of the first one also the statuses; of a series,
    some frames of it."""
    if sheet.axes.series is not None:
        return _series(sheet, variable)
    if sheet.axes.kind == "line":
        return _line(sheet, variable)
    figure, panels, _ = _page(sheet, *((2, 2) if first else (1, 3)))
    values, errors, *statuses, histogram = panels.flat
    decided_panel(sheet, values, variable)
    decided_panel(sheet, errors, variable, errors=True)
    for panel in statuses:
        status_panel(sheet, panel, sheet.codes(0), legend=True)
    histogram_panel(sheet, histogram, variable)
    return figure


def draw_rival(sheet: Sheet) -> Figure:
    """Draw how much worse the best other answer of each pixel fits."""
    from matplotlib.colors import LogNorm

    from pellicle.fitting.status import RIVAL

    remark = f"White: no other answer. Below the line on the scale, Δχ² {RIVAL:g}, an answer is ambiguous."
    figure, ((panel,),), _ = _page(sheet, 1, 1, hatching=False, remark=remark)
    values = read(sheet, "rival_delta_chi2", 0, sheet.codes(0) != CODES[NO_DATA])
    known = values[np.isfinite(values) & (values > 0)]
    low, high = np.percentile(known, [1, 99]) if known.size else (RIVAL, RIVAL)
    low, high = min(max(low, RIVAL / 100), RIVAL / 3), max(high, 3 * RIVAL)
    drawn = paint(sheet, panel, np.where(values <= 0, low, values), None, RIVALS, norm=LogNorm(low, high))
    bar = colour_bar(panel, drawn, "Δχ² of the best other answer", "both")
    bar.ax.axhline(RIVAL, color="white", linewidth=2)
    return figure


def _page(
    sheet: Sheet,
    rows: int,
    columns: int,
    wide: int = 0,
    *,
    hatching: bool = True,
    between: float = _RIGHT,
    tallest: float = TALLEST,
    remark: str = "",
) -> tuple[Figure, np.ndarray, list[Axes]]:
    """An empty page with its title and the legend of the hatching: panels, and wide ones below them.

    Panels have the shape of the map, so that their scales are equal without empty space; there are `between`
    inches right of all but the last one. `remark` is added to the title.
    """
    ratio = to_scale(sheet.axes) or 0.6
    height = min(PANEL * ratio, tallest)
    across = float(np.clip(height / ratio, 1.0, PANEL))
    height = max(height, LEAST)
    width = (_LEFT + across) * columns + between * (columns - 1) + _RIGHT
    width = max(width, 7.5 if wide else 5.5)
    title = _title(sheet, int(width * 12.5), remark)
    words = unusable(np.asarray(sheet.data["status"])) if hatching else []
    each_line = max(int(width / 1.5), 1)
    below = _LINE * (1.6 + 1.2 * np.ceil(len(words) / each_line)) if words else 0.0
    top = _LINE * (title.count("\n") + 1) + 0.15
    heights = [height] * rows + [WIDE] * wide
    total = top + sum(heights) + (_ABOVE + _BELOW) * len(heights) + below
    figure = new_figure(width, total, constrained=False)
    figure.suptitle(title, fontsize="medium", x=0.1 / width, y=1 - 0.08 / total, ha="left", va="top")
    panels, wides = np.empty((rows, columns), object), []
    for i, own in enumerate(heights):
        top += _ABOVE + own
        bottom, share = 1 - top / total, own / total
        top += _BELOW
        if i >= rows:
            room = (width - _LEFT - 0.7) / width
            wides.append(figure.add_axes((_LEFT / width, bottom, room, share)))
            continue
        for j in range(columns):
            left = (_LEFT + (_LEFT + across + between) * j) / width
            panels[i, j] = figure.add_axes((left, bottom, across / width, share))
    if words:
        _list_hatching(figure, words, each_line)
    return figure, panels, wides


def _list_hatching(figure: Figure, words: list[str], columns: int) -> None:
    """Explain the hatching at the bottom of a page."""
    from matplotlib.patches import Patch

    style: Any = {"facecolor": f"{PALE}", "edgecolor": f"{DARK}", "linewidth": 0}
    figure.legend(
        handles=[Patch(hatch=HATCHES[word], label=word, **style) for word in words if word in HATCHES],
        title="numbers that should not be used:",
        title_fontsize="small",
        fontsize="small",
        loc="lower left",
        bbox_to_anchor=(0.0, 0.0),
        ncols=min(len(words), columns),
        frameon=False,
        alignment="left",
    )


def _title(sheet: Sheet, columns: int, remark: str) -> str:
    """File, statuses, and what a point of the image is."""
    about = sheet.made.attributes
    lines = [Path(str(about.get("path", ""))).name, in_words(sheet.made)]
    every = int(about.get("preview", 1))
    if every > 1:
        lines.append(f"Preview of every {ordinal(every)} pixel in each direction.")
    if sheet.side > 1:
        lines.append(
            f"A point is a block of {sheet.side} x {sheet.side} pixels: the mean of those that can be used,"
            " the most frequent status."
        )
    numbers = re.compile(r" (?==|%|[a-z]*m\b)|(?<==) ")  # which stay whole
    lines = [numbers.sub("\u00a0", line) for line in (*lines, remark)]
    return plain("\n".join(x for line in lines for x in textwrap.wrap(line, columns, break_on_hyphens=False)))


def _series(sheet: Sheet, variable: str) -> Figure:
    """First, middle and last frame, their statuses, and the values against time."""
    axes, frames = sheet.axes, sheet.frames
    assert axes.series is not None
    figure, panels, (curve,) = _page(sheet, 2, len(frames), wide=1, between=0.1, tallest=3.5)
    codes = [sheet.codes(i) for i in frames]
    values = [read(sheet, variable, i, is_decided(own)) for i, own in zip(frames, codes, strict=True)]
    low, high, extend = limits(np.concatenate([own.ravel() for own in values]))
    for i, frame in enumerate(frames):
        drawn = paint(sheet, panels[0, i], values[i], codes[i], VALUES, vmin=low, vmax=high)
        status_panel(sheet, panels[1, i], codes[i], legend=i == len(frames) - 1)
        if i == len(frames) - 1:
            colour_bar(panels[0, i], drawn, "", extend)
        when = axes.series.span(*2 * (axes.series.values[frame],))
        for row, what in enumerate((sheet.label(variable), "status")):
            panels[row, i].set_title(what + f", {when}" if i == 0 else when, fontsize="medium", loc="left")
            if i:
                panels[row, i].set_ylabel("")
    # mean and 5 to 95 % of the decided pixels of each frame, and the share of these pixels
    thin = thinned(sheet.data, sheet.made.axes)
    axis = sheet.axes.series
    assert axis is not None
    codes = np.asarray(thin["status"]).reshape(axis.values.size, -1)
    used = is_decided(codes)
    values = np.where(used, np.asarray(thin[variable], dtype=float).reshape(codes.shape), np.nan)
    some = np.isfinite(values).any(axis=1)
    mean, low, high = np.full((3, axis.values.size), np.nan)
    mean[some] = np.nanmean(values[some], axis=1)
    low[some], high[some] = np.nanpercentile(values[some], [5, 95], axis=1)
    band: dict[str, Any] = {"color": BLUE, "alpha": 0.25, "linewidth": 0, "label": "5 to 95 % of the pixels"}
    handles = [curve.fill_between(axis.values, low, high, **band)]
    handles += curve.plot(axis.values, mean, ".-", color=BLUE, markersize=4, label="mean")
    curve.set(xlabel=axis.label, ylabel=sheet.label(variable))
    beside, about = curve.twinx(), "pixels that can be used (right)"
    share = 100 * used.sum(axis=1) / np.maximum((codes != CODES[NO_DATA]).sum(axis=1), 1)
    handles += beside.plot(axis.values, share, color=ORANGE, linewidth=1.0, label=about)
    beside.set(ylabel="share (%)", ylim=(0, 105))
    for own in (curve, beside):
        own.spines[["top"]].set_visible(False)
    curve.legend(handles=handles, ncols=3, fontsize="small", **ABOVE)
    return figure


def _line(sheet: Sheet, variable: str) -> Figure:
    """Values with their standard errors along a line, or against time, and a histogram."""
    figure, _, (panel,) = _page(sheet, 0, 1, wide=1, hatching=False)
    codes, x = sheet.codes(0), sheet.axes.x.values
    values = np.asarray(sheet.frame(variable, 0), dtype=float)
    stderr = np.asarray(sheet.frame(f"{variable}_stderr", 0), dtype=float)
    used = is_decided(codes)
    errors = np.where(np.isfinite(stderr[used]), stderr[used], 0.0)
    style: dict[str, Any] = {"fmt": ".", "color": BLUE, "markersize": marker_size(x.size), "elinewidth": 0.8}
    panel.errorbar(x[used], values[used], errors, label="value and standard error", **style)
    if used.any():  # bad values must not set the limits
        panel.set_ylim(panel.get_ylim())
    for word in unusable(codes):
        own = codes == CODES[word]
        panel.plot(x[own], values[own], "x", color=COLOURS[word], markersize=5, label=word)
    panel.set(xlabel=sheet.axes.x.label, ylabel=sheet.label(variable))
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(ncols=4, fontsize="small", **ABOVE)
    return figure


def write_cube_map(
    folder: str | os.PathLike[str],
    made: Dataset | Map,
    again: Sequence[tuple[str, str]] = (),
    recipe_path: str = "",
    summary: MapSummary | None = None,
) -> Path:
    """Write result.json, report.txt, report.html and figures of a map, and return the folder.

    A map of sites or of a line also has sites.csv. Each file appears complete or not at all. `again` is
    what repeats the map beside its recipe, descriptions and texts; the recipe is at `recipe_path`.
    `summary` is that of the map, if it has been computed.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    summary, images = summarise(made) if summary is None else summary, {}
    texts = {REPORT: cube_report(made, summary)}
    if summary.axes.kind != "image":
        texts[SITES] = sites_csv(made, summary)
    record = cube_json(made, summary) | ({"scene": {"recipe": recipe_path}} if recipe_path else {})
    target = write_result(folder, record, texts)
    for name, figure in figures(made, summary):
        path = save_figure(figure, target / f"{name}.png", overwrite=True)
        images[name] = path.read_bytes()
    recipe = str(summary.attributes.get("recipe", ""))
    again = [*again, *([("Recipe", recipe)] if recipe else [])]
    write_text(target / PAGE, map_page(summary, images, again), overwrite=True)
    return target


def map_page(summary: MapSummary, images: Mapping[str, bytes], again: Sequence[tuple[str, str]] = ()) -> str:
    """Format the map of a cube as a page.

    **Arguments:** `images`, the PNG image of each figure by its name, "map" first; `again`, what repeats the
    map: descriptions and texts to copy.
    """
    about = {
        "map": "Values, standard errors, statuses and histogram",
        "rival": "How much worse the best other answer of each pixel fits",
    }
    sentence = in_words(summary)
    parameters = [row for p in summary.parameters for row in parameter_rows(p)]
    numbers = [f"{name}: {text}" if name else text for name, text in parameters]
    path = str(summary.attributes.get("path", "")).replace("\\", "/")
    return page(
        "map.html",
        f"Map of {PurePosixPath(path).name}" if path else "Map",
        [],
        kind="Map of a cube of spectra",
        tone="good" if 2 * summary.decided >= summary.with_data > 0 else "warn",
        sentence=sentence,
        numbers=numbers,
        again=again,
        pictures=[
            picture(image, f"{about.get(name, f'{name}: values, standard errors and histogram')}. {sentence}")
            for name, image in images.items()
        ],
        errors=ERRORS,
        parameters=Table(decided_in_words(summary), (), parameters),
        rates=Table("Rate of change: a straight line through the times", (), rate_rows(summary)),
        statuses=Table("Statuses, and what to do", (), status_rows(summary)),
        plan=Table("Effects of the simulation", (), plan_rows(summary)),
        file=Table("File, and how it was read", (), file_rows(summary)),
    )
