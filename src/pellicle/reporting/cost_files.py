"""JSON record, table and folder of accuracy against time."""

from __future__ import annotations

import csv
import os
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.files import MARKER, new_folder, write_text
from pellicle.reporting.json_record import indented, versions

if TYPE_CHECKING:
    from pellicle.accuracy.cost import Cost
    from pellicle.accuracy.registry import Comparison
    from pellicle.accuracy.surface import SurfaceCost

SCHEMA = "pellicle.cost/1"
COLUMNS = (
    *("kind", "name", "leaves_out", "error", "seconds", "compile_seconds", "flops", "pareto"),
    *("median_error", "failures", "datasets", "coverage", "doubt", "width"),
)


def to_json(cost: Cost | SurfaceCost, recipe: str) -> dict[str, Any]:
    """Convert to dictionaries: all methods in one list, `rungs`, each with its `kind`.

    Kinds of a film are "forward", "inverse" (a solver) and "interval" (its error is the distance of its
    coverage from 95 %), or of its colours "colour" (mean ΔE2000); of a surface "colour" and "brdf" (relative
    error). `recommended` names a forward method, or one for colours; `within` says whether it meets the
    tolerance. `brdf` has the same keys for a surface's values. Infinite errors are None.
    """
    from pellicle.accuracy.surface import SurfaceCost

    details = _surface(cost) if isinstance(cost, SurfaceCost) else _film(cost)
    end = {"interrupted": cost.interrupted, "versions": versions()}
    return {"schema": SCHEMA, "recipe": recipe} | details | end


def _film(cost: Cost) -> dict[str, Any]:
    methods, solvers, intervals = cost.methods, cost.solvers, cost.intervals
    omitted = [part.left_out for part in (methods, solvers, intervals) if part is not None]
    return {
        **_summary(methods),
        "wavelengths": methods.wavelengths,
        "draws": methods.draws,
        "rungs": _rungs(methods, solvers, intervals),
        "recommended_solver": None if solvers is None else solvers.recommended,
        "recommended_interval": None if intervals is None else intervals.recommended,
        "noise": None if solvers is None else solvers.noise,
        "left_out": {name: why for left_out in omitted for name, why in left_out.items()},
        "no_fits": cost.no_solvers or None,
    }


def _surface(cost: SurfaceCost) -> dict[str, Any]:
    parts = [part for part in (cost.colours, cost.values) if part is not None]
    first = parts[0]
    return {
        **_summary(first),
        "draws": first.draws,
        "rungs": _rungs(*parts),
        "brdf": _summary(cost.values),
        "left_out": {name: why for methods in parts for name, why in methods.left_out.items()},
        "no_colours": cost.no_colours or None,
    }


def _rungs(*comparisons: Comparison | None) -> list[dict[str, Any]]:
    return [
        {"kind": part.kind, **result.record()}
        for part in comparisons
        if part is not None
        for result in part.results
    ]


def _summary(methods: Comparison) -> dict[str, Any]:
    names = ("reference", "tolerance", "unit", "recommended", "within")
    return {name: getattr(methods, name) for name in names}


def to_csv(rungs: list[dict[str, Any]]) -> str:
    """Format the methods of a record as rows; columns that a kind of method lacks are empty."""
    text = StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(rungs)
    return text.getvalue()


def write_cost(folder: str | os.PathLike[str], cost: Cost | SurfaceCost, recipe: str = "scene") -> Path:
    """Write result.json, report.txt, cost.csv and cost.png into a folder, each complete or not at all.

    Returns the folder. Raises UsageError where it holds files that pellicle did not write, or cannot be
    written.
    """
    from pellicle.reporting.cost_figure import draw
    from pellicle.reporting.cost_text import text
    from pellicle.reporting.matplotlib_figure import save_figure

    name, record = Path(recipe).name, to_json(cost, recipe)
    target = new_folder(folder)
    write_text(target / MARKER, indented(record), overwrite=True)  # first: it marks the folder
    write_text(target / "report.txt", text(cost, name), overwrite=True)
    write_text(target / "cost.csv", to_csv(record["rungs"]), overwrite=True)
    save_figure(draw(cost, name), target / "cost.png", overwrite=True)
    return target
