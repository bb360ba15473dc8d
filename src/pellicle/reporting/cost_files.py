"""What accuracy costs as files: a record of one JSON schema, a CSV and a figure."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import asdict
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

from pellicle.accuracy.cost import Cost
from pellicle.accuracy.measure import Ladder
from pellicle.accuracy.surface import SurfaceCost
from pellicle.files import MARKER, new_folder, write_text
from pellicle.reporting.json_record import indented, versions

SCHEMA = "pellicle.cost/1"
COLUMNS = (
    *("kind", "name", "leaves_out", "error", "seconds", "compile_seconds", "flops", "pareto"),
    *("median_error", "failures", "datasets", "coverage", "doubt", "width"),
)


def to_json(cost: Cost, recipe: str) -> dict[str, Any]:
    """The record: forward and inverse rungs, and those of intervals, in one list, told by their `kind`.

    An error is null where it is infinite; an interval's is how far its coverage is from 95 %. `recommended`
    is a forward rung's name, `recommended_solver` an inverse one's, `recommended_interval` that of a way to
    an interval; `within` says whether the first meets the tolerance.
    """
    ladder, race, held = cost.ladder, cost.race, cost.intervals
    forward = [{"kind": "forward", **asdict(rung)} for rung in ladder.rungs]
    inverse = [] if race is None else [{"kind": "inverse", **asdict(solver)} for solver in race.solvers]
    ways = [] if held is None else [{"kind": "interval", **asdict(way)} for way in held.ways]
    absent = [part.left_out for part in (ladder, race, held) if part is not None]
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
            for rung in [*forward, *inverse, *ways]
        ],
        "recommended": ladder.recommended,
        "within": ladder.within,
        "recommended_solver": None if race is None else race.recommended,
        "recommended_interval": None if held is None else held.recommended,
        "noise": None if race is None else race.noise,
        "left_out": {name: why for left_out in absent for name, why in left_out.items()},
        "no_fits": cost.no_race or None,
        "interrupted": cost.interrupted,
        "versions": versions(),
    }


def surface_to_json(cost: SurfaceCost, recipe: str) -> dict[str, Any]:
    """The record of a surface: rungs of the `kind` "colour" (errors are mean ΔE2000) and "brdf" (relative).

    `reference`, `tolerance`, `unit`, `recommended` and `within` are those of colours where there are any;
    `brdf` has those of values.
    """
    first = cost.values if cost.colours is None else cost.colours
    kinds = (
        [("brdf", cost.values)] if cost.colours is None else [("colour", cost.colours), ("brdf", cost.values)]
    )
    return {
        "schema": SCHEMA,
        "recipe": recipe,
        **_summary(first),
        "draws": first.draws,
        "rungs": [
            {"kind": kind, **asdict(rung), "error": rung.error if math.isfinite(rung.error) else None}
            for kind, ladder in kinds
            for rung in ladder.rungs
        ],
        "brdf": _summary(cost.values),
        "left_out": {name: why for _, ladder in kinds for name, why in ladder.left_out.items()},
        "no_colours": cost.no_colours or None,
        "interrupted": cost.interrupted,
        "versions": versions(),
    }


def _summary(ladder: Ladder) -> dict[str, Any]:
    return {
        "reference": ladder.reference,
        "tolerance": ladder.tolerance,
        "unit": ladder.unit,
        "recommended": ladder.recommended,
        "within": ladder.within,
    }


def to_csv(rungs: list[dict[str, Any]]) -> str:
    """Every rung of a record as a row; a column that a kind of rung does not have is empty."""
    text = StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(rungs)
    return text.getvalue()


def write_cost(folder: str | os.PathLike[str], cost: Cost, recipe: str) -> Path:
    """Write result.json, report.txt, cost.csv and cost.png into a folder, each whole or not at all.

    Raises UsageError where it holds anything that pellicle did not write, or cannot be written.
    """
    from pellicle.reporting.cost import text
    from pellicle.reporting.cost_figure import figure

    name = Path(recipe).name
    record, report = to_json(cost, recipe), text(cost, name)
    return _written(folder, record, report, partial(figure, cost, name))


def write_surface_cost(folder: str | os.PathLike[str], cost: SurfaceCost, recipe: str) -> Path:
    """The same of a surface."""
    from pellicle.reporting.cost import surface_text
    from pellicle.reporting.cost_figure import surface_figure

    name = Path(recipe).name
    record, report = surface_to_json(cost, recipe), surface_text(cost, name)
    return _written(folder, record, report, partial(surface_figure, cost, name))


def _written(folder: str | os.PathLike[str], record: dict[str, Any], report: str, figure: Any) -> Path:
    target = new_folder(folder)
    write_text(target / MARKER, indented(record), overwrite=True)  # first: it marks the folder
    write_text(target / "report.txt", report, overwrite=True)
    write_text(target / "cost.csv", to_csv(record["rungs"]), overwrite=True)
    figure(target / "cost.png", overwrite=True)
    return target
