"""What a tolerance lets one leave out, whatever is simulated: steps that fit into it, one after the other.

Every effect that may go is tried, those that save most first: a model with it and one without are
compared all over the box of bounds, and it goes if `SAFETY` times the largest difference still fits
into the tolerance. As each step starts from the one before, the steps add up to a bound on the whole
(the triangle inequality).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.effects.plan import LeaveOut, Plan, Row
from pellicle.planning.differences import largest_difference
from pellicle.scene.free import free_leaves

SAFETY = 2.0
"""Between the points of `differences.design` a difference can be larger than at them: by less than this
factor in every scene of `benchmarks/tolerance.py`."""

SLOPE_POINTS = 16


class Stage(NamedTuple):
    """What is planned so far, for a scene made simpler, and what it measures at every point."""

    plan: Plan
    scene: Any
    seen: np.ndarray
    told: dict[str, Row]

    @property
    def rows(self) -> tuple[Row, ...]:
        return tuple(self.told.get(row.effect, row) for row in self.plan.rows)


class Step(NamedTuple):
    """A cheaper plan, and the row that tells of it."""

    plan: Plan
    scene: Any
    row: Row


Move = Callable[[Stage], Iterable[Step]]
See = Callable[[Plan], np.ndarray]
"""A plan → what it measures at every point, (points, numbers)."""


def check_tolerance(tolerance: float) -> None:
    """ValueError for one that is below 0, infinite or none."""
    if not 0 <= tolerance < math.inf:
        raise ValueError(f"the tolerance must be positive, or 0 for an exact plan, not {tolerance:g}")


def economise(stage: Stage, moves: Iterable[Move], see: See, tolerance: float) -> Stage:
    """The stage after every move: of its steps the first that fits into the tolerance, if any."""
    for move in moves:
        tried = (_taken(stage, step, see) for step in move(stage))
        stage = next((new for new in tried if sum(row.error_bound for row in new.rows) <= tolerance), stage)
    return stage


def _taken(stage: Stage, step: Step, see: See) -> Stage:
    seen = see(step.plan)
    bound = SAFETY * largest_difference(seen, stage.seen, stage.plan.signal)
    bound += stage.told[step.row.effect].error_bound if step.row.effect in stage.told else 0.0
    told = stage.told | {step.row.effect: replace(step.row, error_bound=bound)}
    return Stage(step.plan, step.scene, seen, told)


def without(
    stage: Stage, ways: Iterable[LeaveOut], judge: Callable[[Any], Plan], told: Callable[[Any], Row]
) -> Iterator[Step]:
    """Steps to the plans of the scene without an effect, unless it stays or a gradient is lost with it."""
    for leave_out in ways:
        effect = leave_out.effect
        simpler = stage.scene if effect == "precision" else leave_out(stage.scene)
        if len(free_leaves(simpler)) < len(free_leaves(stage.scene)):
            continue
        judged = judge(simpler)
        if effect in ("opaque", "precision") or not judged.on(effect):
            chosen = replace(judged, left_out=(*stage.plan.left_out, leave_out))
            yield Step(chosen, simpler, told(leave_out))


def left_out_row(row: Row) -> Row:
    """What a plan says of an effect that is there, and is left out."""
    why = "single precision will do" if row.effect == "precision" else row.why
    return Row(row.effect, False, f"left out: {why}")
