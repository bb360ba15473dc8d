"""Report, JSON record, page and folder of a comparison of recipes."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pellicle.files import new_folder
from pellicle.fitting.comparison import Candidate, Comparison
from pellicle.fitting.status import describe
from pellicle.reporting import figures
from pellicle.reporting.folders import PAGE, REPORT, folder_per_file, write_fit
from pellicle.reporting.json_record import failed, taken, versions, write_result
from pellicle.reporting.json_record import to_json as fit_to_json
from pellicle.reporting.page.document import page
from pellicle.reporting.page.fit_pages import MOST_FIGURES, TONES
from pellicle.reporting.plain_text import INDENT, blocks_of, table, wrapped

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
    rows = [("", "recipe", "Δ ln Z", "ΔBIC", "ΔAIC", "free", "chi-square", "rms", "status")]
    rows += [
        ("*" if c is best else "", c.name, *_criteria(c, best, 3), c.fit.status)
        for c in comparison.candidates
    ]
    note = f"{INDENT}* the recipe of most evidence Z; differences are relative to it"
    fits = []
    for c in comparison.candidates:
        values, more = _leading(c, _SHOWN)
        values += f" and {more} more" if more else ""
        fits += wrapped(f"{c.name}: {values}. {c.fit.verdict}", "", "  ")
    verdict = [*wrapped(comparison.verdict), *wrapped(data)]
    return blocks_of([("Verdict", verdict), ("Comparison", [*table(rows), "", note]), ("Fits", fits)])


def _criteria(c: Candidate, best: Candidate, digits: int) -> tuple[str, ...]:
    """Texts of Δ ln Z, ΔBIC, ΔAIC, number of free parameters, reduced χ² and rms."""
    rms = "" if c.fit.rms is None else f"{c.fit.rms:.{digits}g}"
    chi2 = f"{c.fit.chi2_reduced:.{digits}g}"
    less = (c.log_evidence - best.log_evidence, c.bic - best.bic, c.aic - best.aic)
    return *(f"{x + 0.0:.1f}" for x in less), str(c.free), chi2, rms


def _leading(c: Candidate, most: int) -> tuple[str, int]:
    """The first parameters of a fit in words, without those of the instrument, and the number of others."""
    free = [p for p in c.fit.free if not p.name.startswith("instrument.")]
    return ", ".join(describe(p) for p in free[:most]), max(len(free) - most, 0)


def to_json(comparison: Comparison) -> dict[str, Any]:
    """Convert a comparison to dictionaries: the criteria of every recipe and the record of its fit."""
    best, recipes = comparison.best, []
    keys = ("status", "verdict", "parameters", "chi2_reduced", "rms", "rivals", "warnings", "seconds")
    for c in comparison.candidates:
        record = fit_to_json(c.fit)
        criteria = {"delta_aic": c.aic - best.aic, "delta_bic": c.bic - best.bic}
        criteria |= taken(c, "log_evidence")
        criteria["delta_log_evidence"] = c.log_evidence - best.log_evidence
        criteria["probability"] = comparison.probabilities[c.name]
        recipes.append({"recipe": c.name, **taken(c, "free", "aic", "bic"), **criteria})
        recipes[-1] |= {key: record[key] for key in keys}
    return {
        "schema": SCHEMA,
        "data": fit_to_json(best.fit)["data"],
        "best": best.name,
        "verdict": comparison.verdict,
        "effective_points": comparison.effective_points,
        "recipes": recipes,
        "versions": versions(),
    }


def failure(path: str, error: str) -> dict[str, Any]:
    """Build the record of data that could not be compared."""
    return failed(SCHEMA, {"path": path, "sha256": None, "signal": None, "points": 0}, error)


def write_comparison(
    folder: str | os.PathLike[str], comparison: Comparison, again: Sequence[tuple[str, str]] = ()
) -> Path:
    """Write report.txt, report.html and result.json into a folder, and each recipe's fit into a sub-folder.

    `again` is what repeats it: descriptions and texts. Returns the folder. Raises UsageError as `write_fit`
    does.
    """
    target = new_folder(folder)
    folders = folder_per_file(target, [c.name for c in comparison.candidates])
    for c, own in zip(comparison.candidates, folders, strict=True):
        write_fit(own, c.fit)
    links = [(own / PAGE).relative_to(target).as_posix() for own in folders]
    contents = {REPORT: report(comparison), PAGE: comparison_page(comparison, links, again)}
    return write_result(target, to_json(comparison), contents)


_MOST_PARAMETERS = 6
"""Free parameters told of each fit; its own page has them all."""


def comparison_page(
    comparison: Comparison, pages: Sequence[str | None], again: Sequence[tuple[str, str]] = ()
) -> str:
    """Format a comparison of recipes as a page.

    **Arguments:** `pages`, the path of each candidate's own page relative to this one, with slashes, None
    where there is none; `again`, what repeats the comparison: descriptions and texts to copy.
    """
    best = comparison.best
    others = [c for c in comparison.candidates if c is not best]
    curves = [(c.name, c.fit) for c in others]
    parts = range(min(len(best.fit.parts), MOST_FIGURES))
    drawn = [figures.of_candidates(best.fit, curves, i) for i in parts]
    rows = []
    for c, link in sorted(
        zip(comparison.candidates, pages, strict=True), key=lambda pair: -pair[0].log_evidence
    ):
        values, more = _leading(c, _MOST_PARAMETERS)
        row = {
            "name": c.name,
            "link": None if link is None else quote(link),
            "number": None if c is best else others.index(c),  # of its curve among those that can be shown
            "status": c.fit.status,
            "tone": TONES[c.fit.status],
            "cells": _criteria(c, best, 4),
            "parameters": values + (", ..." if more else ""),
            "verdict": c.fit.verdict,
        }
        rows.append(row)
    return page(
        "comparison.html",
        f"{len(rows)} recipes compared",
        drawn,
        data_figures=drawn,
        tone=TONES[best.fit.status],
        best=best.name,
        verdict=comparison.verdict,
        points=f"{comparison.effective_points:.3g}",
        rows=rows,
        again=again,
    )
