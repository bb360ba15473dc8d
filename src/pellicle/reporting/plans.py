"""Report and JSON record of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pellicle.forward_model.plan import SURFACE, Plan, Row
from pellicle.reporting.json_record import taken
from pellicle.reporting.plain_text import aligned

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pellicle.effects.differences import Savings

    Planned = Mapping[str, tuple[Plan, Savings]]
    """Plans of samples by their names, and what leaving out each effect saves; one without a name."""

_UNIT_OF_BRDF = "of each value of the BRDF (of 0.01/π where that is more)"


def report(plan: Plan) -> str:
    """Format one line for each effect, on or off, with its reason, and the bound on the error of the plan."""
    rows = [("effect", "", "error bound", "why")]
    rows += [(row.effect, "on" if row.on else "off", _bound(row), row.why) for row in plan.rows]
    return "\n".join([*aligned(rows), "", *_summary(plan)]) + "\n"


def report_with_savings(planned: Planned) -> str:
    """Format plans with the error and the time of leaving each effect out of the exact plan.

    Samples whose plans have the same effects for the same reasons have one table, of the first of them.
    """
    alike: dict[Any, list[str]] = {}
    for name, (plan, _) in planned.items():
        alike.setdefault(tuple((row.effect, row.on, row.why) for row in plan.rows), []).append(name)
    heads = [f"{', '.join(names)}:\n" if len(planned) > 1 else "" for names in alike.values()]
    tables = [_with_savings(*planned[names[0]]) for names in alike.values()]
    return "\n".join(head + table for head, table in zip(heads, tables, strict=True))


def _with_savings(plan: Plan, savings: Savings) -> str:
    rows = [("effect", "", "error bound", "if left out", "saves", "why")]
    for row in plan.rows:
        saving = savings.effects.get(row.effect)
        change, time = ("", "") if saving is None else (f"{saving.error:.1e}", _time(saving.seconds))
        rows.append((row.effect, "on" if row.on else "off", _bound(row), change, time, row.why))
    error, *gradients = _summary(plan)
    planned, exact = _time(savings.planned), _time(savings.exact)
    times = f"an evaluation takes {planned}, with every effect that is present {exact}"
    return "\n".join([*aligned(rows), "", error, times, *gradients]) + "\n"


def _bound(row: Row) -> str:
    return f"{row.error_bound:.1e}" if row.error_bound else "0"


def _summary(plan: Plan) -> list[str]:
    unit = _UNIT_OF_BRDF if plan.signal == SURFACE else plan.kind.error_unit
    lines = [f"error at most {plan.error_bound:.1e} {unit}; the tolerance is {plan.tolerance:g}"]
    if plan.gradient_error:
        lines.append(f"derivatives change by at most {plan.gradient_error:.1e} of their largest value")
    return lines


def _time(seconds: float) -> str:
    """`8.19 µs`."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if abs(seconds) >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def to_json(planned: Planned) -> dict[str, Any]:
    """Convert a plan to dictionaries; those of several samples are `samples` beside the first one's.

    `cost` is the seconds that leaving an effect out of the exact plan saves, 0 where it is absent or must
    stay; `error_without` is the change of the signal.
    """
    records = {}
    for name, (plan, savings) in planned.items():
        effects = []
        for row in plan.rows:
            saving = savings.effects.get(row.effect)
            saved = {"cost": getattr(saving, "seconds", 0.0), "error_without": getattr(saving, "error", None)}
            effects.append(taken(row, "effect", "on", "why", "error_bound") | saved)
        records[name] = taken(plan, "tolerance", "error_bound", "gradient_error") | {"effects": effects}
    several = [{"name": name, **record} for name, record in records.items()] if len(records) > 1 else None
    first = {"schema": "pellicle.plan/1", **next(iter(records.values()))}
    return first | ({"samples": several} if several else {})
