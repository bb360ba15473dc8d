"""Page of the map of a cube: shares of the statuses, figures, parameters, plan."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath

from pellicle.reporting import map_text
from pellicle.reporting.map_summary import MapSummary
from pellicle.reporting.page.document import Table, page, picture


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
