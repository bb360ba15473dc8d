"""Parameters, correlations, rivals and uncertainty budget of a fit as lines of text."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from pellicle.fitting.result import LEVEL
from pellicle.fitting.status import describe
from pellicle.reporting.plain_text import INDENT, table, wrapped

if TYPE_CHECKING:
    from pellicle.fitting.result import Estimate, Fit, Rival, SystematicEffect

LEAST_CORRELATION = 0.5
MOST_CORRELATIONS = 10
MOST_RIVALS = 6
_IMPOSSIBLE = 1e-6
"""Share of a posterior below which nothing more is said of it."""

NUISANCE = re.compile(r"instrument\.((scale|offset)(_\d+)?|white_balance_.+|camera_\d+)(\..+)?")


def parameters(fit: Fit) -> list[str]:
    """One line for each, the free ones first: name, value ± error or limit, unit and bounds."""
    width = max((len(name) for name in fit.parameters), default=0) + 1
    rows = [
        (
            f"{p.name + ':':<{width}}",
            value_in_words(p) if p.free else f"{p.value:.6g}{_unit(p)} (fixed)",
            bounds_in_words(p),
        )
        for p in sorted(fit.parameters.values(), key=lambda p: not p.free)
    ]
    middle = max((len(value) for _, value, bounds in rows if bounds), default=0)
    return [f"{INDENT}{name}  {value:<{middle}}  {bounds}".rstrip() for name, value, bounds in rows]


def value_in_words(p: Estimate) -> str:
    """`751.66 ± 0.12 nm (0.016 %)`, with its standard error, or the best value and its limits where that is
    infinite."""
    sides = (("at least", p.lower_limit), ("at most", p.upper_limit))
    limits = [f"{side} {limit:.4g}{_unit(p)} at 95 %" for side, limit in sides if limit is not None]
    if not math.isfinite(p.stderr):
        return f"not determined ({', '.join([f'best {p.value:.6g}{_unit(p)}', *limits])})"
    relative = 100 * p.stderr / abs(p.value) if p.value else math.inf
    notes = ", ".join([f"{relative:.2g} %", *limits] if relative < 100 else limits)
    value = describe(p).removeprefix(f"{p.name} ")
    return f"{value} ({notes})" if notes else value


def _unit(p: Estimate) -> str:
    return f" {p.unit}" if p.unit else ""


def bounds_in_words(p: Estimate) -> str:
    """`[10, 3000]`, and the bound on which the value rests."""
    if not p.free or not (math.isfinite(p.lower) and math.isfinite(p.upper)):
        return ""
    bounds = f"[{p.lower:g}, {p.upper:g}]"
    if not p.at_bound:
        return bounds
    side = "lower" if p.value - p.lower <= p.upper - p.value else "upper"
    return (
        f"{bounds}  at its default {side} bound"
        if p.default_bounds
        else f"{bounds}  AT ITS {side.upper()} BOUND"
    )


def correlations(fit: Fit) -> list[str]:
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


def rivals(fit: Fit) -> list[str]:
    """Other minima, the least Δχ² first, each with its parameters in the order of the fit's."""
    shown = sorted(fit.rivals, key=lambda rival: rival.delta_chi2)[:MOST_RIVALS]
    rows = [
        (
            f"Δχ² {rival.delta_chi2:.3g}",
            *([] if rival.probability is None else [_probability(rival.probability)]),
            *(
                f"{name} {rival.parameters[name]:.5g}{_error(rival, name)}{_unit(p)}"
                for name, p in fit.parameters.items()
                if name in rival.parameters
            ),
        )
        for rival in shown
    ]
    return table(rows) + _omitted(len(fit.rivals) - len(shown))


def _probability(share: float) -> str:
    return f"probability {share:.2g}" if share > _IMPOSSIBLE else f"probability < {_IMPOSSIBLE:g}"


def _error(rival: Rival, name: str) -> str:
    return "" if rival.stderr is None else f" ± {rival.stderr[name]:.2g}"


def _omitted(count: int) -> list[str]:
    return [f"{INDENT}... and {count} more in the JSON"] if count > 0 else []


_SHOWN = 8
_SMALL = 0.01
"""Share of the standard error below which an effect is not listed."""


def budget(fit: Fit) -> list[str]:
    """Budget of the leading parameter: what each systematic effect, at its standard uncertainty, changes."""
    lead, lines = next(iter(fit.free), None), rows(fit)
    if lead is None or not lines:
        return []
    smaller = len(fit.budget) + 1 - len(lines)
    return [
        *wrapped(f"{lead.name}: standard uncertainties, and what each alone would change"),
        *table(lines),
        *([f"{INDENT}... and {smaller} smaller in the JSON"] if smaller else []),
        *wrapped(together(lead)),
    ]


def rows(fit: Fit) -> list[tuple[str, str, str]]:
    """Name, standard uncertainty and change of the leading parameter, of noise and of each larger effect.

    Empty where the leading parameter has no finite error.
    """
    lead = next(iter(fit.free), None)
    if lead is None or not fit.budget or not math.isfinite(lead.stderr):
        return []
    unit = f" {lead.unit}" if lead.unit else ""
    larger = [row for row in fit.budget if abs(row.changes[lead.name]) > _SMALL * lead.stderr]
    return [
        ("noise and residuals (type A)", "", f"{lead.stderr_noise:.2g}{unit}"),
        *((row.name, _size(row), f"{abs(row.changes[lead.name]):.2g}{unit}") for row in larger[:_SHOWN]),
    ]


def _size(row: SystematicEffect) -> str:
    return f"{row.uncertainty:.3g} {row.unit}" if row.unit else f"{100 * row.uncertainty:.3g} %"


def together(lead: Estimate) -> str:
    """The combined and the expanded uncertainty of the leading parameter."""
    unit = f" {lead.unit}" if lead.unit else ""
    freedom = lead.effective_degrees_of_freedom
    of = f", {freedom:.3g} degrees of freedom" if freedom < 100 else ""
    return (
        f"together, less what the residuals exclude: {lead.stderr:.2g}{unit}; expanded, {100 * LEVEL:.0f} %:"
        f" {lead.expanded:.2g}{unit} (coverage factor {lead.coverage_factor:.3g}{of})"
    )
