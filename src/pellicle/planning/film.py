"""What a tolerance lets one leave out of a film's scene, by measuring what that changes over its bounds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import jax
import numpy as np

from pellicle.effects import averaging, presence
from pellicle.effects.film import exact
from pellicle.effects.plan import Plan, Row
from pellicle.effects.removal import CAN_BE_LEFT_OUT, LeftOut
from pellicle.planning.differences import design, gradients, largest_slope_change, signals
from pellicle.planning.tolerance import (
    SLOPE_POINTS,
    Stage,
    Step,
    check_tolerance,
    economise,
    left_out_row,
    without,
)
from pellicle.scene.film import Scene
from pellicle.scene.free import is_free
from pellicle.scene.layers import Layer, absorbs
from pellicle.simulation.film import sampled


def plan(scene: Scene, tolerance: float = 0.0, keep: Iterable[str] = ()) -> Plan:
    """The effects to simulate so that the signal is within `tolerance` of the whole truth.

    **Arguments:** `tolerance` in the unit of the signal: a fraction or, for ellipsometry, degrees on
    the sphere of N, C and S (Ψ is off by half of that at most, Δ by that over sin 2Ψ). At 0 an effect
    is left out only where it is provably absent. `keep` names effects that must stay.

    An effect stays where a free parameter would lose its gradient. **Raises** ValueError for a tolerance
    below 0 and, with a tolerance, for a scene without wavelengths.
    """
    check_tolerance(tolerance)
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
    stage = Stage(reference(scene), scene, np.zeros(0), {})
    return [step.plan for step in _leave_out(effect, stage)]


def _economised(scene: Scene, tolerance: float, keep: set[str]) -> Plan:
    whole, points = sampled(scene), design(scene)
    exactly = reference(scene)
    see = partial(signals, scene=whole, points=points)
    fewer = [partial(_fewer, effect) for effect in ("coherence", "orders", "angle-spread")]
    leave_out = [partial(_leave_out, effect) for effect in CAN_BE_LEFT_OUT if effect not in keep]
    stage = Stage(exactly, scene, see(exactly), {})
    stage = economise(stage, (_by_orders, *leave_out, *fewer), see, tolerance)
    lost = _gradient_error(exactly, stage.plan, whole, points) if stage.told else 0.0
    return replace(stage.plan, rows=stage.rows, tolerance=tolerance, gradient_error=lost)


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


def _by_orders(stage: Stage) -> Iterator[Step]:
    judged = exact(stage.scene)
    if judged.row("orders").count:
        yield Step(judged, stage.scene, judged.row("coherence"))


def _leave_out(effect: str, stage: Stage) -> Iterator[Step]:
    """The plan of the scene without an effect that is there, unless a gradient is lost with it."""

    def judge(simpler: Scene) -> Plan:
        return exact(simpler) if stage.plan.on("orders") else _by_nodes(exact(simpler), simpler)

    return without(stage, _ways(effect, stage), judge, partial(_told, stage))


def _ways(effect: str, stage: Stage) -> list[LeftOut]:
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


def _told(stage: Stage, left_out: LeftOut) -> Row:
    if left_out.effect == "opaque":
        name = presence.name(stage.scene, left_out.depth)
        return Row("opaque", True, f"{name} lets nothing through: what lies beneath is left out")
    return left_out_row(stage.plan.row(left_out.effect))


def _fewer(effect: str, stage: Stage) -> Iterator[Step]:
    row = stage.plan.row(effect)
    for count in sorted({max(row.count // 4, 1), row.count // 2, 3 * row.count // 4}):
        if 1 <= count < row.count:
            around = count if row.around > 1 else row.around
            why = f"{count} are enough of {row.count}: {row.why}"
            cheaper = replace(row, count=count, around=around, why=why)
            rows = tuple(cheaper if r.effect == effect else r for r in stage.plan.rows)
            yield Step(replace(stage.plan, rows=rows), stage.scene, cheaper)
