"""Report of a fit as plain text: the verdict first, then the numbers behind it."""

import math
import re

import numpy as np

from pellicle.fitting.budget import carrier
from pellicle.fitting.curves import BIREFRINGENCE, BrdfCurve, ColourCurve, Curve
from pellicle.fitting.lack_of_fit import lack_of_fit
from pellicle.fitting.result import LEVEL, Estimate, Fit, Part, Status
from pellicle.fitting.status import RIVAL, describe
from pellicle.reporting.plain_text import COLUMNS, INDENT, blocks_of, facts, table, with_unit, wrapped
from pellicle.reporting.quantities import colours_in_words, differences, weighted_delta
from pellicle.sampling.result import Posterior
from pellicle.scene.film import Scene

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

OTHER_MINIMA = f"other minima and how much worse they fit (Δχ² below {RIVAL:g}: about as well)"

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
    plan = []
    for part in fit.parts:
        width = max(len(row.effect) for row in part.plan.rows)
        rows = [(f"{row.effect:<{width}} {'on' if row.on else 'off':<3}", row.why) for row in part.plan.rows]
        plan += [*(wrapped(f"{part.name}:") if part.name else []), *facts(rows)]
    blocks = [
        ("Verdict", _verdict(fit)),
        ("With and without a layer", facts(layer_test_rows(fit))),
        ("Fit statistics", facts(statistic_rows(fit))),
        ("Parameters", _parameters(fit)),
        ("n and k of the layer", facts([] if fit.index_in_short is None else fit.index_in_short.rows)),
        ("Birefringence: extraordinary less ordinary index", facts(_birefringence(fit))),
        ("Uncertainty budget", budget(fit)),
        (f"Correlations above {LEAST_CORRELATION:g}", _correlations(fit)),
        (f"Rivals: {OTHER_MINIMA}", _rivals(fit)),
        ("Plan: what was simulated", plan),
        ("Warnings", [line for text in fit.warnings for line in wrapped(text, "- ", "  ")]),
    ]
    text = blocks_of(blocks)
    if posterior is None:
        return text
    from pellicle.reporting.posterior import posterior_report

    return text + posterior_report(posterior)


def _birefringence(fit: Fit) -> list[tuple[str, str]]:
    """Rows of the birefringence at both ends and in the middle of the spectrum, where it was fitted."""
    indices = None if fit.layer_test else fit.principal_indices.get(BIREFRINGENCE)
    if indices is None or not np.any(indices.n_stderr > 0):
        return []
    same, last = np.ptp(indices.n) < 1e-9, indices.wavelength.size - 1
    names = ["all wavelengths"] if same else [f"{nm:g} nm" for nm in indices.wavelength]
    some = [0] if same else np.unique([0, (last + 1) // 2, last])
    return [(names[i], f"{indices.n[i]:.5f} ± {indices.n_stderr[i]:.2g}") for i in some]


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


def data_in_words(part: Part) -> str:
    """Kind, number and range of the data of a part: `R, 41 points from 400 to 800 nm`, or
    `200 samples of R, G, B`, and the number of independent points where it is clearly below that."""
    if isinstance(part.curve, ColourCurve):
        return colours_in_words(part)
    if isinstance(part.curve, Curve):
        data, nm = part.spectrum, part.spectral.wavelength
        light = "" if data.polarisation == "unpolarised" else f" of {data.polarisation}-polarised light"
        names = f" ({', '.join(data.kind.parts)})" if data.kind.parts else ""
        size, values = nm.size, ""
        text = f"{data.signal}{names}{light}, {size} points"
        if size:
            text += _range(nm, "nm")
            if data.angle is not None and np.any(data.angle):
                text += "," + _range(data.angle, "degrees")
            if data.azimuth is not None:
                text += f", azimuth{_range(data.azimuth, 'degrees')}"
    else:
        size = part.samples.values.size
        text, values = (
            f"{len(part.samples)} samples of {', '.join(part.samples.channels)}",
            f", {size} values",
        )
    worth = part.effective_points
    return text + (f"{values}, worth {worth:.3g} independent ones" if worth < 0.95 * size else "")


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
        rows += _residuals(part)
        lack = lack_of_fit(part, len(fit.free))
        if lack is not None:  # the scatter of repeated sweeps, and what it makes of the residuals
            unit = " degrees" if part.spectrum.delta is not None else ""
            scatter = f"{lack.sweeps}, of which a point scatters by {lack.repeatability:.2g}{unit}"
            of = f" of {part.name}" if part.name else ""
            text = f"{scatter}; {lack.verdict} (probability {lack.probability:.2g})"
            rows.append((f"sweeps{of}", text))
    chi2 = ("reduced chi-square", f"{fit.chi2_reduced:.4g}")
    return [*rows, chi2, ("seconds", f"{fit.seconds:.2f}")]


def _residuals(part: Part) -> list[tuple[str, str]]:
    """Rms and noise of one part; in a joint fit also its reduced χ², as each has its own noise."""
    curve = part.curve
    unit = " degrees" if isinstance(curve, Curve) and curve.delta_data is not None else ""
    of_brdf = isinstance(curve, BrdfCurve) and part.sigma_from == "given"
    sigma = f"{part.sigma:.2g}" + (" 1/sr in the median" if of_brdf else unit)
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


LEAST_CORRELATION = 0.5
MOST_CORRELATIONS = 10
MOST_RIVALS = 6
_IMPOSSIBLE = 1e-6
"""Share of a posterior below which nothing more is said of it."""

NUISANCE = re.compile(r"instrument\.((scale|offset)(_\d+)?|white_balance_.+|camera_\d+)(\..+)?")


def by_sample(fit: Fit) -> dict[str, list[Estimate]]:
    """Parameters below the heading of their sample, in its order, then those that samples share; the free
    ones first. One heading, an empty one, where the fit is not of several samples."""
    every = sorted(fit.parameters.values(), key=lambda p: (not p.free, not p.tied))
    scenes = fit.scene if isinstance(fit.scene, tuple) else ()
    pairs = [
        (part.name, x.sample) for part, x in zip(fit.parts, scenes, strict=False) if isinstance(x, Scene)
    ]
    of_part = {name: sample.name for name, sample in pairs if sample is not None}
    if not of_part:
        return {"": every}
    heads = {name: f"sample {name}" for name in of_part.values()}
    rows: dict[str, list[Estimate]] = {head: [] for head in [*heads.values(), "shared"]}
    for p in every:
        first, last = p.name.split(".")[0], p.name.split(".")[-1]
        rows[heads.get(first) or heads.get(of_part.get(last, ""), "shared")].append(p)
    return {head: own for head, own in rows.items() if own}


def _parameters(fit: Fit) -> list[str]:
    """One line for each: name, value ± error or limit, unit and bounds; those of a sample below its name."""
    width, lines = max((len(name) for name in fit.parameters), default=0) + 1, list[str]()
    words = {p.name: (value_in_words(p), bounds_in_words(p)) for p in fit.parameters.values()}
    middle = max((len(value) for value, bounds in words.values() if bounds), default=0)
    for head, own in by_sample(fit).items():
        lines += [f"{INDENT}{head}"] if head else []
        indent = INDENT + "  " * bool(head)
        for p in own:
            value, bounds = words[p.name]
            lines.append(f"{indent}{p.name + ':':<{width}}  {value:<{middle}}  {bounds}".rstrip())
    return lines


def value_in_words(p: Estimate) -> str:
    """`751.66 ± 0.12 nm (0.016 %)`, with its standard error, or the best value and its limits where that is
    infinite; a fixed value as such."""
    best = with_unit(f"{p.value:.6g}", p.unit)
    if not p.free and not p.tied:
        return f"{best} (fixed)"
    sides = {"at least": p.lower_limit, "at most": p.upper_limit}
    known = {side: limit for side, limit in sides.items() if limit is not None}
    limits = [f"{side} {with_unit(f'{limit:.4g}', p.unit)} at 95 %" for side, limit in known.items()]
    if not math.isfinite(p.stderr):
        return f"not determined ({', '.join([f'best {best}', *limits])})"
    relative = 100 * p.stderr / abs(p.value) if p.value else math.inf
    notes = ", ".join([f"{relative:.2g} %", *limits] if relative < 100 else limits)
    value = describe(p).removeprefix(f"{p.name} ")
    return f"{value} ({notes})" if notes else value


def bounds_in_words(p: Estimate) -> str:
    """`[10, 3000]`, and the bound on which the value rests; of a tied number its expression."""
    if p.tied:
        return f"= {p.tied}"
    if not p.free or not (math.isfinite(p.lower) and math.isfinite(p.upper)):
        return ""
    bounds = f"[{p.lower:g}, {p.upper:g}]"
    if not p.at_bound:
        return bounds
    side = "lower" if p.value - p.lower <= p.upper - p.value else "upper"
    where = f"at its default {side} bound" if p.default_bounds else f"AT ITS {side.upper()} BOUND"
    return f"{bounds}  {where}"


def _correlations(fit: Fit) -> list[str]:
    """Correlations above 0.5, the largest first.

    Pairs of coefficients of the scale's and the offset's polynomials are left out: they follow from the
    choice of the basis and say nothing of the layer. The JSON record has them.
    """
    names, matrix = fit.correlation_names, fit.correlation
    pairs = [
        (float(matrix[i, j]), names[i], names[j])
        for j in range(len(names))
        for i in range(j)
        if abs(matrix[i, j]) > LEAST_CORRELATION
        and not (NUISANCE.fullmatch(names[i]) and NUISANCE.fullmatch(names[j]))
    ]
    pairs.sort(key=lambda pair: -abs(pair[0]))
    shown = pairs[:MOST_CORRELATIONS]
    lines = table([(f"C({one}, {other})", f"{value:+.3f}") for value, one, other in shown])
    return lines + _omitted(len(pairs) - len(shown))


def _rivals(fit: Fit) -> list[str]:
    """Other minima, the least Δχ² first, each with its parameters in the order of the fit's."""
    shown = sorted(fit.rivals, key=lambda rival: rival.delta_chi2)[:MOST_RIVALS]
    rows = []
    for rival in shown:
        cells = [f"Δχ² {rival.delta_chi2:.3g}"]
        if (share := rival.probability) is not None:
            cells.append(f"probability {f'{share:.2g}' if share > _IMPOSSIBLE else f'< {_IMPOSSIBLE:g}'}")
        for name, p in fit.parameters.items():
            if name in rival.parameters:
                error = "" if rival.stderr is None else f" ± {rival.stderr[name]:.2g}"
                cells.append(with_unit(f"{name} {rival.parameters[name]:.5g}{error}", p.unit))
        rows.append(cells)
    return table(rows) + _omitted(len(fit.rivals) - len(shown))


def _omitted(count: int) -> list[str]:
    return [f"{INDENT}... and {count} more in the JSON"] if count > 0 else []


_SHOWN = 8
_SMALL = 0.01
"""Share of the standard error below which an effect is not listed."""


def budget(fit: Fit) -> list[str]:
    """Budget of the leading parameter: what each systematic effect, at its standard uncertainty, changes."""
    lead, lines = next(iter(fit.free), None), budget_rows(fit)
    if lead is None or not lines:
        return []
    smaller = len(fit.budget) + 1 - len(lines)
    return [
        *wrapped(f"{lead.name}: standard uncertainties, and what each alone would change"),
        *table(lines),
        *([f"{INDENT}... and {smaller} smaller in the JSON"] if smaller else []),
        *wrapped(together(fit, lead)),
    ]


def budget_rows(fit: Fit) -> list[tuple[str, str, str]]:
    """Name, standard uncertainty and change of the leading parameter, of noise and of each larger effect.

    Empty where the leading parameter has no finite error.
    """
    lead = next(iter(fit.free), None)
    if lead is None or not fit.budget or not math.isfinite(lead.stderr):
        return []
    larger = [row for row in fit.budget if abs(row.changes[lead.name]) > _SMALL * lead.stderr]
    rows = [("noise and residuals (type A)", "", with_unit(f"{lead.stderr_noise:.2g}", lead.unit))]
    for row in larger[:_SHOWN]:
        size = f"{row.uncertainty:.3g} {row.unit}" if row.unit else f"{100 * row.uncertainty:.3g} %"
        rows.append((row.name, size, with_unit(f"{abs(row.changes[lead.name]):.2g}", lead.unit)))
    return rows


def together(fit: Fit, lead: Estimate) -> str:
    """The combined and the expanded uncertainty of the leading parameter, and what carries it."""
    stderr, expanded = (with_unit(f"{error:.2g}", lead.unit) for error in (lead.stderr, lead.expanded))
    freedom = lead.effective_degrees_of_freedom
    of = f", {freedom:.3g} degrees of freedom" if freedom < 100 else ""
    most = carrier(fit.budget, lead) if fit.status is Status.CONVERGED else ""
    return (
        f"together, less what the residuals exclude: {stderr}; expanded, {100 * LEVEL:.0f} %:"
        f" {expanded} (coverage factor {lead.coverage_factor:.3g}{of}){f'. The {most}' if most else ''}"
    )
