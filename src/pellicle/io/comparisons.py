"""A comparison of recipes as a record of one JSON schema, and as files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.io.atomic import MARKER, new_folder, write_text
from pellicle.io.records import indented, versions
from pellicle.io.records import to_json as fit_to_json

if TYPE_CHECKING:
    from pellicle.fitting.compare import Candidate, Comparison

SCHEMA = "pellicle.compare/1"


def to_json(found: Comparison) -> dict[str, Any]:
    """A comparison as plain dictionaries: the criteria of every recipe beside the record of its fit."""
    data = fit_to_json(found.best.fit)["data"]
    return {
        "schema": SCHEMA,
        "data": data,
        "best": found.best.name,
        "verdict": found.verdict,
        "effective_points": found.effective_points,
        "recipes": [_candidate(c, found.best) for c in found.candidates],
        "versions": versions(),
    }


def _candidate(c: Candidate, best: Candidate) -> dict[str, Any]:
    record = fit_to_json(c.fit)
    own = ("status", "verdict", "parameters", "chi2_reduced", "rms", "rivals", "warnings", "seconds")
    criteria = {"aic": c.aic, "bic": c.bic, "delta_aic": c.aic - best.aic, "delta_bic": c.bic - best.bic}
    return {"recipe": c.name, "free": c.free, **criteria, **{key: record[key] for key in own}}


def failure(path: str, error: str) -> dict[str, Any]:
    """The record of data that could not be compared, and why."""
    data = {"path": path, "sha256": None, "signal": None, "points": 0}
    return {"schema": SCHEMA, "data": data, "status": "failed", "error": error, "versions": versions()}


def write_comparison(folder: str | os.PathLike[str], found: Comparison) -> Path:
    """Write report.txt and result.json into a folder, and every recipe's fit into one beneath it.

    Returns the folder. Raises UsageError as `write_fit` does.
    """
    from pellicle.io.results import several, write_fit
    from pellicle.report.comparison import report

    target = new_folder(folder)
    folders = several(target, [c.name for c in found.candidates])
    for c, own in zip(found.candidates, folders, strict=True):
        write_fit(own, c.fit)
    write_text(target / MARKER, indented(to_json(found)), overwrite=True)
    write_text(target / "report.txt", report(found), overwrite=True)
    return target
