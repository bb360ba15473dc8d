"""Removal of single effects from the scene of a film.

Each function takes a scene, of `Free` parameters or of numbers, and returns a simpler one whose
simulation does not contain the effect. If the simpler scene lacks a `Free` parameter its gradient would
be lost, and the effect must stay (see `pellicle.effects.tolerance`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic, mean_medium
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant
from pellicle.optics.pair import parts, real
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, is_free
from pellicle.scene.graded import Graded, each_medium
from pellicle.scene.layers import Interface, Layer, Plate, Substrate


@dataclass(frozen=True)
class FilmRemoval:
    """Removal of one effect from a scene; `depth` is the number of layers above an opaque one."""

    effect: str
    depth: int = 0

    def __call__(self, scene: Scene) -> Scene:
        return _REMOVALS[self.effect](scene, self)


def _with(module: Any, **changed: Any) -> Any:
    """The module with some fields changed and without its checks: a scene may have no layer here."""
    return eqx.tree_at(
        lambda m: [getattr(m, name) for name in changed],
        module,
        [*changed.values()],
        is_leaf=lambda x: x is None,
    )


def _each(scene: Scene, change: Callable[[Layer], Layer]) -> tuple[Layer | Interface | Plate, ...]:
    return tuple(change(x) if isinstance(x, Layer) else x for x in scene.layers)


def _angle_spread(scene: Scene, _: FilmRemoval) -> Scene:
    """Take the axis of the light's cone for all its rays."""
    return _with(scene, instrument=_with(scene.instrument, angle_spread=None, numerical_aperture=None))


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


def _gradient(scene: Scene, _: FilmRemoval) -> Scene:
    """Give every graded layer its mean permittivity."""
    return _with(scene, layers=_each(scene, lambda layer: _with(layer, material=_mean(layer.material))))


def _mean(material: AbstractDispersion) -> AbstractDispersion:
    return MeanOverDepth(material) if isinstance(material, Graded) else material


@final
class MeanOverDepth(AbstractDispersion):
    """Homogeneous medium with the mean permittivity of a graded one."""

    base: AbstractDispersion

    def index(self, wavelength):
        return self.base.index(wavelength)


def _oblique(scene: Scene, _: FilmRemoval) -> Scene:
    """Take normal incidence."""
    instrument = _with(scene.instrument, angle_shift=None)
    return _with(scene, light=_with(scene.light, angle=0.0), instrument=instrument)


def _roughness(scene: Scene, _: FilmRemoval) -> Scene:
    """Make every face smooth."""
    smooth = _each(scene, lambda layer: _with(layer, roughness=None))
    return _with(scene, layers=smooth, substrate=_with(scene.substrate, roughness=None))


def _polarisation(scene: Scene, _: FilmRemoval) -> Scene:
    """Take s alone for the mean of s and p."""
    return _with(scene, light=replace(scene.light, polarisation="s"))


def _absorption(scene: Scene, _: FilmRemoval) -> Scene:
    """Drop the extinction of every layer."""
    return _with(
        scene,
        layers=_each(scene, lambda layer: _with(layer, material=each_medium(_lossless, layer.material))),
    )


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
        return _with(x, material=mean_medium(x.material)) if _birefringent(x) else x

    layers, substrate = tuple(map(isotropic, scene.layers)), isotropic(scene.substrate)
    if isinstance(substrate.back, Anisotropic):
        substrate = _with(substrate, back=mean_medium(substrate.back))
    return _with(scene, layers=layers, substrate=substrate)


def _birefringent(x: Any) -> bool:
    return not isinstance(x, Interface) and isinstance(x.material, Anisotropic)


def _dispersion(scene: Scene, _: FilmRemoval) -> Scene:
    """Give every fixed medium its index at the middle wavelength."""
    at = scene.light.wavelength

    def constant(layer: Layer) -> Layer:
        return _with(layer, material=each_medium(lambda medium: _flat(medium, at), layer.material))

    flat = _each(scene, constant)
    plates = [_with(x, material=_flat(x.material, at)) if isinstance(x, Plate) else x for x in flat]
    back = scene.substrate.back
    substrate = _with(
        scene.substrate,
        material=_flat(scene.substrate.material, at),
        back=None if back is None else _flat(back, at),
    )
    return _with(scene, layers=tuple(plates), substrate=substrate, ambient=_flat(scene.ambient, at))


def _flat(material: AbstractDispersion, wavelength: Any) -> AbstractDispersion:
    """The material with its index at the middle wavelength, unless a parameter is free."""
    if free_leaves(material):
        return material
    if isinstance(material, Anisotropic):
        return material.with_media(lambda medium: _flat(medium, wavelength))
    middle = np.size(wavelength) // 2
    re, im = (None if x is None else jnp.ravel(x)[middle] for x in parts(material.index(wavelength)))
    return Constant(0.0 if re is None else re, im)


def in_single_precision(scene: Any) -> Any:
    """The pytree with arrays in single precision; Python numbers follow them."""

    def single(x: Any) -> Any:
        if is_free(x) or not hasattr(x, "dtype"):
            return x
        return x.astype(jnp.complex64 if jnp.iscomplexobj(x) else jnp.float32)

    return jax.tree_util.tree_map(single, scene, is_leaf=is_free)


_REMOVALS: dict[str, Callable[[Scene, FilmRemoval], Scene]] = {
    "angle-spread": _angle_spread,
    "coherence": _coherence,
    "back-face": _back_face,
    "opaque": _opaque,
    "anisotropy": _anisotropy,
    "oblique": _oblique,
    "roughness": _roughness,
    "gradient": _gradient,
    "polarisation": _polarisation,
    "absorption": _absorption,
    "dispersion": _dispersion,
    "precision": lambda scene, _: in_single_precision(scene),
}

REMOVABLE = tuple(_REMOVALS)
"""Effects that may be left out within a tolerance, those that save most first."""
