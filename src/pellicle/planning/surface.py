"""What a tolerance lets one leave out of a surface, by measuring what that changes over its bounds.

A BRDF spans decades, so it is relative errors that count: those of each value, where it is above a
hundredth of what a white diffuser sends back (`FLOOR`), and in units of that where it is below.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import jax
import numpy as np

from pellicle.effects.plan import Plan
from pellicle.effects.surface import CAN_BE_LEFT_OUT, LeftOut, exact
from pellicle.planning import cost_model
from pellicle.planning.differences import design, gradients, largest_slope_change, signals
from pellicle.planning.tolerance import (
    SLOPE_POINTS,
    See,
    Stage,
    Step,
    check_tolerance,
    economise,
    left_out_row,
    without,
)
from pellicle.scene.free import insert, is_free, start_values
from pellicle.scene.surface import SurfaceView
from pellicle.simulation.surface import build

FLOOR = 0.01 / math.pi
"""1/sr: what is darker counts as if it were as bright as this."""

NODES = (8, 16, 24, 32, 48, 64, 96, 128)
"""Angles at which a film's colour may be computed, in place of every sample's own."""


def plan(view: SurfaceView, tolerance: float = 0.0, keep: Iterable[str] = ()) -> Plan:
    """The effects to simulate so that the BRDF is within `tolerance`, relative, of the whole truth.

    At 0 an effect is left out only where it is provably absent. `keep` names effects that must stay.
    An effect stays where a free parameter would lose its gradient. Raises ValueError for a tolerance
    that is none.
    """
    check_tolerance(tolerance)
    if tolerance == 0:
        return exact(view)
    with jax.enable_x64(True):
        return _economised(view, tolerance, set(keep))


def _economised(view: SurfaceView, tolerance: float, keep: set[str]) -> Plan:
    exactly, points = exact(view), design(view)
    see = seeing(view, points)
    leave_out = [partial(_leave_out, effect) for effect in CAN_BE_LEFT_OUT if effect not in keep]
    moves = [*leave_out, *([] if "oblique" in keep else [_by_nodes])]
    stage = economise(Stage(exactly, view, see(exactly), {}), moves, see, tolerance)
    lost = _gradient_error(exactly, stage.plan, view, points) if stage.told else 0.0
    return replace(stage.plan, rows=stage.rows, tolerance=tolerance, gradient_error=lost)


def seeing(view: SurfaceView, points: np.ndarray) -> See:
    """What a plan of the surface measures at these points, over what is truly there (or `FLOOR`)."""
    truth = signals(exact(view), view, points, build)
    scale = np.maximum(np.abs(truth), FLOOR)
    return lambda plan: signals(plan, view, points, build) / scale


def _gradient_error(exactly: Plan, chosen: Plan, view: SurfaceView, points: np.ndarray) -> float:
    if not points.shape[1]:
        return 0.0
    some = points[-SLOPE_POINTS:]
    return largest_slope_change(*(gradients(each, view, some, build) for each in (exactly, chosen)))


def _leave_out(effect: str, stage: Stage) -> Iterator[Step]:
    ways = [LeftOut(effect)] if _may_go(effect, stage) else []
    return without(stage, ways, exact, lambda _: left_out_row(stage.plan.row(effect)))


def _may_go(effect: str, stage: Stage) -> bool:
    """Whether the effect is there, and something else would be left; a free thickness needs interference."""
    if not any(row.effect == effect and row.on for row in stage.plan.rows):
        return False
    other = {"roughness": "diffuse", "diffuse": "specular"}.get(effect)
    if effect == "coherence":
        return not is_free(stage.scene.numbers.get("thickness"))
    return other is None or other in stage.scene.numbers


def _by_nodes(stage: Stage) -> Iterator[Step]:
    """The film's colour at ever more nodes of the angle, as long as they are fewer than the samples."""
    rows = {row.effect: row for row in stage.plan.rows}
    if "oblique" not in rows or not (rows["oblique"].on and rows["roughness"].on and rows["coherence"].on):
        return
    for count in NODES:
        if 4 * count > len(stage.scene.i):
            break
        why = f"{rows['oblique'].why}: the film's colour at {count} angles"
        row = replace(rows["oblique"], count=count, why=why)
        chosen = [row if r.effect == "oblique" else r for r in stage.plan.rows]
        yield Step(replace(stage.plan, rows=tuple(chosen)), stage.scene, row)


def alternatives(effect: str, view: SurfaceView) -> list[Plan]:
    """Plans of the surface without one effect, all else exact; none where it is absent or must stay."""
    return [step.plan for step in _leave_out(effect, Stage(exact(view), view, np.zeros(0), {}))]


def work(plan: Plan, view: SurfaceView) -> cost_model.Work:
    """The operations of one evaluation along all directions, at the start values."""
    with jax.enable_x64(True):
        return cost_model.counted(build(plan.static_key), insert(view, start_values(view)))


def savings(view: SurfaceView, calibration: cost_model.Calibration) -> dict[str, cost_model.Saving]:
    """For each effect that could be left out: what that would change and save, all else being exact."""
    with jax.enable_x64(True):
        see = seeing(view, design(view))
        cheaper = {effect: alternatives(effect, view)[:1] for effect in CAN_BE_LEFT_OUT}
        return cost_model.saved(exact(view), cheaper, see, lambda plan: calibration.seconds(work(plan, view)))
