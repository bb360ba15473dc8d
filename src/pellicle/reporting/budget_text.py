"""Uncertainty budget of a fit as lines of text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pellicle.fitting.result import LEVEL
from pellicle.reporting.plain_text import INDENT, table, wrapped

if TYPE_CHECKING:
    from pellicle.fitting.result import Estimate, Fit, SystematicEffect

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
