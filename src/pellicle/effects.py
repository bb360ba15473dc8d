"""The effects a scene may call for: one record each, saying whether it is there and why.

An effect is judged from types and from the *bounds* of free parameters, never from their current
values: a layer whose k is 0 but free keeps its absorption, because dR/dk is not 0 there.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle import averages
from pellicle.optics import interface, orders
from pellicle.optics.dispersion import AbstractDispersion, Sampled
from pellicle.optics.number import abs2, real
from pellicle.scene import (
    Free,
    Interface,
    Scene,
    absorbs,
    coherent_layers,
    free_leaves,
    groups,
    insert,
    start_values,
    thickness_spread,
)


@dataclass(frozen=True)
class Row:
    """One line of a plan: the effect, whether it is simulated, why, and the error if it is not.

    `error_bound` is in the unit of the signal. `count` is the number of orders, or of nodes where an
    average is taken; a cone of light has `around` rays for each of its nodes.
    """

    effect: str
    on: bool
    why: str
    error_bound: float = 0.0
    count: int = 0
    around: int = 0


@dataclass(frozen=True)
class Effect:
    name: str
    judge: Callable[[Scene], Row]


def _zero(number: Any) -> bool:
    """Fixed, and exactly nothing."""
    return number is None or (not isinstance(number, Free) and np.ndim(number) == 0 and float(number) == 0.0)


def _absorption(scene: Scene) -> Row:
    if any(absorbs(layer.material) for layer in coherent_layers(scene)):
        return Row("absorption", True, "a layer's extinction is free, or not zero")
    return Row("absorption", False, "no layer has any extinction, and none is free")


def _stack(scene: Scene) -> Row:
    count = max(len(group.layers) for group in groups(scene)[0])
    if count > 1:
        return Row("stack", True, f"{count} coherent layers: a product of characteristic matrices")
    if _roughness(scene).on:
        return Row("stack", True, "rough faces stand between characteristic matrices")
    return Row("stack", False, "one layer: its closed form")


def _roughness(scene: Scene) -> Row:
    faces = [_upper(each) for group in groups(scene)[0] for each in group.roughness if each is not None]
    if faces:
        how = f"up to {max(faces):g} nm damps what a face reflects"
        return Row("roughness", True, f"{len(faces)} rough: {how}")
    return Row("roughness", False, "no face was given a roughness")


def _angle_spread(scene: Scene) -> Row:
    if not scene.instrument.has_cone:
        return Row("angle-spread", False, "no cone of light was given: one angle of incidence")
    if scene.light.wavelength is None:
        raise ValueError("the cone's rays depend on the wavelengths: give the light its wavelengths")
    count, around, error = _rays(scene)
    half = np.rad2deg(scene.instrument.largest_half_angle(_least_ambient(scene)))
    why = f"light within {half:.3g}° of its axis, averaged over {count * around} rays"
    return Row("angle-spread", True, why, error, count, around)


def _oblique(scene: Scene) -> Row:
    angle = scene.light.angle
    if scene.instrument.has_cone:
        return Row("oblique", True, "the light's cone has oblique rays")
    if _zero(angle):
        return Row("oblique", False, "normal incidence, and the angle is not free")
    if isinstance(angle, Free):
        return Row("oblique", True, "the angle of incidence is free")
    span = " to ".join(f"{x:g}" for x in sorted({np.min(angle), np.max(angle)}))
    return Row("oblique", True, f"incidence at {span}°")


def _tunnelling(scene: Scene) -> Row:
    """Off where every real index is provably above n₀ sin θ: then its root needs no branch."""
    if not _oblique(scene).on:
        return Row("tunnelling", False, "normal incidence: every wave propagates")
    unsure = [name for name, m in _media(scene) if not absorbs(m) and not _propagates(m, scene)]
    if unsure:
        named = " and ".join(dict.fromkeys(unsure))
        return Row("tunnelling", True, f"total reflection in the {named} is not ruled out")
    return Row("tunnelling", False, "no real index can fall below n₀ sin θ")


def _media(scene: Scene) -> list[tuple[str, AbstractDispersion]]:
    """Everything that a wave enters, with the name that a reader knows it by."""
    own = [(i, x.material) for i, x in enumerate(scene.layers) if not isinstance(x, Interface)]
    names = {id(material): _name(scene, i) for i, material in own}
    coherent = [(names.get(id(x.material), "interface"), x.material) for x in coherent_layers(scene)]
    thick = [(names.get(id(g.below), "substrate"), g.below) for g in groups(scene)[0]]
    return [*coherent, *thick]


def _name(scene: Scene, position: int) -> str:
    return "layer" if len(scene.layers) == 1 else scene.layers[position].name or f"layer{position + 1}"


def _propagates(material, scene: Scene) -> bool:
    angle, wavelength = scene.light.angle, scene.light.wavelength
    if free_leaves(material) or isinstance(angle, Free) or wavelength is None or free_leaves(scene.ambient):
        return False
    at = np.asarray(wavelength, dtype=float)
    index, ambient = np.real(material(at)), np.real(scene.ambient(at))
    steepest = np.deg2rad(angle) + scene.instrument.largest_half_angle(float(np.min(ambient)))
    return bool(np.all(index > ambient * np.sin(np.minimum(steepest, np.pi / 2)) * (1 + 1e-6)))


def _polarisation(scene: Scene) -> Row:
    if scene.light.signal == "psi-delta":
        return Row("polarisation", True, "ellipsometry compares p with s")
    if scene.instrument.has_cone:
        return Row("polarisation", True, "the light's cone has s and p")
    if _zero(scene.light.angle):
        return Row("polarisation", False, "s and p are one at normal incidence")
    if scene.light.polarisation != "unpolarised":
        return Row("polarisation", False, f"only {scene.light.polarisation} is asked for")
    return Row("polarisation", True, "unpolarised light at an angle: the mean of s and p")


def _transmission(scene: Scene) -> Row:
    if scene.light.signal == "T":
        return Row("transmission", True, "the signal is a transmittance")
    if _back_face(scene).on:
        return Row("transmission", True, "light that reaches the back face returns through the layer")
    return Row("transmission", False, "the signal is a reflectance and the substrate has no back face")


def _back_face(scene: Scene) -> Row:
    plates = len(groups(scene)[1])
    if plates == 0:
        return Row("back-face", False, "the substrate is a half space: no back face was given")
    if plates == 1 and scene.substrate.back is not None:
        return Row("back-face", True, "the substrate is a plate; its back face adds incoherently")
    return Row("back-face", True, f"{plates} incoherent: the faces of a plate add intensities")


NODES = 15
"""Wavelengths, or thicknesses, that stand for a blur where no series can be damped."""


def _coherence(scene: Scene) -> Row:
    """A single layer's series is damped order by order; anything else is averaged over nodes."""
    present, narrow = _blurs(scene), _unresolved(scene)
    if narrow is not None:
        return Row("coherence", True, f"{narrow}: what is read is their average", UNRESOLVED_ERROR)
    if not present:
        return Row("coherence", False, "no bandwidth and no thickness spread were given: monochromatic light")
    why = f"fringes are damped by {' and '.join(present)}"
    if _has_series(scene):
        return Row("coherence", True, why)
    error = _nodes_error(scene)
    return Row("coherence", True, f"{why}, each averaged over {NODES} nodes", error, NODES)


def _blurs(scene: Scene) -> list[str]:
    """What washes out the fringes, if there are any layers to make them."""
    layers = coherent_layers(scene)
    uneven = any(thickness_spread(scene, layer) is not None for layer in layers)
    found = [] if scene.instrument.bandwidth is None else ["bandwidth"]
    return [*found, *(["uneven thickness"] if uneven else [])] if layers else []


UNRESOLVED_ERROR = 4 * float(np.exp(-0.5 * (4 * np.pi / orders.FWHM) ** 2))
"""What is left of a fringe after a window as wide as the sampling step, twice the fringes' spacing."""


def _unresolved(scene: Scene) -> str | None:
    """Says so where, all over the bounds, two fringes or more fit between neighbouring wavelengths.

    A spectrometer that samples every so many nanometres does not resolve finer than that.
    """
    if scene.light.wavelength is None or not _has_series(scene) or _blurs(scene):
        return None
    at, (layer,) = np.unique(np.asarray(scene.light.wavelength, dtype=float)), coherent_layers(scene)
    step = float(np.min(np.diff(at), initial=np.inf))
    thickness = float(layer.thickness.lower if isinstance(layer.thickness, Free) else layer.thickness)
    if at.size < 2 or 10 * thickness * step < at[-1] ** 2:  # resolved at any index below 10
        return None
    steepest = min(np.deg2rad(scene.light.largest_angle), np.pi / 2)
    square = _smallest_index(layer.material, at) ** 2 - (_least_ambient(scene) * np.sin(steepest)) ** 2
    spacing = at[-1] ** 2 / (2 * np.sqrt(max(square, 1e-12)) * thickness)
    if 2 * spacing > step:
        return None
    return f"fringes every {spacing:.2g} nm are narrower than the sampling of {step:.2g} nm"


def _has_series(scene: Scene) -> bool:
    """Whether there is one coherent layer, of which only intensities are asked for."""
    one = len(coherent_layers(scene)) == 1
    return one and scene.light.signal != "psi-delta" and not _roughness(scene).on


MOST_ORDERS = 64
ORDERS_ERROR = 1e-6


def _orders(scene: Scene) -> Row:
    if not _coherence(scene).on:
        return Row("orders", False, "the closed form sums all orders")
    if not _has_series(scene):
        return Row("orders", False, "nodes of the closed form are averaged, not orders")
    _need_wavelengths(scene)
    if _unresolved(scene) is not None:
        return Row("orders", True, "no order is left where fringes are not resolved", 0.0, 0)
    ratio = float(np.clip(largest_ratio(scene), 1e-12, 0.999))
    count = int(np.clip(np.ceil(np.log(ORDERS_ERROR * (1 - ratio)) / np.log(ratio)), 1, MOST_ORDERS))
    left = 2 * ratio**count / (1 - ratio)
    return Row("orders", True, f"|q| ≤ {ratio:.2g} over the bounds: {count} orders", min(left, 1.0), count)


def _need_wavelengths(scene: Scene) -> None:
    if scene.light.wavelength is None:
        raise ValueError("the number of orders depends on the wavelengths: give the light its wavelengths")


def _nodes_error(scene: Scene) -> float:
    """The error on a fringe of the thickest stack the bounds allow, for every blur up to theirs."""
    _need_wavelengths(scene)
    at = np.asarray(scene.light.wavelength, dtype=float)
    layers = [(layer, largest_index(layer.material, at)) for layer in coherent_layers(scene)]
    path = 4 * np.pi / np.min(at) * sum(_upper(layer.thickness) * index for layer, index in layers)
    blurs = [path / np.min(at) * _upper(scene.instrument.bandwidth) / orders.FWHM]
    blurs += [4 * np.pi / np.min(at) * index * _upper(thickness_spread(scene, x)) for x, index in layers]
    return float(sum(averages.normal_error(blur, NODES) for blur in blurs))


RAYS = (3, 4, 6, 8, 12, 16, 24)
CONE_ERROR = 1e-6


def _rays(scene: Scene) -> tuple[int, int, float]:
    """The fewest rays for a fringe of the thickest stack, and its error over the cone."""
    at, ambient = np.asarray(scene.light.wavelength, dtype=float), _least_ambient(scene)
    sine = np.sin(scene.instrument.largest_half_angle(ambient))
    axis = np.deg2rad(scene.light.largest_angle)
    index = min([_smallest_index(layer.material, at) for layer in coherent_layers(scene)], default=1.0)
    path = 4 * np.pi / np.min(at) * sum(_upper(layer.thickness) for layer in coherent_layers(scene))

    def phase(angle):
        return path * np.sqrt(np.maximum(index**2 - (ambient * np.sin(angle)) ** 2, 0.0))

    def rays(count: int) -> tuple[int, int, float]:
        around = 1 if _zero(scene.light.angle) else count
        return count, around, averages.cone_error(phase, float(axis), float(sine), count, around)

    tried = map(rays, RAYS)
    return next((found for found in tried if found[2] < CONE_ERROR), rays(RAYS[-1]))


def _least_ambient(scene: Scene) -> float:
    ambient = insert(scene.ambient, start_values(scene.ambient))
    return float(np.min(np.real(ambient(np.atleast_1d(scene.light.wavelength)))))


def _upper(number: Any) -> float:
    return float(number.upper if isinstance(number, Free) else number or 0.0)


@jax.jit
def _real_index(material: AbstractDispersion, wavelength: Any) -> Any:
    return real(material.index(wavelength))


def largest_index(material: AbstractDispersion, wavelength: np.ndarray) -> float:
    """The largest real index at these wavelengths (nm) over the corners of the bounds (at most 64)."""
    return float(np.nanmax(_corner_indices(material, wavelength)))


def _smallest_index(material: AbstractDispersion, wavelength: np.ndarray) -> float:
    """The smallest likewise, but not below 0.1: a metal has no fringes to count."""
    return max(float(np.nanmin(_corner_indices(material, wavelength))), 0.1)


def _corner_indices(material: AbstractDispersion, wavelength: np.ndarray) -> np.ndarray:
    if isinstance(material, Sampled):
        return np.asarray(real(material.value))
    free = [leaf for _, leaf in free_leaves(material)]
    corners = itertools.islice(itertools.product(*[(f.lower, f.upper) for f in free]), 64)
    return np.stack([np.asarray(_real_index(insert(material, c), wavelength)) for c in corners])


def largest_ratio(scene: Scene) -> float:
    """The largest |q| = |r₁₂ r₂₃| over the corners of the box of bounds, at most 64 of them.

    Measured, not proved: the corners and the start values, times 1.05.
    """
    free = [leaf for _, leaf in free_leaves(scene)]
    corners = itertools.islice(itertools.product(*[(f.lower, f.upper) for f in free]), 64)
    return 1.05 * max(_ratio(insert(scene, values)) for values in [*corners, start_values(scene)])


def _ratio(scene: Scene) -> float:
    at = jnp.asarray(scene.light.wavelength, dtype=float)
    group = next(group for group in groups(scene)[0] if group.layers)
    above, layer, below = (m.index(at) for m in (group.above, group.layers[0].material, group.below))
    found = []
    for angle in _extreme_angles(scene):
        a, _ = interface.transverse(scene.ambient.index(at), angle)
        inside = None if angle is None else interface.Inside(a)
        for polarisation in "s" if angle is None else "sp":
            b = orders.bounces(above, layer, below, 0.0 * at, inside, polarisation)
            found.append(np.asarray(abs2(b.upper * b.lower)))
    return float(np.sqrt(np.nanmax(np.stack(found))))


def _extreme_angles(scene: Scene) -> list[Any]:
    """The angles of incidence in radians, and those at the rim of a cone; None is normal incidence."""
    angle = None if _zero(scene.light.angle) else jnp.deg2rad(scene.light.angle)
    if not scene.instrument.has_cone:
        return [angle]
    rim = (0.0 if angle is None else angle) + scene.instrument.largest_half_angle(_least_ambient(scene))
    return [angle, jnp.minimum(rim, jnp.pi / 2)]


EFFECTS = (
    Effect("absorption", _absorption),
    Effect("stack", _stack),
    Effect("roughness", _roughness),
    Effect("tunnelling", _tunnelling),
    Effect("oblique", _oblique),
    Effect("polarisation", _polarisation),
    Effect("transmission", _transmission),
    Effect("back-face", _back_face),
    Effect("coherence", _coherence),
    Effect("orders", _orders),
    Effect("angle-spread", _angle_spread),
)
"""Every effect there is, in the order that a plan lists them."""
