"""Uncertainty budget of a fit: the systematic effects that its errors include."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pellicle.fitting.discrepancy import Contribution, Discrepancy
from pellicle.fitting.misfit import other_material
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import Estimate, SystematicEffect

_STRUCTURE = 0.3
"""Share of the residuals' sum of squares that a named cause explains at least; noise is the rest."""
_USUAL = 3.0
"""Standard uncertainties up to which an effect is of ordinary size."""

_LARGEST = 30.0
"""Standard uncertainties up to which an effect is named at all: an angle of incidence that is 3° off."""
_CLEAR, _MORE = 0.6, 0.1
"""Share of the residuals' sum of squares that an effect of no ordinary size explains at least, and how much
more than any of ordinary size."""
_MOST = 0.5
"""Largest relative change that is named: what is further off has another cause, such as an angle."""
_EXPOSURE = 0.9
"""Share of the residuals' sum of squares that a wrong exposure or calibration explains at least."""
_CARRIES, _BEYOND_NOISE = 0.7, 2.0
"""Share of the variance that an effect carries which is said to carry the error, and how much larger than the
noise's that error is at least."""
_STATED = (
    *("angle_spread", "thickness_spread", "psi", "delta", "wavelength", "bandwidth", "angle", "scale"),
    *("offset", "depolarisation", "index", "dispersion", "roughness", "mueller"),
)
"""Numbers whose uncertainty a recipe states; the first whose words are in the name of an effect counts."""


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
            carries=named(np.broadcast_to(row.carries, row.changes.shape)),
        )
        for row in rows
    )


def carrier(effects: Sequence[SystematicEffect], lead: Estimate) -> str:
    """A sentence on the one effect that carries most of the error of a parameter, with what would shrink it;
    empty where none does, or the noise is no small part."""
    row = max(effects, key=lambda e: e.carries.get(lead.name, 0.0), default=None)
    variance = 0.0 if row is None else row.carries.get(lead.name, 0.0)
    if row is None or not lead.stderr > _BEYOND_NOISE * lead.stderr_noise:
        return ""
    if variance < _CARRIES * lead.stderr**2:
        return ""
    own, every = (lead.coverage_factor * min(x, lead.stderr) for x in (math.sqrt(variance), lead.stderr))
    size = f"{row.uncertainty:.2g} {row.unit}" if row.unit else f"{100 * row.uncertainty:.2g} %"
    key = next((key for key in _STATED if key.replace("_", " ") in row.name), "interlayer")
    more = ", or add an angle of incidence" if key == "index" else ""
    of = f"{every:.2g} {lead.unit}".rstrip()
    return (
        f"{row.name}, {size}, carries {own:.2g} of these {of}: state `{key}_uncertainty` in the recipe if it"
        f" is known better{more}"
    )


def _lead(parameters: Sequence[Parameter]) -> int:
    """Position of the leading parameter: the first thickness, else the first of all."""
    return next((i for i, p in enumerate(parameters) if p.key == "thickness"), 0)


def likely_cause(
    discrepancy: Discrepancy, parameters: Sequence[Parameter], refuted: Iterable[str] = ()
) -> list[str]:
    """A sentence on the effect that alone explains most of the residuals: one of ordinary size, one clearly
    beyond that, or the index of another material; none without any.

    Effects whose names begin with one that is `refuted` by a refit are not the cause, nor is a relative one
    of more than `_MOST`."""
    at, others = _lead(parameters), tuple(refuted)
    rows, lead = [c for c in discrepancy.contributions if not _ruled_out(c, others)], parameters[at]

    def most(some: Iterable[Contribution]) -> Contribution | None:
        return max(some, key=lambda c: c.explains, default=None)

    def share(row: Contribution | None) -> float:
        return 0.0 if row is None else row.explains

    sizes = [(c, abs(c.alone) / c.effect.size) for c in rows]
    best = most(c for c, size in sizes if size <= _USUAL and c.explains > _STRUCTURE)
    large = [c for c, size in sizes if size > _USUAL]
    position = other_material(rows)
    other = rows[position] if position >= 0 else None
    level = most(c for c in large if c.effect.name.startswith("scale"))
    beyond = most(c for c, size in sizes if _USUAL < size <= _LARGEST and not c.effect.material)
    if level is not None and share(level) > max(_EXPOSURE, *map(share, (other, best, beyond))) - 1e-12:
        return [
            f"a {level.effect.name} that is {100 * abs(level.alone):.2g} % {_towards(level)} would explain"
            f" {100 * level.explains:.0f} % of the residuals: calibrate it against a white or a reference, or"
            ' free it by `scale="free"`'
        ]
    if beyond is not None and share(beyond) > max(_CLEAR, share(other), share(best) + _MORE):
        return [
            f"{_cause(beyond, at, lead)}, far beyond its uncertainty of {_size(beyond, beyond.effect.size)}:"
            " check it, or free it"
        ]
    if other is not None:
        far = f"{100 * abs(other.alone):.2g} % {_towards(other)}"
        return [
            f"an {other.effect.name} that is {far} would explain {100 * other.explains:.0f} % of the"
            " residuals, and nothing of ordinary size does: check the material"
        ]
    if best is None:
        return []
    return [f"{_cause(best, at, lead)}: describe it in the scene if it is real"]


def _ruled_out(row: Contribution, refuted: tuple[str, ...]) -> bool:
    relative = not row.effect.unit and row.effect.power == 1
    return row.effect.name.startswith(refuted) or bool(relative and abs(row.alone) > _MOST)


def _cause(row: Contribution, at: int, lead: Parameter) -> str:
    """Words on what an effect explains alone, and what that changes of the parameter at a position."""
    return (
        f"{row.effect.name} of {_size(row, row.alone)} would explain {100 * row.explains:.0f} % of the"
        f" residuals and change {lead.name} by {row.shift[at]:+.2g}{f' {lead.unit}' if lead.unit else ''}"
    )


def _size(row: Contribution, size: float) -> str:
    return f"{size:.2g} {row.effect.unit}" if row.effect.unit else f"{100 * size:.2g} %"


def _towards(row: Contribution) -> str:
    return "higher" if row.alone > 0 else "lower"
