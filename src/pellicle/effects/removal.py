"""A scene with one effect left out: simpler, and nearly the same to the instrument.

Each function takes a scene of `Free` parameters or of numbers and gives another one. What the scene
no longer holds leaves no trace in what is computed; a `Free` that it no longer holds is a gradient
lost, and then the effect must stay (see `pellicle.planning.film`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant
from pellicle.optics.pair import parts, real
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, is_free
from pellicle.scene.layers import Interface, Layer, Plate, Substrate


@dataclass(frozen=True)
class LeftOut:
    """An effect that a plan leaves out; `depth` is the number of layers above an opaque one."""

    effect: str
    depth: int = 0

    def __call__(self, scene: Scene) -> Scene:
        return _WITHOUT[self.effect](scene, self)


def _with(module: Any, **changed: Any) -> Any:
    """Some fields changed, unchecked: no layer at all is a bare surface here."""
    names = list(changed)
    return eqx.tree_at(
        lambda m: [getattr(m, name) for name in names], module, [*changed.values()], is_leaf=_absent
    )


def _absent(x: Any) -> bool:
    return x is None


def _each(scene: Scene, change: Callable[[Layer], Layer]) -> tuple[Layer | Interface | Plate, ...]:
    return tuple(change(x) if isinstance(x, Layer) else x for x in scene.layers)


def _angle_spread(scene: Scene, _: LeftOut) -> Scene:
    return _with(scene, instrument=_with(scene.instrument, angle_spread=None, numerical_aperture=None))


def _coherence(scene: Scene, _: LeftOut) -> Scene:
    instrument = _with(scene.instrument, bandwidth=None, thickness_spread=None)
    even = _each(scene, lambda layer: _with(layer, thickness_spread=None))
    return _with(scene, instrument=instrument, layers=even)


def _back_face(scene: Scene, _: LeftOut) -> Scene:
    """The first plate as a half space."""
    first = next((i for i, x in enumerate(scene.layers) if isinstance(x, Plate)), None)
    if first is None:
        substrate = scene.substrate
        return _with(scene, substrate=Substrate(substrate.material, roughness=substrate.roughness))
    plate: Any = scene.layers[first]
    return _with(scene, layers=scene.layers[:first], substrate=Substrate(plate.material))


def _opaque(scene: Scene, left_out: LeftOut) -> Scene:
    """The layer under the first `depth` ones as a half space."""
    layer: Any = scene.layers[left_out.depth]
    substrate = Substrate(layer.material, roughness=layer.roughness)
    return _with(scene, layers=scene.layers[: left_out.depth], substrate=substrate)


def _oblique(scene: Scene, _: LeftOut) -> Scene:
    return _with(scene, light=_with(scene.light, angle=0.0))


def _roughness(scene: Scene, _: LeftOut) -> Scene:
    smooth = _each(scene, lambda layer: _with(layer, roughness=None))
    return _with(scene, layers=smooth, substrate=_with(scene.substrate, roughness=None))


def _polarisation(scene: Scene, _: LeftOut) -> Scene:
    """s alone for the mean of s and p."""
    return _with(scene, light=replace(scene.light, polarisation="s"))


def _absorption(scene: Scene, _: LeftOut) -> Scene:
    return _with(scene, layers=_each(scene, lambda layer: _with(layer, material=_lossless(layer.material))))


def _lossless(material: AbstractDispersion) -> AbstractDispersion:
    """Without a free parameter: one may be the extinction, or be lost with it."""
    if free_leaves(material):
        return material
    return Constant(material.n) if isinstance(material, Constant) else RealPart(material)


@final
class RealPart(AbstractDispersion):
    """Another dispersion as if it did not absorb."""

    base: AbstractDispersion

    def index(self, wavelength):
        return real(self.base.index(wavelength))


def _dispersion(scene: Scene, _: LeftOut) -> Scene:
    """Every fixed medium by its index at the middle wavelength."""
    at = scene.light.wavelength
    flat = _each(scene, lambda layer: _with(layer, material=_flat(layer.material, at)))
    plates = [_with(x, material=_flat(x.material, at)) if isinstance(x, Plate) else x for x in flat]
    back = scene.substrate.back
    substrate = _with(
        scene.substrate,
        material=_flat(scene.substrate.material, at),
        back=None if back is None else _flat(back, at),
    )
    return _with(scene, layers=tuple(plates), substrate=substrate, ambient=_flat(scene.ambient, at))


def _flat(material: AbstractDispersion, wavelength: Any) -> AbstractDispersion:
    if free_leaves(material):
        return material
    middle = np.size(wavelength) // 2
    re, im = (None if x is None else jnp.ravel(x)[middle] for x in parts(material.index(wavelength)))
    return Constant(0.0 if re is None else re, im)


def _precision(scene: Scene, _: LeftOut) -> Scene:
    return in_single(scene)


def in_single(scene: Any) -> Any:
    """Arrays in single precision; plain numbers take on theirs."""

    def single(x: Any) -> Any:
        if is_free(x) or not hasattr(x, "dtype"):
            return x
        return x.astype(jnp.complex64 if jnp.iscomplexobj(x) else jnp.float32)

    return jax.tree_util.tree_map(single, scene, is_leaf=is_free)


_WITHOUT: dict[str, Callable[[Scene, LeftOut], Scene]] = {
    "angle-spread": _angle_spread,
    "coherence": _coherence,
    "back-face": _back_face,
    "opaque": _opaque,
    "oblique": _oblique,
    "roughness": _roughness,
    "polarisation": _polarisation,
    "absorption": _absorption,
    "dispersion": _dispersion,
    "precision": _precision,
}

CAN_BE_LEFT_OUT = tuple(_WITHOUT)
"""Effects that a tolerance may leave out, those that save most first."""
