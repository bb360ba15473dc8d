"""Folder of the map of a cube: record, report, page and figures, beside its zarr store and NetCDF file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pellicle.files import MARKER, new_folder, write_text
from pellicle.mapping.map_result import Map
from pellicle.reporting.folders import PAGE, REPORT
from pellicle.reporting.json_record import indented
from pellicle.reporting.map_summary import summarise
from pellicle.reporting.map_text import cube_json, cube_report
from pellicle.reporting.matplotlib_figure import save_figure
from pellicle.reporting.page.map_page import map_page

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
