"""A comparison as plain text: what the data call for, then the table it rests on."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.files import MARKER, new_folder, write_text
from pellicle.fitting.comparison import Candidate, Comparison
from pellicle.fitting.status import describe
from pellicle.reporting.json_record import indented, versions
from pellicle.reporting.json_record import to_json as fit_to_json
from pellicle.reporting.plain_text import INDENT, block, table, wrapped

if TYPE_CHECKING:
    from pellicle.fitting.comparison import Candidate, Comparison

_SHOWN = 3
"""Parameters that are told of each fit."""


def report(found: Comparison) -> str:
    """The verdict, the criteria against those of the best, and every fit's own verdict."""
    parts = found.best.fit.parts
    points = sum(part.spectral.wavelength.size for part in parts)
    of = ", ".join(part.spectrum.path.replace("\\", "/").rsplit("/", 1)[-1] or "spectrum" for part in parts)
    counted = f"{of}: {points} points, worth {found.effective_points:.3g} independent ones"
    rows = [("", "recipe", "ΔBIC", "ΔAIC", "free", "chi-square", "rms", "status")]
    rows += [_row(c, found.best) for c in found.candidates]
    notes = ["", f"{INDENT}* the least BIC; the criteria are above those of that recipe"]
    fits = [line for c in found.candidates for line in wrapped(_told(c), "", "  ")]
    return block("Verdict", [*wrapped(found.verdict), *wrapped(counted)]) + "".join(
        [block("Comparison", [*table(rows), *notes]), block("Fits", fits)]
    )


def _row(c: Candidate, best: Candidate) -> tuple[str, ...]:
    rms = "" if c.fit.rms is None else f"{c.fit.rms:.3g}"
    return (
        "*" if c is best else "",
        c.name,
        f"{c.bic - best.bic:.1f}",
        f"{c.aic - best.aic:.1f}",
        str(c.free),
        f"{c.fit.chi2_reduced:.3g}",
        rms,
        c.fit.status,
    )


def _told(c: Candidate) -> str:
    """A fit's leading parameters and its verdict."""
    steep = [p for p in c.fit.free if not p.name.startswith("instrument.")]
    told = ", ".join(describe(p) for p in steep[:_SHOWN]) + (", ..." if len(steep) > _SHOWN else "")
    return f"{c.name}: {told}. {c.fit.verdict}"


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
    from pellicle.reporting.comparison import report
    from pellicle.reporting.folders import several, write_fit

    target = new_folder(folder)
    folders = several(target, [c.name for c in found.candidates])
    for c, own in zip(found.candidates, folders, strict=True):
        write_fit(own, c.fit)
    write_text(target / MARKER, indented(to_json(found)), overwrite=True)
    write_text(target / "report.txt", report(found), overwrite=True)
    return target
