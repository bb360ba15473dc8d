"""Page and folder of the map of a cube."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from pellicle.files import write_text
from pellicle.mapping.map_result import Map
from pellicle.reporting.folders import PAGE, REPORT
from pellicle.reporting.json_record import write_result
from pellicle.reporting.map_figures import figures
from pellicle.reporting.map_summary import MapSummary, summarise
from pellicle.reporting.map_text import (
    ERRORS,
    cube_json,
    cube_report,
    decided_in_words,
    file_rows,
    in_words,
    parameter_rows,
    plan_rows,
    rate_rows,
    status_rows,
)
from pellicle.reporting.matplotlib_figure import save_figure
from pellicle.reporting.page.document import Table, page, picture

if TYPE_CHECKING:
    from xarray import Dataset


def write_cube_map(folder: str | os.PathLike[str], made: Dataset | Map) -> Path:
    """Write result.json, report.txt, report.html and figures of a map, and return the folder.

    Each file appears complete or not at all.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    summary, images = summarise(made), {}
    target = write_result(folder, cube_json(made, summary), {REPORT: cube_report(made, summary)})
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
    sentence = in_words(summary)
    parameters = [row for p in summary.parameters for row in parameter_rows(p)]
    path = str(summary.attributes.get("path", "")).replace("\\", "/")
    return page(
        "map.html",
        f"Map of {PurePosixPath(path).name}" if path else "Map",
        [],
        tone="good" if 2 * summary.decided >= summary.with_data > 0 else "warn",
        sentence=sentence,
        decided=decided_in_words(summary),
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
