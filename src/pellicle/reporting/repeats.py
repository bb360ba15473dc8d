"""Report, JSON record and files of repeated measurements."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.files import MARKER, new_folder, write_text
from pellicle.reporting.json_record import failed, indented, strict, taken, versions
from pellicle.reporting.plain_text import blocks_of, csv_rows, facts, table, wrapped, written_by

if TYPE_CHECKING:
    from pellicle.fitting.repeated_measurements import RepeatedParameter, Repeats

SCHEMA = "pellicle.repeats/1"
FILES = RECORD, TABLE, TEXT = "repeats.json", "repeats.csv", "repeats.txt"


def report(repeats: Repeats) -> str:
    """Format the verdict, a row for each parameter, and what was left out."""
    scatter = [*table(rows(repeats)), "", *facts(notes(repeats))]
    sentences = [line for text in warnings(repeats) for line in wrapped(text, "- ", "  ")]
    parts = (("Repeats", wrapped(repeats.verdict)), ("Scatter of the parameters", scatter))
    return blocks_of([*parts, ("Warnings", sentences)])


def rows(repeats: Repeats) -> list[tuple[str, ...]]:
    """Head and cells of a table with a row for each parameter."""
    from pellicle.fitting.repeated_measurements import short

    head = ("", "mean", "± its sd", "scatter", "stated noise", "ratio", "probability", "± 95 %", "unit")
    cells = []
    for p in repeats.parameters.values():
        scatter = map(short, (p.sd_mean, p.sd, p.stated, p.ratio))
        cells.append((p.name, f"{p.mean:.7g}", *scatter, f"{p.probability:.2g}", short(p.expanded), p.unit))
    return [head, *cells]


def notes(repeats: Repeats) -> list[tuple[str, str]]:
    """Names of columns of the table, each with its meaning."""
    few = next(iter(repeats.parameters.values()))
    return [
        (
            "scatter",
            f"standard deviation of one value; from {len(few.values)} values it is known within"
            f" {100 * few.sd_uncertainty:.0f} %",
        ),
        ("ratio", f"of the scatter to the stated noise errors: √(χ² / {few.freedom})"),
        ("probability", "that noise as stated scatters at least so much"),
        ("± 95 %", "expanded uncertainty of the mean, with the effects that all repeats share"),
    ]


def warnings(repeats: Repeats) -> list[str]:
    """Sentences on fits that were left out and parameters that were not compared."""
    uncompared = ", ".join(repeats.uncompared)
    own = [f"not compared, on a bound or without a finite error: {uncompared}"] if uncompared else []
    return [*repeats.warnings, *own]


def to_json(repeats: Repeats) -> dict[str, Any]:
    """Convert to dictionaries of the schema; infinite numbers are None."""
    return {
        "schema": SCHEMA,
        "data": [{"path": r.path, "status": str(r.status), "used": not r.left_out} for r in repeats.repeats],
        "verdict": repeats.verdict,
        "parameters": {name: _parameter(p) for name, p in repeats.parameters.items()},
        **strict(taken(repeats, "uncompared", "warnings")),
        "versions": versions(),
    }


def failure(paths: Sequence[str], error: str) -> dict[str, Any]:
    """Build the record of repeats that could not be compared."""
    return failed(SCHEMA, [{"path": path, "status": None, "used": False} for path in paths], error)


def _parameter(p: RepeatedParameter) -> dict[str, Any]:
    record = {
        **taken(p, "unit", "values"),
        "stderr_noise": p.noise,
        **taken(p, "mean", "sd", "sd_mean"),
        "degrees_of_freedom": p.freedom,
        **taken(p, "chi2", "probability", "ratio", "agreement"),
        "stderr_common": p.shared,
        "stderr": p.stderr,
        "effective_degrees_of_freedom": p.effective_freedom,
        **taken(p, "coverage_factor", "expanded"),
    }
    return strict(record)


def write_repeats(folder: str | os.PathLike[str], repeats: Repeats) -> Path:
    """Write repeats.json, repeats.csv and repeats.txt into a folder.

    Returns the folder. Raises UsageError where it holds files that pellicle did not write.
    """
    target, record = new_folder(folder), indented(to_json(repeats))
    if not (target / MARKER).exists():
        write_text(target / MARKER, record)
    rows = [{"parameter": name, **_parameter(p)} for name, p in repeats.parameters.items()]
    header = [name for name in rows[0] if name not in ("values", "stderr_noise")]
    cells = [[row[name] for name in header] for row in rows]
    text_of_table = csv_rows(header, cells, [f"scatter of repeated measurements; {written_by()}"])
    for name, text in zip(FILES, (record, text_of_table, report(repeats)), strict=True):
        write_text(target / name, text, overwrite=True)
    return target
