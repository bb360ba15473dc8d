"""Results as files: a folder per fit, with tables that pellicle itself can read."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.files import MARKER, new_folder, write_text
from pellicle.reporting.csv_tables import fit_csv as fit_csv
from pellicle.reporting.csv_tables import nk_csv as nk_csv
from pellicle.reporting.json_record import failure as failure
from pellicle.reporting.json_record import indented, versions
from pellicle.reporting.json_record import one_line as one_line
from pellicle.reporting.json_record import to_json as to_json

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit

from typing import TYPE_CHECKING

import numpy as np

from pellicle.data.tabular.columns import DIRECTIONS
from pellicle.reporting.json_record import brdf_to_json as brdf_to_json

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit

INDEX_SCHEMA = "pellicle.fits/1"
SUMMARY = "summary.csv"
FIGURE = "figure.png"


def write_fit(folder: str | os.PathLike[str], fit: Fit, figure: bool = True) -> Path:
    """Write report.txt, result.json, fit.csv, nk.csv and, if asked for, figure.png into a folder.

    Each file appears whole or not at all. In a folder of an earlier fit they replace its files, and
    its figure goes if none is asked for: it would show another fit. Returns the folder; raises
    UsageError where it holds anything that pellicle did not write, or cannot be written.
    """
    from pellicle.reporting.fit_text import report

    target = new_folder(folder)
    write_text(target / MARKER, indented(to_json(fit)), overwrite=True)  # first: it marks the folder as ours
    write_text(target / "report.txt", report(fit), overwrite=True)
    write_text(target / "fit.csv", fit_csv(fit), overwrite=True)
    write_text(target / "nk.csv", nk_csv(fit), overwrite=True)
    if figure:
        from pellicle.reporting.fit_figure import figure as draw  # matplotlib only if a figure is asked for

        draw(fit, target / FIGURE, overwrite=True)
    else:
        (target / FIGURE).unlink(missing_ok=True)
    return target


def several(folder: str | os.PathLike[str], paths: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The folder of each file's fit: `folder` itself for one file, else sub-folders by the files' stems.

    A stem that was there before, in whatever case, gets -2, -3, ... For several files `folder` is
    made, and a result.json in it says which file went where. Raises UsageError as `write_fit` does.
    """
    if len(paths) < 2:
        return [Path(folder) for _ in paths]
    root, taken, names = new_folder(folder), {MARKER, SUMMARY}, []
    for path in paths:
        names.append(_untaken(Path(path).stem or "spectrum", taken))
        taken.add(names[-1].casefold())
    files = [{"path": os.fspath(path), "folder": name} for path, name in zip(paths, names, strict=True)]
    index = {"schema": INDEX_SCHEMA, "files": files, "versions": versions()}
    write_text(root / MARKER, indented(index), overwrite=True)
    return [root / name for name in names]


def _untaken(stem: str, taken: set[str]) -> str:
    name, count = stem, 1
    while name.casefold() in taken:
        count += 1
        name = f"{stem}-{count}"
    return name


def write_summary(path: str | os.PathLike[str], fits: Iterable[Fit | Mapping[str, Any]]) -> None:
    """Write one row per file: path, status, verdict, free parameters with errors, rms, reduced χ².

    `fits` holds fits and records of failures, in the order of the files. Replaces an earlier summary
    in a folder that pellicle wrote; raises UsageError in a folder that holds anything else.
    """
    rows = [_summary_row(fit if isinstance(fit, Mapping) else to_json(fit)) for fit in fits]
    ends = ("rms", "chi2_reduced", "sha256", "error")
    union = dict.fromkeys(name for row in rows for name in row)  # in order of appearance
    text = StringIO(f"# one row per fitted file; written by pellicle {version('pellicle')}\n")
    text.seek(0, os.SEEK_END)
    header = [*(name for name in union if name not in ends), *ends]
    writer = csv.DictWriter(text, header, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    new_folder(Path(path).parent)
    write_text(path, text.getvalue(), overwrite=True)


def _summary_row(record: Mapping[str, Any]) -> dict[str, Any]:
    row = {"path": record["data"]["path"], "status": record["status"], "verdict": record["verdict"]}
    for name, p in record["parameters"].items():
        if p["free"]:
            row |= {name: _known(p["value"]), f"{name}_stderr": _known(p["stderr"])}
    return row | {
        "rms": _known(record["rms"]),
        "chi2_reduced": _known(record["chi2_reduced"]),
        "sha256": record["data"]["sha256"] or "",
        "error": record.get("error", ""),
    }


def _known(value: float | None) -> str:
    return "" if value is None else f"{value:.10g}"


def write_brdf_fit(folder: str | os.PathLike[str], fit: Fit) -> Path:
    """Write report.txt, result.json, fit.csv and figure.png into a folder, each whole or not at all.

    Raises UsageError where it holds anything that pellicle did not write, or cannot be written.
    """
    from pellicle.reporting.brdf import brdf_report
    from pellicle.reporting.brdf_figure import brdf_figure

    target = new_folder(folder)
    write_text(target / MARKER, indented(brdf_to_json(fit)), overwrite=True)
    write_text(target / "report.txt", brdf_report(fit), overwrite=True)
    write_text(target / "fit.csv", brdf_csv(fit), overwrite=True)
    brdf_figure(fit, target / "figure.png", overwrite=True)
    return target


def brdf_csv(fit: Fit) -> str:
    """Every sample with its model: pellicle reads the data again as they were."""
    samples, names = fit.samples, fit.samples.channels
    header = [
        f"# BRDF in 1/sr, directions in degrees; model_{names[0]} and so on: {fit.surface.model} as fitted",
        f"# from {' '.join(samples.path.split()) or 'samples'}, sha256 {samples.sha256 or 'unknown'}",
        f"# written by pellicle {version('pellicle')}",
        ",".join([*DIRECTIONS, *names, *(f"model_{name}" for name in names)]),
    ]
    columns = [*(getattr(samples, name) for name in DIRECTIONS), samples.values, fit.model]
    rows = (",".join(f"{x:.8g}" for x in row) for row in np.column_stack(columns))
    return "\n".join([*header, *rows]) + "\n"
