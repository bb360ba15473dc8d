"""The report of a BRDF fit as plain text: the verdict first, then the numbers it rests on."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable

from pellicle.brdf_fitting.result import BrdfFit
from pellicle.fitting.result import Estimate
from pellicle.report.text import ADVICE, COLUMNS, MOST_RIVALS

_INDENT = "    "


def brdf_report(fit: BrdfFit) -> str:
    """Everything a fit found, as text of at most 100 columns without colour codes."""
    samples = fit.samples
    depth = fit.parameters.get("thickness")
    facts = [
        ("status", f"{fit.status}. {ADVICE[fit.status]}"),
        ("file", samples.path),
        ("data", f"{len(samples)} samples of {', '.join(samples.channels)}"),
        ("model", fit.surface.model),
        ("compared", fit.residual + (" over sigma" if samples.sigma is not None else "")),
        ("rms", f"{fit.rms:.4g}"),
        ("seconds", f"{fit.seconds:.1f}"),
    ]
    errors = [
        ("held-out error", "of a fit to four fifths of the samples"),
        ("this surface", f"{fit.held_out:.4g}"),
    ]
    errors += [(b.name, f"{b.held_out:.4g}") for b in fit.baselines]
    rivals = [
        (f"Δχ² {rival.delta_chi2:.3g}", f"thickness {rival.parameters['thickness']:.5g} nm")
        for rival in fit.rivals[:MOST_RIVALS]
        if depth is not None and depth.free
    ]
    blocks = [
        ("Verdict", [*_wrap(fit.verdict), *_facts(facts)]),
        ("With and without a layer", _facts(errors)),
        ("Parameters", _facts((p.name, _value(p)) for p in fit.parameters.values())),
        ("Rivals: other minima and how much worse they fit", _facts(rivals)),
        ("Plan: what was simulated", _facts((row.effect, row.why) for row in fit.plan.rows if row.on)),
        ("Warnings", [line for warning in fit.warnings for line in _wrap(warning, "- ", "  ")]),
    ]
    return "\n".join("\n".join([f"[[{title}]]", *lines]) for title, lines in blocks if lines) + "\n"


def _value(p: Estimate) -> str:
    unit = f" {p.unit}" if p.unit else ""
    if not p.free:
        return f"{p.value:.6g}{unit} (fixed)"
    error = f" ± {p.stderr:.2g}" if math.isfinite(p.stderr) else ""
    bound = "  AT ITS BOUND" if p.at_bound else ""
    known = "" if error else ", not determined"
    return f"{p.value:.6g}{error}{unit}{known}  [{p.lower:g}, {p.upper:g}]{bound}"


def _facts(rows: Iterable[tuple[str, str]]) -> list[str]:
    rows = [(name, text) for name, text in rows if text]
    width = max((len(name) for name, _ in rows), default=0)
    return [line for name, text in rows for line in _wrap(text, f"{name:<{width}}  ", " " * (width + 2))]


def _wrap(text: str, first: str = "", rest: str = "") -> list[str]:
    before, after = _INDENT + first, _INDENT + rest
    return textwrap.wrap(
        text, COLUMNS, initial_indent=before, subsequent_indent=after, break_on_hyphens=False
    )
