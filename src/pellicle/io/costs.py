"""What accuracy costs as files: a record of one JSON schema, a CSV and a figure."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from typing import Any

from pellicle.io.atomic import MARKER, new_folder, write_text
from pellicle.io.records import indented, versions
from pellicle.ladder.cost import Cost

SCHEMA = "pellicle.cost/1"
COLUMNS = (
    *("kind", "name", "leaves_out", "error", "seconds", "compile_seconds", "flops", "pareto"),
    *("median_error", "failures", "datasets"),
)


def to_json(cost: Cost, recipe: str) -> dict[str, Any]:
    """The record: forward and inverse rungs in one list, told by their `kind`.

    An error is null where it is infinite. `recommended` is a forward rung's name, `recommended_solver` an
    inverse one's; `within` says whether the first meets the tolerance.
    """
    ladder, race = cost.ladder, cost.race
    forward = [{"kind": "forward", **asdict(rung)} for rung in ladder.rungs]
    inverse = [] if race is None else [{"kind": "inverse", **asdict(solver)} for solver in race.solvers]
    return {
        "schema": SCHEMA,
        "recipe": recipe,
        "reference": ladder.reference,
        "tolerance": ladder.tolerance,
        "unit": ladder.unit,
        "wavelengths": ladder.wavelengths,
        "draws": ladder.draws,
        "rungs": [
            rung | {"error": rung["error"] if math.isfinite(rung["error"]) else None}
            for rung in [*forward, *inverse]
        ],
        "recommended": ladder.recommended,
        "within": ladder.within,
        "recommended_solver": None if race is None else race.recommended,
        "noise": None if race is None else race.noise,
        "left_out": ladder.left_out | ({} if race is None else race.left_out),
        "no_fits": cost.no_race or None,
        "interrupted": cost.interrupted,
        "versions": versions(),
    }


def to_csv(cost: Cost) -> str:
    """Every rung as a row; a column that a kind of rung does not have is empty."""
    text = StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(to_json(cost, "")["rungs"])
    return text.getvalue()


def write_cost(folder: str | os.PathLike[str], cost: Cost, recipe: str) -> Path:
    """Write result.json, report.txt, cost.csv and cost.png into a folder, each whole or not at all.

    Raises UsageError where it holds anything that pellicle did not write, or cannot be written.
    """
    from pellicle.report.cost import figure, text

    target, name = new_folder(folder), Path(recipe).name
    write_text(target / MARKER, indented(to_json(cost, recipe)), overwrite=True)  # first: it marks the folder
    write_text(target / "report.txt", text(cost, name), overwrite=True)
    write_text(target / "cost.csv", to_csv(cost), overwrite=True)
    figure(cost, name, target / "cost.png", overwrite=True)
    return target
