"""Report and JSON record of measurements that are not made yet."""

from __future__ import annotations

import math
from typing import Any

from pellicle.fitting.planned_measurement import PSI_DELTA, MeasurementPlan, PlannedMeasurement
from pellicle.reporting.json_record import taken
from pellicle.reporting.plain_text import INDENT, aligned, blocks_of, wrapped

_ABOUT = "signal", "angle", "polarisation", "lower", "upper", "noise", "times"


def report(plan: MeasurementPlan) -> str:
    """Format the verdict, and one line for each measurement with the evidence or the errors to expect."""
    rivals = len(plan.scenes) > 1
    names = list(dict.fromkeys(name for m in plan.measurements for name in m.errors))
    rows = [("measurement", "Δ ln Z", "least between") if rivals else ("measurement", *names)]
    for m in plan.measurements:
        cells = (m.evidence, " and ".join(m.between)) if rivals else [_error(m, name) for name in names]
        rows.append((m.name, *cells))
    note = (
        "Δ ln Z to expect in the worst case; from 5 on a measurement decides"
        if rivals
        else "standard errors to expect, by noise alone in brackets; - where the bounds say as much"
    )
    levels = dict.fromkeys(
        f"{m.noise:g}{'°' if m.signal == PSI_DELTA else ''} of {m.word}" for m in plan.measurements
    )
    about = wrapped(f"{note}; noise of a point: {', '.join(levels)}", INDENT, INDENT)
    table = [f"{INDENT}{line}" for line in aligned(rows)]
    parts = [("Verdict", wrapped(plan.verdict)), ("Measurements", [*table, "", *about])]
    left_out = [line for each in plan.not_tried for line in wrapped(each)]
    return blocks_of([*parts, *([("Not tried", left_out)] if left_out else [])])


def _error(m: PlannedMeasurement, name: str) -> str:
    error = m.errors[name]
    if not math.isfinite(error.stderr):
        return "-"
    return f"{error.stderr:.2g} ({error.stderr_noise:.2g}) {error.unit}".rstrip()


def to_json(plan: MeasurementPlan) -> dict[str, Any]:
    """Convert a plan of measurements to dictionaries; infinite errors are None."""
    rows = []
    for m in plan.measurements:
        errors = {name: taken(e, "stderr", "stderr_noise", "unit") for name, e in m.errors.items()}
        of_rivals = taken(m, "delta_ln_z", "between") if m.between else {}
        rows.append(taken(m, *_ABOUT) | of_rivals | ({"errors": errors} if errors else {}))
    best = {name: taken(m, *_ABOUT) for name, m in plan.best.items()}
    of_kind = {"best": best} if len(plan.scenes) == 1 else {"would_decide": plan.would_decide}
    about = taken(plan, "scenes", "verdict", "not_tried")
    return {"schema": "pellicle.plan-measurement/1", **about, "measurements": rows, **of_kind}
