"""A plan as a table for people and as a record for programs."""

from __future__ import annotations

from typing import Any

from pellicle.effects.plan import Plan
from pellicle.planning.cost_model import Saving

UNITS = {
    "psi-delta": "degrees on the sphere of N, C, S",
    "brdf": "of each value of the BRDF (of 0.01/π where that is more)",
}
HEADINGS = ("effect", "", "off by", "without it", "saves", "why")


def table(plan: Plan, savings: dict[str, Saving], whole: float, planned: float) -> str:
    """One line per effect, and what it comes to; `whole` and `planned` are seconds per evaluation.

    "off by" is what the plan is off by, "without it" and "saves" what leaving the effect out of the
    exact plan changes and saves, where that is possible.
    """
    rows = [HEADINGS, *(_row(row, savings.get(row.effect)) for row in plan.rows)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS) - 1)]
    lines = ["  ".join([*(c.ljust(w) for c, w in zip(row, widths, strict=False)), row[-1]]) for row in rows]
    unit = UNITS.get(plan.signal, f"of {plan.signal}")
    told = [
        "",
        f"off by at most {plan.error_bound:.1e} {unit}; the tolerance is {plan.tolerance:g}",
        f"an evaluation takes about {_time(planned)}, with every effect that is there {_time(whole)}",
    ]
    if plan.gradient_error:
        told.append(f"derivatives change by at most {plan.gradient_error:.1e} of their largest value")
    return "\n".join(line.rstrip() for line in [*lines, *told]) + "\n"


def _row(row: Any, saving: Saving | None) -> tuple[str, ...]:
    off_by = f"{row.error_bound:.1e}" if row.error_bound else "0"
    changes, saves = ("", "") if saving is None else (f"{saving.error:.1e}", _time(saving.seconds))
    return row.effect, "on" if row.on else "off", off_by, changes, saves, row.why


def _time(seconds: float) -> str:
    """In the unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if abs(seconds) >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def record(plan: Plan, savings: dict[str, Saving]) -> dict[str, Any]:
    """What `--json` prints: `cost` is the seconds that leaving an effect out of the exact plan saves, 0 where
    it is absent or must stay, and `error_without` what that changes."""
    return {
        "schema": "pellicle.plan/1",
        "tolerance": plan.tolerance,
        "error_bound": plan.error_bound,
        "gradient_error": plan.gradient_error,
        "effects": [_effect(row, savings.get(row.effect)) for row in plan.rows],
    }


def _effect(row: Any, saving: Saving | None) -> dict[str, Any]:
    return {
        "effect": row.effect,
        "on": row.on,
        "why": row.why,
        "error_bound": row.error_bound,
        "cost": 0.0 if saving is None else saving.seconds,
        "error_without": None if saving is None else saving.error,
    }
