"""Plans of a film: the exact one, and those within a tolerance, by measuring what each effect changes."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import jax

from pellicle.effects import averaging, gradient, presence, removal
from pellicle.effects.differences import Evaluation, Savings, design, measured
from pellicle.errors import UsageError
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.forward_model.plan import Plan, Row
from pellicle.scene.film import Scene, of_reference
from pellicle.scene.free import is_free
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Layer, absorbs

EFFECTS = (
    *(presence.absorption, presence.anisotropy, presence.stack, gradient.gradient, presence.roughness),
    *(presence.tunnelling, presence.oblique, presence.polarisation, presence.transmission),
    *(presence.back_face, averaging.coherence, averaging.orders, averaging.angle_spread),
    *(presence.dispersion, presence.opaque, presence.precision),
)
"""One function for each effect of a film, which makes its row from a scene, in the order of a plan.

Its name is that of the effect, with hyphens.
"""


def exact(scene: Scene, given: Sequence[Row] = ()) -> Plan:
    """The effects that a scene has, judged from its types and bounds; rows that are `given` are not judged.

    A given cone of light is that of a reference too. An effect is off only where it is provably absent; its
    error bound is 0. The orders, nodes and rays of an average have a bound above 0 (see `effects.averaging`).
    """
    known = {row.effect: row for row in given}
    rows = tuple(known.get(judge.__name__.replace("_", "-")) or judge(scene) for judge in EFFECTS)
    light = scene.light
    if scene.instrument.stray_light is not None and not light.kind.has_reference:
        raise UsageError(
            "`stray_light` is that of sample and reference alike, for the signal contrast; for"
            f" {light.signal} give `offset`"
        )
    cone = [row for row in given if row.effect == "angle-spread"]
    reference = exact(of_reference(scene), cone) if light.kind.has_reference else None
    return Plan(rows, light.signal, light.polarisation, transmission=light.transmission, reference=reference)


def plan(scene: Scene, tolerance: float = 0.0, keep: Iterable[str] = ()) -> Plan:
    """The effects to simulate so that the signal is within `tolerance` of the exact model.

    **Arguments:** `tolerance` in the unit of the signal: a fraction or, for ellipsometry, degrees on
    the sphere of N, C and S (Ψ is off by half of that at most, Δ by that over sin 2Ψ). At 0 an effect
    is left out only where it is provably absent. `keep` names effects that must stay.

    An effect stays where the gradient of a free parameter would be lost with it.

    **Raises:** ValueError for a negative tolerance and, with a tolerance, for a scene without wavelengths.
    """
    removal.check_tolerance(tolerance)
    if tolerance == 0:
        return exact(scene)
    if scene.light.wavelength is None:
        raise ValueError("what an effect changes depends on the wavelengths: give the light its wavelengths")
    kept = set(keep)
    removals = [partial(_removals, effect) for effect in removal.REMOVABLE if effect not in kept]
    averages = [partial(_fewer, effect) for effect in ("coherence", "orders", "angle-spread", "gradient")]
    with jax.enable_x64(True):
        moves = (_by_orders, *removals, *averages)
        return removal.reduced_plan(full_plan(scene), scene, evaluation(scene), moves, tolerance)


def full_plan(scene: Scene) -> Plan:
    """The exact plan with the closed form averaged over nodes in place of orders, whose phase is linear."""
    plan = exact(scene)
    if not plan.row("orders").count:
        return plan
    return plan.with_rows(averaging.coherence_by_nodes(scene), Row("orders", False, "nodes instead"))


def evaluation(scene: Scene) -> Evaluation:
    """Simulations of the scene over its bounds."""
    return Evaluation(build, tabulated(scene), design(scene))


def alternatives(effect: str, scene: Scene) -> list[Plan]:
    """Plans of the scene without one effect, otherwise exact; empty where it is absent or must stay."""
    return removal.plans_after(partial(_removals, effect), full_plan(scene), scene)


def savings(scene: Scene, chosen: Plan) -> Savings:
    """Error and time saved by leaving each effect out of the full plan, and the time of `chosen`."""
    with jax.enable_x64(True):
        cheaper = {effect: alternatives(effect, scene)[:1] for effect in removal.REMOVABLE}
        return measured(full_plan(scene), chosen, cheaper, evaluation(scene))


def _by_orders(stage: removal.Stage) -> Iterator[removal.Step]:
    plan = exact(stage.scene)
    if plan.row("orders").count:
        yield removal.Step(plan, stage.scene, plan.row("coherence"))


def _removals(effect: str, stage: removal.Stage) -> Iterator[removal.Step]:
    """Removal of one effect; of opaque layers the uppermost first."""
    scene, light = stage.scene, stage.scene.light
    meaningless = {
        "oblique": light.ellipsometric,
        "back-face": light.kind.transmitted,
        "polarisation": light.ellipsometric
        or is_free(light.angle)
        or is_free(scene.instrument.angle_shift)  # with the angle s and p change in opposite directions
        or scene.instrument.has_cone,
    }
    removals = []
    if effect == "opaque" and not light.kind.transmitted:
        # a graded layer is no half space, and a layer in a group is not the last of them
        plain = (
            isinstance(x, Layer) and x.repeats == 1 and not isinstance(x.material, Graded)
            for x in scene.layers
        )
        opaque = (one and absorbs(x.material) for one, x in zip(plain, scene.layers, strict=True))
        removals = [removal.FilmRemoval(effect, depth) for depth, may_be in enumerate(opaque) if may_be]
    elif stage.plan.on(effect) and not meaningless.get(effect, False):
        removals = [removal.FilmRemoval(effect)]

    def judge(simpler: Scene) -> Plan:
        return exact(simpler) if stage.plan.on("orders") else full_plan(simpler)

    def row(one: removal.FilmRemoval) -> Row:
        if effect == "opaque":
            name = presence.name(scene, one.depth)
            return Row("opaque", True, f"{name} lets nothing through: what lies beneath is left out")
        return removal.left_out_row(stage.plan.row(effect))

    return removal.removal_steps(stage, removals, judge, row)


def _fewer(effect: str, stage: removal.Stage) -> Iterator[removal.Step]:
    """Fewer orders, nodes or rays of an average, or slices of a graded layer."""
    row = stage.plan.row(effect)
    for count in sorted({max(row.count // 4, 1), row.count // 2, 3 * row.count // 4}):
        if 1 <= count < row.count:
            around = max(row.around * count // row.count, 1)
            if row.around != row.count:
                around |= 1  # odd: see `lens_rays`
            why = f"{count} suffice of {row.count}: {row.why}"
            cheaper = replace(row, count=count, around=around, why=why)
            yield removal.Step(stage.plan.with_rows(cheaper), stage.scene, cheaper)
