"""A comparison as plain text: what the data call for, then the table it rests on."""

from __future__ import annotations

from pellicle.fitting.compare import Candidate, Comparison
from pellicle.fitting.status import describe
from pellicle.report.page import INDENT, block, table, wrapped

_SHOWN = 3
"""Parameters that are told of each fit."""


def report(found: Comparison) -> str:
    """The verdict, the criteria against those of the best, and every fit's own verdict."""
    parts = found.best.fit.parts
    points = sum(part.curve.wavelength.size for part in parts)
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
