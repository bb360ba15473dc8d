"""Plans of a surface within a tolerance, by measuring what each effect changes over the bounds.

A BRDF spans decades, so errors are relative: to each value where it is above a hundredth of a white
diffuser (`FLOOR`), and to that floor where it is below.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import jax
import numpy as np

from pellicle.effects.plan import Plan
from pellicle.effects.surface import exact
from pellicle.effects.surface_removal import REMOVABLE, SurfaceRemoval
from pellicle.planning.differences import Evaluation, design, signals
from pellicle.planning.savings import Savings, measured
from pellicle.planning.tolerance import (
    Stage,
    Step,
    check_tolerance,
    left_out_row,
    plans_after,
    reduced_plan,
    removal_steps,
)
from pellicle.scene.free import is_free
from pellicle.scene.surface import SurfaceView
from pellicle.simulation.surface import build

FLOOR = 0.01 / math.pi
"""Least value (1/sr) that a relative error refers to."""

NODES = (8, 16, 24, 32, 48, 64, 96, 128)
"""Numbers of angles at which the colour of a film may be computed, in place of the angle of every sample."""


def plan(view: SurfaceView, tolerance: float = 0.0, keep: Iterable[str] = ()) -> Plan:
    """The effects to simulate so that the BRDF is within the relative `tolerance` of the exact model.

    At 0 an effect is left out only where it is provably absent. `keep` names effects that must stay.
    An effect stays where the gradient of a free parameter would be lost with it.

    **Raises:** ValueError for a negative tolerance.
    """
    check_tolerance(tolerance)
    if tolerance == 0:
        return exact(view)
    kept = set(keep)
    removals = [partial(_removal, effect) for effect in REMOVABLE if effect not in kept]
    with jax.enable_x64(True):
        moves = [*removals, *([] if "oblique" in kept else [_by_nodes])]
        return reduced_plan(exact(view), view, evaluation(view), moves, tolerance)


def evaluation(view: SurfaceView) -> Evaluation:
    """Simulations of the surface over its bounds, relative to the exact values (or to `FLOOR`)."""
    points = design(view)
    exact_values = signals(exact(view), view, points, build)
    return Evaluation(build, view, points, np.maximum(np.abs(exact_values), FLOOR))


def alternatives(effect: str, view: SurfaceView) -> list[Plan]:
    """Plans of the surface without one effect, otherwise exact; empty where it is absent or must stay."""
    return plans_after(partial(_removal, effect), exact(view), view)


def savings(view: SurfaceView, chosen: Plan) -> Savings:
    """Error and time saved by leaving each effect out of the exact plan, and the time of `chosen`."""
    with jax.enable_x64(True):
        cheaper = {effect: alternatives(effect, view)[:1] for effect in REMOVABLE}
        return measured(exact(view), chosen, cheaper, evaluation(view))


def _removal(effect: str, stage: Stage) -> Iterator[Step]:
    """Removal of one effect, where it is present and something else remains."""
    numbers = stage.scene.numbers
    present = any(row.effect == effect and row.on for row in stage.plan.rows)
    other = {"roughness": "diffuse", "coat": "specular", "diffuse": "specular"}.get(effect)
    if effect == "coherence":
        removable = not is_free(numbers.get("thickness"))  # without interference it has no gradient
    else:
        removable = other is None or other in numbers
    removals = [SurfaceRemoval(effect)] if present and removable else []
    return removal_steps(stage, removals, exact, lambda _: left_out_row(stage.plan.row(effect)))


def _by_nodes(stage: Stage) -> Iterator[Step]:
    """The colour of the film at more and more angles, while they are fewer than the samples."""
    rows = {row.effect: row for row in stage.plan.rows}
    if "oblique" not in rows or not (rows["oblique"].on and rows["roughness"].on and rows["coherence"].on):
        return
    for count in NODES:
        if 4 * count > len(stage.scene.i):
            break
        why = f"{rows['oblique'].why.partition(':')[0]}: the film's colour at {count} angles"
        row = replace(rows["oblique"], count=count, why=why)
        nodes = tuple(row if r.effect == "oblique" else r for r in stage.plan.rows)
        yield Step(replace(stage.plan, rows=nodes), stage.scene, row)
