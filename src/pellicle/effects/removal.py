"""Removal of single effects from the scene of a film, and of all within a tolerance.

Each function takes a scene, of `Free` parameters or of numbers, and returns a simpler one whose
simulation does not contain the effect. If the simpler scene lacks a `Free` parameter its gradient would
be lost, and the effect must stay.

Effects are tried one after the other, those that save most first. The plans with and without an effect
are compared all over the bounds; the effect is left out if `SAFETY` times the largest difference still
fits into the tolerance. Each step starts from the plan before it, so the bounds of all steps add up to
a bound on the total error (triangle inequality).
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic, mean_medium
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant
from pellicle.effects.differences import Evaluation, largest_difference
from pellicle.forward_model.plan import Plan, Removal, Row
from pellicle.optics.pair import namespace, parts, real
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, is_free
from pellicle.scene.graded import Graded, each_medium
from pellicle.scene.layers import Interface, Layer, Plate, Substrate

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
    def labelled(self) -> Plan:
        """The plan with the reasons and error bounds of the effects that the steps changed."""
        return self.plan.with_rows(*self.changed.values())


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
        for step in move(stage):
            signals, effect = evaluation.signals(step.plan), step.row.effect
            bound = SAFETY * largest_difference(signals, stage.signals, stage.plan.degrees)
            bound += stage.changed[effect].error_bound if effect in stage.changed else 0.0
            changed = stage.changed | {effect: replace(step.row, error_bound=bound)}
            after = Stage(step.plan, step.scene, signals, changed)
            if after.labelled.error_bound <= tolerance:
                stage = after
                break
    change = evaluation.slope_change(full, stage.plan, SLOPE_POINTS) if stage.changed else 0.0
    return replace(stage.labelled, tolerance=tolerance, gradient_error=change)


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


@dataclass(frozen=True)
class FilmRemoval:
    """Removal of one effect from a scene; `depth` is the number of layers above an opaque one."""

    effect: str
    depth: int = 0

    def __call__(self, scene: Scene) -> Scene:
        return _REMOVALS[self.effect](scene, self)


def _with(module: Any, **changed: Any) -> Any:
    """The module with some fields changed and without its checks: a scene may have no layer here."""

    def where(m: Any) -> list[Any]:
        return [getattr(m, name) for name in changed]

    return eqx.tree_at(where, module, [*changed.values()], is_leaf=lambda x: x is None)


def _each(scene: Scene, change: Callable[[Layer], Layer]) -> tuple[Layer | Interface | Plate, ...]:
    return tuple(change(x) if isinstance(x, Layer) else x for x in scene.layers)


def _coherence(scene: Scene, _: FilmRemoval) -> Scene:
    """Drop bandwidth and thickness spreads."""
    instrument = _with(scene.instrument, bandwidth=None, thickness_spread=None)
    even = _each(scene, lambda layer: _with(layer, thickness_spread=None))
    return _with(scene, instrument=instrument, layers=even)


def _back_face(scene: Scene, _: FilmRemoval) -> Scene:
    """Make the first plate a half space."""
    first = next((i for i, x in enumerate(scene.layers) if isinstance(x, Plate)), None)
    if first is None:
        substrate = scene.substrate
        return _with(scene, substrate=Substrate(substrate.material, roughness=substrate.roughness))
    plate: Any = scene.layers[first]
    return _with(scene, layers=scene.layers[:first], substrate=Substrate(plate.material))


def _opaque(scene: Scene, removal: FilmRemoval) -> Scene:
    """Make the layer under the first `depth` ones a half space."""
    layer: Any = scene.layers[removal.depth]
    substrate = Substrate(layer.material, roughness=layer.roughness)
    return _with(scene, layers=scene.layers[: removal.depth], substrate=substrate)


def _material(change: Callable[[AbstractDispersion], AbstractDispersion], scene: Scene) -> Scene:
    """The scene with the material of every layer changed."""
    return _with(scene, layers=_each(scene, lambda layer: _with(layer, material=change(layer.material))))


@final
class MeanOverDepth(AbstractDispersion):
    """Homogeneous medium with the mean permittivity of a graded one."""

    base: AbstractDispersion

    def index(self, wavelength):
        return self.base.index(wavelength)


def _roughness(scene: Scene, _: FilmRemoval) -> Scene:
    """Make every face smooth."""
    smooth = _each(scene, lambda layer: _with(layer, roughness=None))
    return _with(scene, layers=smooth, substrate=_with(scene.substrate, roughness=None))


def _lossless(material: AbstractDispersion) -> AbstractDispersion:
    """The material without extinction, unless a parameter is free: it may be lost with the extinction."""
    if free_leaves(material):
        return material
    if isinstance(material, Anisotropic):
        return material.with_media(_lossless)
    return Constant(material.n) if isinstance(material, Constant) else RealPart(material)


@final
class RealPart(AbstractDispersion):
    """The real part of another dispersion."""

    base: AbstractDispersion

    def index(self, wavelength):
        return real(self.base.index(wavelength))


def _anisotropy(scene: Scene, _: FilmRemoval) -> Scene:
    """Give every birefringent medium the mean of its indices; free angles of an axis are lost."""

    def isotropic(x: Any) -> Any:
        birefringent = isinstance(getattr(x, "material", None), Anisotropic)
        return _with(x, material=mean_medium(x.material)) if birefringent else x

    layers, substrate = tuple(map(isotropic, scene.layers)), isotropic(scene.substrate)
    if isinstance(substrate.back, Anisotropic):
        substrate = _with(substrate, back=mean_medium(substrate.back))
    return _with(scene, layers=layers, substrate=substrate)


def _dispersion(scene: Scene, _: FilmRemoval) -> Scene:
    """Give every fixed medium its index at the middle wavelength."""
    flat = partial(_flat, wavelength=scene.light.wavelength)

    def constant(x: Any) -> Any:
        return x if isinstance(x, Interface) else _with(x, material=each_medium(flat, x.material))

    back = scene.substrate.back
    back = None if back is None else flat(back)
    substrate = _with(scene.substrate, material=flat(scene.substrate.material), back=back)
    layers = tuple(map(constant, scene.layers))
    return _with(scene, layers=layers, substrate=substrate, ambient=flat(scene.ambient))


def _flat(material: AbstractDispersion, wavelength: Any) -> AbstractDispersion:
    """The material with its index at the middle wavelength, unless a parameter is free."""
    if free_leaves(material):
        return material
    if isinstance(material, Anisotropic):
        return material.with_media(lambda medium: _flat(medium, wavelength))
    middle = np.size(wavelength) // 2
    re, im = (None if x is None else namespace(x).ravel(x)[middle] for x in parts(material.index(wavelength)))
    return Constant(0.0 if re is None else re, im)


def in_single_precision(scene: Any) -> Any:
    """The pytree with arrays in single precision; Python numbers follow them."""

    def single(x: Any) -> Any:
        if is_free(x) or not hasattr(x, "dtype"):
            return x
        return x.astype(jnp.complex64 if jnp.iscomplexobj(x) else jnp.float32)

    return jax.tree_util.tree_map(single, scene, is_leaf=is_free)


_CONE = "angle_spread", "numerical_aperture", "apodisation"
_REMOVALS: dict[str, Callable[[Scene, FilmRemoval], Scene]] = {
    # the axis of the light's cone for all its rays
    "angle-spread": lambda scene, _: _with(scene, instrument=_with(scene.instrument, **dict.fromkeys(_CONE))),
    "coherence": _coherence,
    "back-face": _back_face,
    "opaque": _opaque,
    "anisotropy": _anisotropy,
    # normal incidence
    "oblique": lambda scene, _: _with(
        scene, light=_with(scene.light, angle=0.0), instrument=_with(scene.instrument, angle_shift=None)
    ),
    "roughness": _roughness,
    # the mean permittivity of every graded layer
    "gradient": lambda scene, _: _material(
        lambda material: MeanOverDepth(material) if isinstance(material, Graded) else material, scene
    ),
    # s alone for the mean of s and p
    "polarisation": lambda scene, _: _with(scene, light=replace(scene.light, polarisation="s")),
    "absorption": lambda scene, _: _material(partial(each_medium, _lossless), scene),
    "dispersion": _dispersion,
    "precision": lambda scene, _: in_single_precision(scene),
}

REMOVABLE = tuple(_REMOVALS)
"""Effects that may be left out within a tolerance, those that save most first."""
