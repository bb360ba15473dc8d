"""Page of a comparison: verdict, data with the curve of each fit, criteria, links to their pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from pellicle.fitting.status import describe
from pellicle.reporting.page import figures
from pellicle.reporting.page.document import page
from pellicle.reporting.page.fit_page import MOST_FIGURES, TONES

if TYPE_CHECKING:
    from pellicle.fitting.comparison import Candidate, Comparison

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
