"""The report of a fit as plain text: the verdict first, then the numbers it rests on."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from pellicle.fitting.result import Estimate, Fit, Part, Rival, Status
from pellicle.fitting.status import RIVAL, describe
from pellicle.reporting.plain_text import COLUMNS, INDENT, block, facts, table, wrapped

if TYPE_CHECKING:
    from pellicle.effects.plan import Plan
    from pellicle.fitting.result import Fit

LEAST_CORRELATION = 0.5
MOST_CORRELATIONS = 10
MOST_RIVALS = 6
SUMMARY_PARAMETERS = 3

ADVICE = {
    Status.FAILED: "There is no result: the error says what to change.",
    Status.NOT_CONVERGED: "Do not use the numbers: narrow the bounds or free fewer parameters.",
    Status.MISFIT: "Do not use the numbers: look at the residuals for what the scene lacks.",
    Status.NOT_IDENTIFIABLE: "Use the limits, not the value; fix what is known or measure a wider range.",
    Status.AMBIGUOUS: "Choose among the rivals by what else is known, or measure a wider range.",
    Status.AT_BOUND: "Widen that bound, or give it the value that is known.",
    Status.CONVERGED: "Use the numbers within their errors.",
}
"""What to do next, for every status."""

CORRELATIONS = f"Correlations above {LEAST_CORRELATION:g}"
RIVALS = f"Rivals: other minima and how much worse they fit (Δχ² below {RIVAL:g}: about as well)"
PLAN, WARNINGS = "Plan: what was simulated", "Warnings"

_SIGMA = {
    "given": "sigma {}, as given",
    "residuals": "sigma {}, estimated from the residuals: none was given",
    "model": "sigma {}, the error that a drifting lamp is allowed: none was given",
}
"""Where the noise comes from that errors rest on."""

_NUISANCE = re.compile(r"instrument\.(scale|offset)(_\d+)?(\..+)?")


def report(fit: Fit) -> str:
    """Everything a fit found, as text of at most 100 columns without colour codes."""
    blocks = [
        ("Verdict", _verdict(fit)),
        ("Fit statistics", _statistics(fit)),
        ("Parameters", parameters(fit)),
        (CORRELATIONS, correlations(fit)),
        (RIVALS, rivals(fit)),
        (PLAN, [line for part in fit.parts for line in plan(part.plan, part.name)]),
        (WARNINGS, warnings(fit)),
    ]
    return "".join(block(title, lines) for title, lines in blocks if lines)


def summary_line(fit: Fit) -> str:
    """One line for one of several files: name, status, the leading parameters and the rms."""
    leading = [p for p in fit.free if not _NUISANCE.fullmatch(p.name)] or list(fit.free)
    told = [_value(p, named=True) for p in leading[:SUMMARY_PARAMETERS]]
    more = ["..."] if len(leading) > SUMMARY_PARAMETERS else []
    names = (part.spectrum.path.replace("\\", "/").rsplit("/", 1)[-1] or "spectrum" for part in fit.parts)
    rms = [] if fit.rms is None else [f"rms {fit.rms:.3g}{_degrees(fit.parts[0])}"]
    return f"{' and '.join(names)}: {fit.status}, {', '.join([*told, *more, *rms])}"


def _verdict(fit: Fit) -> list[str]:
    status = f"{fit.status}. {ADVICE[fit.status]}"
    files = [row for part in fit.parts for row in _file(part)]
    return [*wrapped(fit.verdict), *facts([("status", status), *files])]


def _file(part: Part) -> list[tuple[str, str]]:
    """What was measured, and where it lies."""
    data, nm = part.spectrum, part.spectral.wavelength
    points = f"{data.signal}, {nm.size} points"
    if nm.size:
        points += _span(nm, "nm")
    if data.signal == "psi-delta" and data.angle is not None and nm.size:
        points += "," + _span(data.angle, "degrees")
    if part.effective_points < 0.95 * nm.size:
        points += f", worth {part.effective_points:.3g} independent ones"
    file = [("file", _shortened(data.path))] if data.path else []
    return [*file, (part.name or "data", points)]


def _span(values: np.ndarray, unit: str) -> str:
    lo, hi = values.min(), values.max()
    return f" from {lo:g} to {hi:g} {unit}" if lo < hi else f" at {lo:g} {unit}"


def _degrees(part: Part) -> str:
    """The unit of what is measured, where it has one."""
    return " degrees" if part.spectrum.signal == "psi-delta" else ""


def _shortened(path: str) -> str:
    """The end of a long path, with an ellipsis for what is left out."""
    room = COLUMNS - 2 * len(INDENT) - len("status")
    return path if len(path) <= room else "…" + path[1 - room :]


def _statistics(fit: Fit) -> list[str]:
    return facts(
        [
            *(row for part in fit.parts for row in _rms(part)),
            ("reduced chi-square", f"{fit.chi2_reduced:.4g}"),
            ("seconds", f"{fit.seconds:.2f}"),
        ]
    )


def _rms(part: Part) -> list[tuple[str, str]]:
    """How far the model is from one spectrum; of several also the reduced χ², as each has its noise."""
    rows = [("rms residual", f"{part.rms:.4g}{_degrees(part)}")]
    rows.append(("noise", _SIGMA[part.sigma_from].format(f"{part.sigma:.2g}{_degrees(part)}")))
    if part.name:
        chi2 = f"reduced chi-square {part.chi2_reduced:.4g}"
        (label, rms), (noise, sigma) = rows
        rows = [(f"{label} of {part.name}", f"{rms}, {chi2}"), (f"{noise} of {part.name}", sigma)]
    if part.spectral.delta_data is not None:
        psi, delta = (np.sqrt(np.mean(r**2)) for r in (part.spectral.residual, part.spectral.delta_residual))
        rows.append(("of psi and of delta", f"{psi:.4g} and {delta:.4g} degrees"))
    return rows


def parameters(fit: Fit) -> list[str]:
    """A line for each, in columns: name, value ± error or limit, unit and bounds."""
    width = max((len(name) for name in fit.parameters), default=0) + 1
    rows = [(f"{p.name + ':':<{width}}", _value(p) if p.free else _fixed(p), _bounds(p)) for p in _all(fit)]
    middle = max((len(value) for _, value, bounds in rows if bounds), default=0)
    return [f"{INDENT}{name}  {value:<{middle}}  {bounds}".rstrip() for name, value, bounds in rows]


def _all(fit: Fit) -> list[Estimate]:
    """Free parameters before fixed ones, each in the fit's own order."""
    return sorted(fit.parameters.values(), key=lambda p: not p.free)


def _unit(p: Estimate) -> str:
    return f" {p.unit}" if p.unit else ""


def _fixed(p: Estimate) -> str:
    return f"{p.value:.6g}{_unit(p)} (fixed)"


def _value(p: Estimate, named: bool = False) -> str:
    """`751.66 ± 0.12 nm (0.016 %)`, or what is known where there is no error; `named` is shorter."""
    name = f"{p.name} " if named else ""
    if not math.isfinite(p.stderr):
        limits = "".join(f", {limit}" for limit in _limits(p))
        return f"{name}not determined (best {p.value:.6g}{_unit(p)}{limits})"
    text = describe(p).removeprefix("" if named else f"{p.name} ")
    if named:
        return text
    relative = 100 * p.stderr / abs(p.value) if p.value else math.inf
    share = [f"{relative:.2g} %"] if relative < 100 else []
    notes = ", ".join([*share, *_limits(p)])
    return f"{text} ({notes})" if notes else text


def _limits(p: Estimate) -> list[str]:
    sides = (("at least", p.lower_limit), ("at most", p.upper_limit))
    return [f"{side} {limit:.4g}{_unit(p)} at 95 %" for side, limit in sides if limit is not None]


def _bounds(p: Estimate) -> str:
    if not p.free or not (math.isfinite(p.lower) and math.isfinite(p.upper)):
        return ""
    side = "lower" if p.value - p.lower <= p.upper - p.value else "upper"
    return f"[{p.lower:g}, {p.upper:g}]" + (f"  AT ITS {side.upper()} BOUND" if p.at_bound else "")


def correlations(fit: Fit) -> list[str]:
    """The largest ones.

    The coefficients of the scale's and the offset's polynomials are left out among themselves: they
    follow from the basis that was chosen, and say nothing of the layer. the JSON has them all.
    """
    names, matrix = fit.correlation_names, fit.correlation
    pairs = [
        (float(matrix[i, j]), names[i], names[j])
        for j in range(len(names))
        for i in range(j)
        if abs(matrix[i, j]) > LEAST_CORRELATION
        and not (_NUISANCE.fullmatch(names[i]) and _NUISANCE.fullmatch(names[j]))
    ]
    pairs.sort(key=lambda pair: -abs(pair[0]))
    shown = pairs[:MOST_CORRELATIONS]
    lines = table([(f"C({one}, {other})", f"{value:+.3f}") for value, one, other in shown])
    return lines + _left_out(len(pairs) - len(shown))


def rivals(fit: Fit) -> list[str]:
    """Other minima, the nearest first."""
    shown = sorted(fit.rivals, key=lambda rival: rival.delta_chi2)[:MOST_RIVALS]
    rows = [(f"Δχ² {rival.delta_chi2:.3g}", *_of_rival(fit, rival)) for rival in shown]
    return table(rows) + _left_out(len(fit.rivals) - len(shown))


def _of_rival(fit: Fit, rival: Rival) -> list[str]:
    """The rival's parameters, the thickness first as in the table of parameters."""
    names = [name for name in fit.parameters if name in rival.parameters]
    return [f"{name} {rival.parameters[name]:.5g}{_unit(fit.parameters[name])}" for name in names]


def _left_out(count: int) -> list[str]:
    return [f"{INDENT}... and {count} more in the JSON"] if count > 0 else []


def plan(made: Plan, name: str = "") -> list[str]:
    """Every effect, on or off, and why; under the name of the spectrum where it is one of several."""
    rows = facts((f"{row.effect:<13} {'on' if row.on else 'off':<3}", row.why) for row in made.rows)
    return [*(wrapped(f"{name}:") if name else []), *rows]


def warnings(fit: Fit) -> list[str]:
    """Each as an item of a list, wrapped."""
    return [line for warning in fit.warnings for line in wrapped(warning, "- ", "  ")]
