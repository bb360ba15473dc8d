"""Greedy removal of effects whose contribution stays within a tolerance, for films and surfaces.

Effects are tried one after the other, those that save most first. The plans with and without an effect
are compared all over the bounds; the effect is left out if `SAFETY` times the largest difference still
fits into the tolerance. Each step starts from the plan before it, so the bounds of all steps add up to
a bound on the total error (triangle inequality).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.effects.differences import Evaluation, largest_difference
from pellicle.forward_model.plan import Plan, Removal, Row
from pellicle.scene.free import free_leaves

SAFETY = 2.0
"""Between the points of `differences.design` a difference can be larger than at them: by less than this
factor in every scene of `benchmarks/tolerance.py`."""

SLOPE_POINTS = 16
"""Points at which gradients of the reduced plan are compared with those of the full one."""


class Stage(NamedTuple):
    """Plan and simplified scene after some steps, its signals at every point, and the rows of the effects
    that the steps changed."""

    plan: Plan
    scene: Any
    signals: np.ndarray
    changed: dict[str, Row]

    @property
    def rows(self) -> tuple[Row, ...]:
        """Every row of the plan, those of changed effects with their error bounds."""
        return tuple(self.changed.get(row.effect, row) for row in self.plan.rows)


class Step(NamedTuple):
    """A cheaper plan with its scene, and the row of the effect that it changes."""

    plan: Plan
    scene: Any
    row: Row


Move = Callable[[Stage], Iterable[Step]]
"""Steps that may follow a stage, the one that saves most first; at most one of them is taken."""


def check_tolerance(tolerance: float) -> None:
    """Raise ValueError for a tolerance that is negative, infinite or not a number."""
    if not 0 <= tolerance < math.inf:
        raise ValueError(f"the tolerance must be positive, or 0 for an exact plan, not {tolerance:g}")


def reduced_plan(
    full: Plan, scene: Any, evaluation: Evaluation, moves: Iterable[Move], tolerance: float
) -> Plan:
    """The plan after every move: of its steps the first that stays within the tolerance, if any."""
    stage = Stage(full, scene, evaluation.signals(full), {})
    for move in moves:
        stages = (_after(step, stage, evaluation) for step in move(stage))
        stage = next((s for s in stages if sum(row.error_bound for row in s.rows) <= tolerance), stage)
    change = evaluation.slope_change(full, stage.plan, SLOPE_POINTS) if stage.changed else 0.0
    return replace(stage.plan, rows=stage.rows, tolerance=tolerance, gradient_error=change)


def _after(step: Step, stage: Stage, evaluation: Evaluation) -> Stage:
    signals = evaluation.signals(step.plan)
    bound = SAFETY * largest_difference(signals, stage.signals, stage.plan.degrees)
    effect = step.row.effect
    bound += stage.changed[effect].error_bound if effect in stage.changed else 0.0
    return Stage(
        step.plan, step.scene, signals, stage.changed | {effect: replace(step.row, error_bound=bound)}
    )


def removal_steps(
    stage: Stage, removals: Iterable[Removal], judge: Callable[[Any], Plan], row: Callable[[Any], Row]
) -> Iterator[Step]:
    """Steps that remove one effect, except where it stays or the gradient of a free parameter is lost.

    `judge` plans the simplified scene, `row` describes a removal.
    """
    for removal in removals:
        effect = removal.effect
        simpler = stage.scene if effect == "precision" else removal(stage.scene)
        if len(free_leaves(simpler)) < len(free_leaves(stage.scene)):
            continue
        plan = judge(simpler)
        if effect in ("opaque", "precision") or not plan.on(effect):
            yield Step(replace(plan, left_out=(*stage.plan.left_out, removal)), simpler, row(removal))


def plans_after(move: Move, full: Plan, scene: Any) -> list[Plan]:
    """Every plan to which one move leads from the full plan of a scene."""
    return [step.plan for step in move(Stage(full, scene, np.zeros(0), {}))]


def left_out_row(row: Row) -> Row:
    """The row of an effect that is present and left out."""
    why = "single precision suffices" if row.effect == "precision" else row.why
    return Row(row.effect, False, f"left out: {why}")
