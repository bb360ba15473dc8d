"""Report of a fit as plain text: the verdict first, then the numbers behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pellicle.fitting.curves import BIREFRINGENCE, BrdfCurve, ColourCurve, Curve
from pellicle.fitting.lack_of_fit import lack_of_fit
from pellicle.fitting.result import Status
from pellicle.fitting.status import RIVAL
from pellicle.reporting import parameter_text
from pellicle.reporting.parameter_text import LEAST_CORRELATION
from pellicle.reporting.plain_text import COLUMNS, INDENT, block, facts, wrapped
from pellicle.reporting.quantities import colours_in_words, differences, weighted_delta

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit, Part
    from pellicle.sampling.result import Posterior

ADVICE = {
    Status.FAILED: "There is no result: the error says what to change.",
    Status.NOT_CONVERGED: "Do not use the numbers: narrow the bounds or free fewer parameters.",
    Status.MISFIT: "Do not use the numbers: look at the residuals for what the scene lacks.",
    Status.NOT_IDENTIFIABLE: "Use the limits, not the value; fix what is known or measure a wider range.",
    Status.AMBIGUOUS: "Choose among the rivals by what else is known, or measure a wider range.",
    Status.AT_BOUND: "Widen that bound, or give it the value that is known.",
    Status.CONVERGED: "Use the numbers within their errors.",
}
"""The next step, for every status."""

_SIGMA = {
    "given": "sigma {}, as given",
    "residuals": "sigma {}, estimated from the residuals: none was given",
    "model": "sigma {}, the error allowed for a drifting lamp: none was given",
    "usual": "sigma {}, the usual one of such colours: none was given",
}
"""The noise and its source, by a part's `sigma_from`."""

_RESIDUALS = {
    "linear": "ρ",
    "cosine": "ρ cos θ_i",
    "log": "log(1 + ρ cos θ_i)",
    "cube-root": "the cube root of ρ",
}
"""The quantity whose residuals a BRDF fit minimises."""


def report(fit: Fit, posterior: Posterior | None = None) -> str:
    """Format a fit, and its posterior if there is one, as text of at most 100 columns."""
    blocks = [
        ("Verdict", _verdict(fit)),
        ("With and without a layer", facts(layer_test_rows(fit))),
        ("Fit statistics", facts(statistic_rows(fit))),
        ("Parameters", parameter_text.parameters(fit)),
        ("Birefringence: extraordinary less ordinary index", facts(_birefringence(fit))),
        ("Uncertainty budget", parameter_text.budget(fit)),
        (f"Correlations above {LEAST_CORRELATION:g}", parameter_text.correlations(fit)),
        (
            f"Rivals: other minima and how much worse they fit (Δχ² below {RIVAL:g}: about as well)",
            parameter_text.rivals(fit),
        ),
        ("Plan: what was simulated", [line for part in fit.parts for line in _plan(part)]),
        ("Warnings", [line for text in fit.warnings for line in wrapped(text, "- ", "  ")]),
    ]
    text = "".join(block(title, lines) for title, lines in blocks if lines)
    if posterior is None:
        return text
    from pellicle.reporting.posterior import posterior_report

    return text + posterior_report(posterior)


def _birefringence(fit: Fit) -> list[tuple[str, str]]:
    """Rows of the birefringence at both ends and in the middle of the spectrum, where it was fitted."""
    indices = None if fit.layer_test else fit.principal_indices.get(BIREFRINGENCE)
    if indices is None or not np.any(indices.n_stderr > 0):
        return []
    if np.ptp(indices.n) < 1e-9:
        return [("all wavelengths", f"{indices.n[0]:.5f} ± {indices.n_stderr[0]:.2g}")]
    some = np.unique([0, indices.wavelength.size // 2, indices.wavelength.size - 1])
    return [
        (f"{indices.wavelength[i]:g} nm", f"{indices.n[i]:.5f} ± {indices.n_stderr[i]:.2g}") for i in some
    ]


def _verdict(fit: Fit) -> list[str]:
    rows = [("status", f"{fit.status}. {ADVICE[fit.status]}")]
    for part in fit.parts:
        path = getattr(part.data, "source", part.data.path)
        room = COLUMNS - 2 * len(INDENT) - len("status")
        short = path if len(path) <= room else "…" + path[1 - room :]
        rows += [("file", short)] if path else []
        rows.append((part.name or "data", data_in_words(part)))
    if fit.layer_test:
        rows.append(("model", fit.surface.model))
    return [*wrapped(fit.verdict), *facts(rows)]


def _spectrum(part: Part) -> str:
    """`R, 41 points from 400 to 800 nm`."""
    data, nm = part.spectrum, part.spectral.wavelength
    light = "" if data.polarisation == "unpolarised" else f" of {data.polarisation}-polarised light"
    names = data.kind.parts
    own = f" ({', '.join(names)})" if names else ""
    text = f"{data.signal}{own}{light}, {nm.size} points"
    if nm.size:
        text += _range(nm, "nm")
        if data.angle is not None and np.any(data.angle):
            text += "," + _range(data.angle, "degrees")
        if data.azimuth is not None:
            text += f", azimuth{_range(data.azimuth, 'degrees')}"
    return text + _independent(part, nm.size, "")


def data_in_words(part: Part) -> str:
    """Kind, number and range of the data of a part."""
    match part.curve:
        case Curve():
            return _spectrum(part)
        case ColourCurve():
            return colours_in_words(part)
        case _:
            return _samples(part)


def _samples(part: Part) -> str:
    """`200 samples of R, G, B`."""
    samples = part.samples
    size = samples.values.size
    return f"{len(samples)} samples of {', '.join(samples.channels)}" + _independent(
        part, size, f", {size} values"
    )


def _independent(part: Part, size: int, values: str) -> str:
    """The number of independent points, where it is clearly below that of the points."""
    worth = part.effective_points
    return f"{values}, worth {worth:.3g} independent ones" if worth < 0.95 * size else ""


def _range(values: np.ndarray, unit: str) -> str:
    lo, hi = values.min(), values.max()
    return f" from {lo:g} to {hi:g} {unit}" if lo < hi else f" at {lo:g} {unit}"


def layer_test_rows(fit: Fit) -> list[tuple[str, str]]:
    """Errors on held-out BRDF samples: of the surface, and of models without a layer."""
    test = fit.layer_test
    if test is None:
        return []
    errors = [(b.name, f"{b.held_out:.4g}") for b in test.baselines]
    head = ("held-out error", "of a fit to four fifths of the samples")
    return [head, ("this surface", f"{test.held_out:.4g}"), *errors]


def statistic_rows(fit: Fit) -> list[tuple[str, str]]:
    """Labels and texts of residuals, noise, reduced χ² and time."""
    rows = []
    if fit.layer_test:
        over = "" if fit.parts[0].data.sigma is None else " over sigma"
        rows.append(("compared", _RESIDUALS[fit.layer_test.residual] + over))
    for part in fit.parts:
        rows += [*_residuals(part), *_sweeps(part, len(fit.free))]
    chi2 = ("reduced chi-square", f"{fit.chi2_reduced:.4g}")
    return [*rows, chi2, ("seconds", f"{fit.seconds:.2f}")]


def _residuals(part: Part) -> list[tuple[str, str]]:
    """Rms and noise of one part; in a joint fit also its reduced χ², as each has its own noise."""
    curve = part.curve
    unit = " degrees" if isinstance(curve, Curve) and curve.delta_data is not None else ""
    if isinstance(curve, BrdfCurve) and part.sigma_from == "given":
        sigma = f"{part.sigma:.2g} 1/sr in the median"
    else:
        sigma = f"{part.sigma:.2g}{unit}"
    rms, noise = f"{part.rms:.4g}{unit}", _SIGMA[part.sigma_from].format(sigma)
    of = f" of {part.name}" if part.name else ""
    if part.name:
        rms += f", reduced chi-square {part.chi2_reduced:.4g}"
    rows = [(f"rms residual{of}", rms), (f"noise{of}", noise)]
    if isinstance(curve, ColourCurve) and (apart := differences(part)):
        rows.append((f"colour difference{of}", apart))
    if isinstance(curve, Curve) and part.spectrum.kind.degrees and (ratios := part.spectrum.kind.parts):
        square = curve.residual**2 + weighted_delta(curve) ** 2
        each = ", ".join(f"{size:.4g}" for size in np.sqrt(np.mean(square, axis=0) / 2))
        rows.append((f"of {', '.join(ratios)}", f"{each} degrees of psi"))
    elif isinstance(curve, Curve) and curve.delta_data is not None:
        psi, delta = (np.sqrt(np.mean(r**2)) for r in (curve.residual, curve.delta_residual))
        rows.append(("of psi and of delta", f"{psi:.4g} and {delta:.4g} degrees"))
    if isinstance(curve, Curve) and curve.depolarisation_data is not None:
        share = np.sqrt(np.mean(curve.depolarisation_residual**2))
        rows.append(("of depolarisation", f"{share:.4g}"))
    return rows


def _sweeps(part: Part, free: int) -> list[tuple[str, str]]:
    """Scatter of the repeated sweeps of one part, and what it makes of the residuals."""
    lack = lack_of_fit(part, free)
    if lack is None:
        return []
    unit = " degrees" if part.spectrum.delta is not None else ""
    scatter = f"{lack.sweeps}, of which a point scatters by {lack.repeatability:.2g}{unit}"
    of = f" of {part.name}" if part.name else ""
    return [(f"sweeps{of}", f"{scatter}; {lack.verdict} (probability {lack.probability:.2g})")]


def _plan(part: Part) -> list[str]:
    """Every effect, on or off, and why; under the name of the spectrum in a joint fit."""
    width = max(len(row.effect) for row in part.plan.rows)
    rows = facts((f"{row.effect:<{width}} {'on' if row.on else 'off':<3}", row.why) for row in part.plan.rows)
    return [*(wrapped(f"{part.name}:") if part.name else []), *rows]
