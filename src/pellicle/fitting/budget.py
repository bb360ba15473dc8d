"""Uncertainty budget of a fit: the systematic effects that its errors include."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import SystematicEffect

_STRUCTURE = 0.3
"""Share of the residuals' sum of squares that a named cause explains at least; noise is the rest."""
_USUAL = 3.0
"""Standard uncertainties up to which an effect is of ordinary size."""


def budget(discrepancy: Discrepancy, parameters: Sequence[Parameter]) -> tuple[SystematicEffect, ...]:
    """Rows of the budget, those first that change the leading parameter most."""
    lead = next((i for i, p in enumerate(parameters) if p.key == "thickness"), 0)
    names = [p.name for p in parameters]

    def named(values: np.ndarray) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=False))

    rows = sorted(discrepancy.contributions, key=lambda c: -abs(c.changes[lead]))
    return tuple(
        SystematicEffect(
            name=row.effect.name,
            uncertainty=row.effect.size,
            unit=row.effect.unit,
            changes=named(row.changes),
            amount=row.amount,
            explains=row.explains,
            alone=row.alone,
            shifts=named(row.shift),
        )
        for row in rows
    )


def likely_cause(rows: Sequence[SystematicEffect], lead: str, unit: str) -> str:
    """A sentence on the effect of ordinary size that alone explains most of the residuals, empty without one.

    `lead` is the parameter whose change is told, in `unit`.
    """
    usual = [r for r in rows if abs(r.alone) <= _USUAL * r.uncertainty and r.explains > _STRUCTURE]
    if not usual or lead not in usual[0].shifts:
        return ""
    best = max(usual, key=lambda row: row.explains)
    size = f"{best.alone:.2g} {best.unit}" if best.unit else f"{100 * best.alone:.2g} %"
    return (
        f"{best.name} of {size} would explain {100 * best.explains:.0f} % of the residuals and change {lead}"
        f" by {best.shifts[lead]:+.2g}{f' {unit}' if unit else ''}: describe it in the scene if it is real"
    )
