"""Report, JSON record and folder of a comparison of recipes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.files import MARKER, new_folder, write_text
from pellicle.fitting.status import describe
from pellicle.reporting.folders import PAGE, REPORT, folder_per_file, write_fit
from pellicle.reporting.json_record import indented, versions
from pellicle.reporting.json_record import to_json as fit_to_json
from pellicle.reporting.plain_text import INDENT, block, table, wrapped

if TYPE_CHECKING:
    from pellicle.fitting.comparison import Candidate, Comparison

SCHEMA = "pellicle.compare/1"
_SHOWN = 5
"""Parameters shown of each fit."""


def report(comparison: Comparison) -> str:
    """Format the verdict, the criteria relative to those of the best recipe, and the verdict of each fit."""
    best = comparison.best
    parts = best.fit.parts
    points = sum(part.curve.model.size for part in parts)
    names = ", ".join(part.data.path.replace("\\", "/").rsplit("/", 1)[-1] or "spectrum" for part in parts)
    data = f"{names}: {points} points, worth {comparison.effective_points:.3g} independent ones"
    rows = [("", "recipe", "ΔBIC", "ΔAIC", "free", "chi-square", "rms", "status")]
    rows += [
        (
            "*" if c is best else "",
            c.name,
            f"{c.bic - best.bic:.1f}",
            f"{c.aic - best.aic:.1f}",
            str(c.free),
            f"{c.fit.chi2_reduced:.3g}",
            "" if c.fit.rms is None else f"{c.fit.rms:.3g}",
            c.fit.status,
        )
        for c in comparison.candidates
    ]
    note = f"{INDENT}* the recipe of least BIC; ΔBIC and ΔAIC are relative to it"
    fits = [line for c in comparison.candidates for line in wrapped(_fit(c), "", "  ")]
    return (
        block("Verdict", [*wrapped(comparison.verdict), *wrapped(data)])
        + block("Comparison", [*table(rows), "", note])
        + block("Fits", fits)
    )


def _fit(c: Candidate) -> str:
    """The leading parameters of a fit and its verdict."""
    leading = [p for p in c.fit.free if not p.name.startswith("instrument.")]
    more = len(leading) - _SHOWN
    values = ", ".join(describe(p) for p in leading[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
    return f"{c.name}: {values}. {c.fit.verdict}"


def to_json(comparison: Comparison) -> dict[str, Any]:
    """Convert a comparison to dictionaries: the criteria of every recipe and the record of its fit."""
    best = comparison.best
    return {
        "schema": SCHEMA,
        "data": fit_to_json(best.fit)["data"],
        "best": best.name,
        "verdict": comparison.verdict,
        "effective_points": comparison.effective_points,
        "recipes": [_candidate(c, best) for c in comparison.candidates],
        "versions": versions(),
    }


def _candidate(c: Candidate, best: Candidate) -> dict[str, Any]:
    record = fit_to_json(c.fit)
    keys = ("status", "verdict", "parameters", "chi2_reduced", "rms", "rivals", "warnings", "seconds")
    criteria = {"aic": c.aic, "bic": c.bic, "delta_aic": c.aic - best.aic, "delta_bic": c.bic - best.bic}
    return {"recipe": c.name, "free": c.free, **criteria, **{key: record[key] for key in keys}}


def failure(path: str, error: str) -> dict[str, Any]:
    """Build the record of data that could not be compared."""
    data = {"path": path, "sha256": None, "signal": None, "points": 0}
    return {"schema": SCHEMA, "data": data, "status": "failed", "error": error, "versions": versions()}


def write_comparison(folder: str | os.PathLike[str], comparison: Comparison) -> Path:
    """Write report.txt, report.html and result.json into a folder, and each recipe's fit into a sub-folder.

    Returns the folder. Raises UsageError as `write_fit` does.
    """
    from pellicle.reporting.page.comparison_page import comparison_page

    target = new_folder(folder)
    folders = folder_per_file(target, [c.name for c in comparison.candidates])
    for c, own in zip(comparison.candidates, folders, strict=True):
        write_fit(own, c.fit)
    write_text(target / MARKER, indented(to_json(comparison)), overwrite=True)
    write_text(target / REPORT, report(comparison), overwrite=True)
    links = [(own / PAGE).relative_to(target).as_posix() for own in folders]
    write_text(target / PAGE, comparison_page(comparison, links), overwrite=True)
    return target
