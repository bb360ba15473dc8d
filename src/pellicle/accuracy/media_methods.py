"""Methods that simplify the media of a scene: their absorption, dispersion, birefringence and gradients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, disperses, with_effect
from pellicle.accuracy.variant import Variant
from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.effects.film_plan import full_plan
from pellicle.effects.removal import RealPart
from pellicle.forward_model.plan import CLOSED_FORMS, GENERAL
from pellicle.optics.pair import Pair, is_real, parts
from pellicle.scene.film import Scene, media, sliced
from pellicle.scene.free import is_free, start_values
from pellicle.scene.graded import each_medium
from pellicle.scene.layers import Layer


def transparent(case: Case) -> Variant | str:
    """Layers without absorption: the real parts of their indices."""
    if not case.plan.on("absorption"):
        return "no layer absorbs"
    layers = tuple(
        replace(x, material=each_medium(RealPart, x.material)) if isinstance(x, Layer) else x
        for x in case.scene.layers
    )
    clear = eqx.tree_at(lambda s: s.layers, case.scene, layers)
    return Variant(full_plan(clear), clear)


@final
class AtOne(AbstractDispersion):
    """Index of another medium at one wavelength (nm), used at all wavelengths."""

    base: AbstractDispersion
    at: float

    def index(self, wavelength):
        one = jnp.ones_like(wavelength)
        index = self.base.index(self.at * one[..., :1] if one.ndim else self.at * one)
        re, im = parts(index)
        return re * one if is_real(index) else Pair(re * one, im * one)


def constant_index(case: Case) -> Variant | str:
    """Every medium with its index at the middle of the spectrum."""
    if not disperses(case):
        return "no index varies over the spectrum"
    middle = float(0.5 * (case.wavelength.min() + case.wavelength.max()))
    flat = [AtOne(m, middle) for m in media(case.scene)]
    return Variant(case.plan, eqx.tree_at(media, case.scene, flat))


def fewer_slices(count: int, case: Case) -> Variant | str:
    """Fewer slices of graded layers than in the full plan."""
    if not case.plan.on("gradient"):
        return "no layer is graded"
    if case.plan.row("gradient").count <= count:
        return f"the full plan has {case.plan.row('gradient').count} slices"
    return Variant(with_effect(case.plan, "gradient", True, count), case.scene)


@dataclass(frozen=True)
class _HomogeneousSlices:
    """Replaces every graded layer of a scene by homogeneous slices."""

    count: int
    effect: str = "gradient"

    def __call__(self, scene: Scene) -> Scene:
        return sliced(scene, self.count)


def homogeneous_slices(count: int, case: Case) -> Variant | str:
    """Graded layers as homogeneous slices, as programs without graded layers take them."""
    if not case.plan.on("gradient"):
        return "no layer is graded"
    removal = _HomogeneousSlices(count)
    return Variant(replace(full_plan(removal(case.scene)), left_out=(removal,)), case.scene)


def aligned_axes(case: Case) -> Variant | str:
    """Every tilted axis at the right angles next to its start values, so that s and p stay apart."""
    if case.plan.row("anisotropy").count < GENERAL:
        return "no optic axis is tilted"
    if case.scene.light.azimuth is not None:
        return "the sample is turned"

    def next_to(angle: Any) -> float:
        return 90.0 * round(float(start_values(angle)[0] if is_free(angle) else angle) / 90)

    return _with_angles(next_to, case)


def general_matrices(case: Case) -> Variant | str:
    """4×4 matrices where the full plan takes the closed forms of aligned axes."""
    if case.plan.row("anisotropy").count != CLOSED_FORMS:
        return "the full plan has them" if case.plan.on("anisotropy") else "no medium is birefringent"
    return _with_angles(np.asarray, case)  # an array is no literal angle


def _with_angles(angle: Callable[[Any], Any], case: Case) -> Variant:
    scene = jax.tree_util.tree_map(
        lambda x: x.with_angles(angle) if isinstance(x, Anisotropic) else x,
        case.scene,
        is_leaf=lambda x: isinstance(x, Anisotropic) or is_free(x),
    )
    return Variant(full_plan(scene), scene)
