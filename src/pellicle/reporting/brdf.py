"""The report of a BRDF fit as plain text: the verdict first, then the numbers it rests on."""

from __future__ import annotations

from typing import cast

from pellicle.fitting.result import Fit, LayerTest
from pellicle.reporting import fit_text
from pellicle.reporting.plain_text import block, facts, wrapped

_COMPARED = {
    "linear": "ρ",
    "cosine": "ρ cos θ_i",
    "log": "log(1 + ρ cos θ_i)",
    "cube-root": "the cube root of ρ",
}
_SIGMA = {
    "given": "sigma {:.2g} 1/sr in the median, as given",
    "residuals": "sigma {:.2g}, estimated from the residuals: none was given",
}


def brdf_report(fit: Fit) -> str:
    """Everything a fit found, as text of at most 100 columns without colour codes."""
    samples, test = fit.samples, cast(LayerTest, fit.layer_test)
    status = f"{fit.status}. {fit_text.ADVICE[fit.status]}"
    data = f"{len(samples)} samples of {', '.join(samples.channels)}"
    if fit.effective_points < 0.95 * samples.values.size:
        data += f", {samples.values.size} values, worth {fit.effective_points:.3g} independent ones"
    seen = [("status", status), ("file", samples.path), ("data", data), ("model", fit.surface.model)]
    statistics = [
        (
            "compared",
            _COMPARED[test.residual] + (" over sigma" if samples.sigma is not None else ""),
        ),
        ("rms residual", f"{fit.rms:.4g}"),
        ("noise", _SIGMA[fit.parts[0].sigma_from].format(fit.parts[0].sigma)),
        ("reduced chi-square", f"{fit.chi2_reduced:.4g}"),
        ("seconds", f"{fit.seconds:.1f}"),
    ]
    errors = [
        ("held-out error", "of a fit to four fifths of the samples"),
        ("this surface", f"{test.held_out:.4g}"),
        *((b.name, f"{b.held_out:.4g}") for b in test.baselines),
    ]
    blocks = [
        ("Verdict", [*wrapped(fit.verdict), *facts(row for row in seen if row[1])]),
        ("With and without a layer", facts(errors)),
        ("Fit statistics", facts(statistics)),
        ("Parameters", fit_text.parameters(fit)),
        (fit_text.CORRELATIONS, fit_text.correlations(fit)),
        (fit_text.RIVALS, fit_text.rivals(fit)),
        (fit_text.PLAN, fit_text.plan(fit.plan)),
        (fit_text.WARNINGS, fit_text.warnings(fit)),
    ]
    return "".join(block(title, lines) for title, lines in blocks if lines)
