"""Report, JSON record, page and folder of a comparison of recipes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from pellicle.files import MARKER, new_folder, write_text
from pellicle.fitting.status import describe
from pellicle.reporting.folders import PAGE, REPORT, folder_per_file, write_fit
from pellicle.reporting.json_record import indented, versions
from pellicle.reporting.json_record import to_json as fit_to_json
from pellicle.reporting.page import figures
from pellicle.reporting.page.document import page
from pellicle.reporting.page.fit_page import MOST_FIGURES, TONES
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
    target = new_folder(folder)
    folders = folder_per_file(target, [c.name for c in comparison.candidates])
    for c, own in zip(comparison.candidates, folders, strict=True):
        write_fit(own, c.fit)
    write_text(target / MARKER, indented(to_json(comparison)), overwrite=True)
    write_text(target / REPORT, report(comparison), overwrite=True)
    links = [(own / PAGE).relative_to(target).as_posix() for own in folders]
    write_text(target / PAGE, comparison_page(comparison, links), overwrite=True)
    return target


_MOST_PARAMETERS = 6
"""Free parameters told of each fit; its own page has them all."""


def comparison_page(comparison: Comparison, pages: Sequence[str | None]) -> str:
    """Format a comparison of recipes as a page.

    **Arguments:** `pages`, the path of each candidate's own page relative to this one, with slashes, None
    where there is none.
    """
    best = comparison.best
    others = [c for c in comparison.candidates if c is not best]
    curves = [(c.name, c.fit) for c in others]
    parts = range(min(len(best.fit.parts), MOST_FIGURES))
    drawn = [figures.of_candidates(best.fit, curves, i) for i in parts]
    rows = [
        _row(c, best, None if c is best else others.index(c), link)
        for c, link in zip(comparison.candidates, pages, strict=True)
    ]
    return page(
        "comparison.html",
        f"{len(rows)} recipes compared",
        drawn,
        data_figures=drawn,
        tone=TONES[best.fit.status],
        best=best.name,
        verdict=comparison.verdict,
        points=f"{comparison.effective_points:.3g}",
        rows=sorted(rows, key=lambda row: row["bic"]),
    )


def _row(c: Candidate, best: Candidate, number: int | None, link: str | None) -> dict[str, Any]:
    """Cells of one recipe; `number` is that of its curve among those that can be shown, None for the best."""
    free = [p for p in c.fit.free if not p.name.startswith("instrument.")]
    told = ", ".join(describe(p) for p in free[:_MOST_PARAMETERS])
    return {
        "name": c.name,
        "link": None if link is None else quote(link),
        "number": number,
        "status": str(c.fit.status),
        "tone": TONES[c.fit.status],
        "bic": c.bic - best.bic,
        "cells": [
            f"{c.bic - best.bic:.1f}",
            f"{c.aic - best.aic:.1f}",
            str(c.free),
            f"{c.fit.chi2_reduced:.4g}",
            "" if c.fit.rms is None else f"{c.fit.rms:.4g}",
        ],
        "parameters": told + (", ..." if len(free) > _MOST_PARAMETERS else ""),
        "verdict": c.fit.verdict,
    }
