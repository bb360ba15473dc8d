"""Table of the sites of a map: place, status, values and errors, and statistics of the decided sites."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.batch.data import STATUSES
from pellicle.reporting.map_summary import MapSummary, dataset_of
from pellicle.reporting.plain_text import csv_rows

if TYPE_CHECKING:
    from xarray import Dataset

    from pellicle.mapping.map_result import Map

SITES = "sites.csv"


def sites_csv(made: Dataset | Map, summary: MapSummary) -> str:
    """Format the sites of a map, or the pixels of a line, one a row (of a series: one for each frame).

    Below them are four rows of statistics of the decided sites: mean, standard deviation, range (largest less
    least), and uniformity, the range over twice the mean in percent; their status is empty. The header is the
    first line, after a mark by which Excel recognises UTF-8. All sites are counted.
    """
    dataset, axes = dataset_of(made), summary.axes
    status, [*_, along] = dataset["status"], dataset["status"].dims
    frames = status.size // axes.x.values.size
    called = [name for name in ("name", "file", str(along)) if name in dataset.coords]
    names = dataset.coords[called[0]] if called else None
    # texts of a store are of any length, which NumPy repeats only as objects
    labels = np.arange(1, axes.x.values.size + 1) if names is None else np.asarray(names, dtype=object)
    columns: dict[str, list[Any]] = {
        "site": [*map(str, np.tile(labels, frames)), "mean", "standard deviation", "range", "uniformity (%)"]
    }
    if axes.series is not None:
        columns[axes.series.label] = [*np.repeat(axes.series.values, axes.x.values.size), *[""] * 4]
    for axis in (axes.x, axes.y):
        if axis is not None and axis.name != along:
            columns[axis.label] = [*np.tile(axis.values, frames), *[""] * 4]
    columns["status"] = [*(STATUSES[code] for code in np.ravel(status)), *[""] * 4]
    for p in summary.parameters:
        name = f"{p.variable} ({p.unit})" if p.unit else p.variable
        statistics = p.mean, p.sd, p.percentiles[4] - p.percentiles[0], p.uniformity
        columns[name] = [*np.ravel(dataset[p.variable]), *statistics]
        for end in ("stderr", "stderr_noise"):
            columns[f"{p.variable}_{end}"] = [*np.ravel(dataset[f"{p.variable}_{end}"]), *[""] * 4]
    return "\ufeff" + csv_rows([*columns], zip(*columns.values(), strict=True))
