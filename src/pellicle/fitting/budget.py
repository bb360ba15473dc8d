"""Uncertainty budget of a fit: the systematic effects that its errors include."""

from collections.abc import Sequence

import numpy as np

from pellicle.fitting.discrepancy import Contribution, Discrepancy
from pellicle.fitting.misfit import other_material
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import SystematicEffect

_STRUCTURE = 0.3
"""Share of the residuals' sum of squares that a named cause explains at least; noise is the rest."""
_USUAL = 3.0
"""Standard uncertainties up to which an effect is of ordinary size."""

_EXPOSURE = 0.9
"""Share of the residuals' sum of squares that a wrong exposure or calibration explains at least."""


def budget(discrepancy: Discrepancy, parameters: Sequence[Parameter]) -> tuple[SystematicEffect, ...]:
    """Rows of the budget, those first that change the leading parameter most."""
    lead = _lead(parameters)
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
        )
        for row in rows
    )


def _lead(parameters: Sequence[Parameter]) -> int:
    """Position of the leading parameter: the first thickness, else the first of all."""
    return next((i for i, p in enumerate(parameters) if p.key == "thickness"), 0)


def likely_cause(discrepancy: Discrepancy, parameters: Sequence[Parameter]) -> list[str]:
    """A sentence on the effect of ordinary size that alone explains most of the residuals, or on the index of
    another material that does; none without either."""
    at = _lead(parameters)
    rows, lead = discrepancy.contributions, parameters[at]
    usual = [c for c in rows if abs(c.alone) <= _USUAL * c.effect.size and c.explains > _STRUCTURE]
    best = max(usual, key=lambda c: c.explains, default=None)
    position = other_material(rows)
    other = rows[position] if position >= 0 else None
    level = max(
        (c for c in rows if c.effect.name.startswith("scale")), key=lambda c: c.explains, default=None
    )
    if (
        level is not None
        and abs(level.alone) > _USUAL * level.effect.size
        and level.explains > max(_EXPOSURE, other.explains if other else 0.0, best.explains if best else 0.0)
    ):
        return [
            f"a {level.effect.name} that is {100 * abs(level.alone):.2g} % {_towards(level)} would explain"
            f" {100 * level.explains:.0f} % of the residuals: calibrate it against a white or a reference, or"
            ' free it by `scale="free"`'
        ]
    if other is not None:
        far = f"{100 * abs(other.alone):.2g} % {_towards(other)}"
        return [
            f"an {other.effect.name} that is {far} would explain {100 * other.explains:.0f} % of the"
            " residuals, and nothing of ordinary size does: check the material"
        ]
    if best is None:
        return []
    size = f"{best.alone:.2g} {best.effect.unit}" if best.effect.unit else f"{100 * best.alone:.2g} %"
    return [
        f"{best.effect.name} of {size} would explain {100 * best.explains:.0f} % of the residuals and change"
        f" {lead.name} by {best.shift[at]:+.2g}{f' {lead.unit}' if lead.unit else ''}: describe it in the"
        " scene if it is real"
    ]


def _towards(row: Contribution) -> str:
    return "higher" if row.alone > 0 else "lower"
