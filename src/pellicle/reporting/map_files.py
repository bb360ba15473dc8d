"""Folder of the map of a cube: JSON record, report and figures, beside its zarr store and NetCDF file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pellicle.files import MARKER, new_folder, write_text
from pellicle.mapping.map_result import Map
from pellicle.reporting.drawing import save_figure
from pellicle.reporting.json_record import indented
from pellicle.reporting.map_summary import summarise
from pellicle.reporting.map_text import cube_json, cube_report

if TYPE_CHECKING:
    from xarray import Dataset


def write_cube_map(folder: str | os.PathLike[str], made: Dataset | Map) -> Path:
    """Write result.json, report.txt and figures of a map, each complete or not, and return the folder.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    from pellicle.reporting.map_figures import figures

    target, summary = new_folder(folder), summarise(made)
    write_text(
        target / MARKER, indented(cube_json(made, summary)), overwrite=True
    )  # first: it marks the folder
    write_text(target / "report.txt", cube_report(made, summary), overwrite=True)
    for name, figure in figures(made, summary):
        save_figure(figure, target / f"{name}.png", overwrite=True)
    return target
