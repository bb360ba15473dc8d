"""Folder and page of the map of a cube: record, report and figures, beside its zarr store and NetCDF file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from pellicle.files import MARKER, new_folder, write_text
from pellicle.mapping.map_result import Map
from pellicle.reporting import map_text
from pellicle.reporting.folders import PAGE, REPORT
from pellicle.reporting.json_record import indented
from pellicle.reporting.map_summary import MapSummary, summarise
from pellicle.reporting.map_text import cube_json, cube_report
from pellicle.reporting.matplotlib_figure import save_figure
from pellicle.reporting.page.document import Table, page, picture

if TYPE_CHECKING:
    from xarray import Dataset


def write_cube_map(folder: str | os.PathLike[str], made: Dataset | Map) -> Path:
    """Write result.json, report.txt, report.html and figures of a map, and return the folder.

    Each file appears complete or not at all.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    from pellicle.reporting.map_figures import figures

    target, summary = new_folder(folder), summarise(made)
    record = indented(cube_json(made, summary))
    write_text(target / MARKER, record, overwrite=True)  # first: it marks the folder as ours
    write_text(target / REPORT, cube_report(made, summary), overwrite=True)
    images = {}
    for name, figure in figures(made, summary):
        path = save_figure(figure, target / f"{name}.png", overwrite=True)
        images[name] = path.read_bytes()
    write_text(target / PAGE, map_page(summary, images), overwrite=True)
    return target


def map_page(summary: MapSummary, images: Mapping[str, bytes]) -> str:
    """Format the map of a cube as a page.

    **Arguments:** `images`, the PNG image of each figure by its name, "map" first.
    """
    about = {
        "map": "Values, standard errors, statuses and histogram",
        "rival": "How much worse the best other answer of each pixel fits",
    }
    sentence = map_text.in_words(summary)
    parameters = [row for p in summary.parameters for row in map_text.parameter_rows(p)]
    path = str(summary.attributes.get("path", "")).replace("\\", "/")
    return page(
        "map.html",
        f"Map of {PurePosixPath(path).name}" if path else "Map",
        [],
        tone="good" if 2 * summary.decided >= summary.with_data > 0 else "warn",
        sentence=sentence,
        decided=map_text.decided_in_words(summary),
        pictures=[
            picture(image, f"{about.get(name, f'{name}: values, standard errors and histogram')}. {sentence}")
            for name, image in images.items()
        ],
        errors=map_text.ERRORS,
        parameters=Table(map_text.decided_in_words(summary), (), parameters),
        rates=Table("Rate of change: a straight line through the times", (), map_text.rate_rows(summary)),
        statuses=Table("Statuses, and what to do", (), map_text.status_rows(summary)),
        plan=Table("Effects of the simulation", (), map_text.plan_rows(summary)),
        file=Table("File, and how it was read", (), map_text.file_rows(summary)),
    )
