"""What a tolerance lets one leave out, by measuring what that changes over the bounds of a scene.

Every effect that may go is tried, those that save most first: a model with it and one without are
compared all over the box of bounds, and it goes if `SAFETY` times the largest difference still fits
into the tolerance. As each step starts from the one before, the steps add up to a bound on the whole
(the triangle inequality).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from pellicle.differences import design, gradients, largest_difference, largest_slope_change, signals
from pellicle.effects import Row, averaging, presence
from pellicle.effects.without import CAN_BE_LEFT_OUT, LeftOut
from pellicle.free import free_leaves, is_free
from pellicle.layers import Layer, absorbs
from pellicle.model import sampled
from pellicle.planning import Plan, exact
from pellicle.scene import Scene

SAFETY = 2.0
"""Between the points of `differences.design` a difference can be larger than at them: by less than this
factor in every scene of `benchmarks/tolerance.py`."""

SLOPE_POINTS = 16


def plan(scene: Scene, tolerance: float = 0.0, keep: Iterable[str] = ()) -> Plan:
    """The effects to simulate so that the signal is within `tolerance` of the whole truth.

    **Arguments:** `tolerance` in the unit of the signal: a fraction or, for ellipsometry, degrees on
    the sphere of N, C and S (Ψ is off by half of that at most, Δ by that over sin 2Ψ). At 0 an effect
    is left out only where it is provably absent. `keep` names effects that must stay.

    An effect stays where a free parameter would lose its gradient. **Raises** ValueError for a tolerance
    below 0 and, with a tolerance, for a scene without wavelengths.
    """
    if not 0 <= tolerance < math.inf:
        raise ValueError(f"the tolerance must be positive, or 0 for an exact plan, not {tolerance:g}")
    if tolerance == 0:
        return exact(scene)
    if scene.light.wavelength is None:
        raise ValueError("what an effect changes depends on the wavelengths: give the light its wavelengths")
    with jax.enable_x64(True):
        return _economised(scene, tolerance, set(keep))


def reference(scene: Scene) -> Plan:
    """The plan that others are measured against: exact, and averaged by nodes, not by orders."""
    return _by_nodes(exact(scene), scene)


def alternatives(effect: str, scene: Scene) -> list[Plan]:
    """Plans of the scene without one effect, all else exact; none where it is absent or must stay."""
    stage = _Stage(reference(scene), scene, np.zeros(0), {})
    return [step.plan for step in _leave_out(effect, stage)]


class _Stage(NamedTuple):
    """What is planned so far, for a scene made simpler, and what it measures at every point."""

    plan: Plan
    scene: Scene
    seen: np.ndarray
    told: dict[str, Row]

    @property
    def rows(self) -> tuple[Row, ...]:
        return tuple(self.told.get(row.effect, row) for row in self.plan.rows)


class _Step(NamedTuple):
    """A cheaper plan, and the row that tells of it."""

    plan: Plan
    scene: Scene
    row: Row


def _economised(scene: Scene, tolerance: float, keep: set[str]) -> Plan:
    whole, points = sampled(scene), design(scene)
    exactly = reference(scene)
    stage = _Stage(exactly, scene, signals(exactly, whole, points), {})
    fewer = [partial(_fewer, effect) for effect in ("coherence", "orders", "angle-spread")]
    leave_out = [partial(_leave_out, effect) for effect in CAN_BE_LEFT_OUT if effect not in keep]
    for move in (_by_orders, *leave_out, *fewer):
        tried = (_taken(stage, step, whole, points) for step in move(stage))
        stage = next((new for new in tried if sum(row.error_bound for row in new.rows) <= tolerance), stage)
    lost = _gradient_error(exactly, stage.plan, whole, points) if stage.told else 0.0
    return replace(stage.plan, rows=stage.rows, tolerance=tolerance, gradient_error=lost)


def _taken(stage: _Stage, step: _Step, whole: Scene, points: np.ndarray) -> _Stage:
    seen = signals(step.plan, whole, points)
    bound = SAFETY * largest_difference(seen, stage.seen, stage.plan.signal)
    bound += stage.told[step.row.effect].error_bound if step.row.effect in stage.told else 0.0
    told = stage.told | {step.row.effect: replace(step.row, error_bound=bound)}
    return _Stage(step.plan, step.scene, seen, told)


def _gradient_error(exactly: Plan, chosen: Plan, whole: Scene, points: np.ndarray) -> float:
    if not points.shape[1]:
        return 0.0
    some = points[-SLOPE_POINTS:]
    return largest_slope_change(gradients(exactly, whole, some), gradients(chosen, whole, some))


def _by_nodes(plan: Plan, scene: Scene) -> Plan:
    """With the closed form averaged where the exact plan has orders, whose phase is a straight line."""
    if not plan.row("orders").count:
        return plan
    rows = {"coherence": averaging.coherence_by_nodes(scene), "orders": Row("orders", False, "nodes instead")}
    return replace(plan, rows=tuple(rows.get(row.effect, row) for row in plan.rows))


def _by_orders(stage: _Stage) -> Iterator[_Step]:
    judged = exact(stage.scene)
    if judged.row("orders").count:
        yield _Step(judged, stage.scene, judged.row("coherence"))


def _leave_out(effect: str, stage: _Stage) -> Iterator[_Step]:
    """The plan of the scene without an effect that is there, unless a gradient is lost with it."""
    for left_out in _ways(effect, stage):
        simpler = stage.scene if effect == "precision" else left_out(stage.scene)
        if len(free_leaves(simpler)) < len(free_leaves(stage.scene)):
            continue
        judged = exact(simpler) if stage.plan.on("orders") else _by_nodes(exact(simpler), simpler)
        if effect in ("opaque", "precision") or not judged.on(effect):
            chosen = replace(judged, left_out=(*stage.plan.left_out, left_out))
            yield _Step(chosen, simpler, _told(effect, stage, left_out))


def _ways(effect: str, stage: _Stage) -> list[LeftOut]:
    """How an effect could be left out, the most thorough first; none where that has no meaning."""
    light = stage.scene.light
    if effect == "opaque":
        seen_from_above = [] if light.signal == "T" else enumerate(stage.scene.layers)
        return [
            LeftOut(effect, i) for i, x in seen_from_above if isinstance(x, Layer) and absorbs(x.material)
        ]
    meaningless = {
        "oblique": light.signal == "psi-delta",
        "back-face": light.signal == "T",
        "polarisation": light.signal == "psi-delta"
        or is_free(light.angle)  # s and p turn opposite ways with it
        or stage.scene.instrument.has_cone,
    }
    return [LeftOut(effect)] if stage.plan.on(effect) and not meaningless.get(effect, False) else []


def _told(effect: str, stage: _Stage, left_out: LeftOut) -> Row:
    if effect == "opaque":
        name = presence.name(stage.scene, left_out.depth)
        return Row(effect, True, f"{name} lets nothing through: what lies beneath is left out")
    if effect == "precision":
        return Row(effect, False, "left out: single precision will do")
    return Row(effect, False, f"left out: {stage.plan.row(effect).why}")


def _fewer(effect: str, stage: _Stage) -> Iterator[_Step]:
    row = stage.plan.row(effect)
    for count in sorted({max(row.count // 4, 1), row.count // 2, 3 * row.count // 4}):
        if 1 <= count < row.count:
            around = count if row.around > 1 else row.around
            why = f"{count} are enough of {row.count}: {row.why}"
            cheaper = replace(row, count=count, around=around, why=why)
            rows = tuple(cheaper if r.effect == effect else r for r in stage.plan.rows)
            yield _Step(replace(stage.plan, rows=rows), stage.scene, cheaper)
