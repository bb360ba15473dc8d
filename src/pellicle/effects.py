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

from pellicle.optics import orders
from pellicle.optics.dispersion import AbstractDispersion, Sampled
from pellicle.optics.number import abs2, real
from pellicle.scene import Free, Scene, absorbs, free_leaves, insert, start_values


@dataclass(frozen=True)
class Row:
    """One line of a plan: the effect, whether it is simulated, why, and the error if it is not.

    `error_bound` is in the unit of the signal; `count` is the number of orders where that applies.
    """

    effect: str
    on: bool
    why: str
    error_bound: float = 0.0
    count: int = 0


@dataclass(frozen=True)
class Effect:
    name: str
    judge: Callable[[Scene], Row]


def _zero(number: Any) -> bool:
    """Fixed, and exactly nothing."""
    return number is None or (not isinstance(number, Free) and np.ndim(number) == 0 and float(number) == 0.0)


def _absorption(scene: Scene) -> Row:
    if any(absorbs(layer.material) for layer in scene.layers):
        return Row("absorption", True, "a layer's extinction is free, or not zero")
    return Row("absorption", False, "no layer has any extinction, and none is free")


def _stack(scene: Scene) -> Row:
    count = len(scene.layers)
    if count > 1:
        return Row("stack", True, f"{count} coherent layers: a product of characteristic matrices")
    return Row("stack", False, "one layer: its closed form")


def _oblique(scene: Scene) -> Row:
    angle = scene.light.angle
    if _zero(angle):
        return Row("oblique", False, "normal incidence, and the angle is not free")
    if isinstance(angle, Free):
        return Row("oblique", True, "the angle of incidence is free")
    span = " to ".join(f"{x:g}" for x in sorted({np.min(angle), np.max(angle)}))
    return Row("oblique", True, f"incidence at {span}°")


def _tunnelling(scene: Scene) -> Row:
    """Off where every real index is provably above n₀ sin θ: then its root needs no branch."""
    if _zero(scene.light.angle):
        return Row("tunnelling", False, "normal incidence: every wave propagates")
    media = {_name(scene, i): layer.material for i, layer in enumerate(scene.layers)}
    media["substrate"] = scene.substrate.material
    unsure = [name for name, m in media.items() if not absorbs(m) and not _propagates(m, scene)]
    if unsure:
        return Row("tunnelling", True, f"total reflection in the {' and '.join(unsure)} is not ruled out")
    return Row("tunnelling", False, "no real index can fall below n₀ sin θ")


def _name(scene: Scene, position: int) -> str:
    return "layer" if len(scene.layers) == 1 else scene.layers[position].name or f"layer{position + 1}"


def _propagates(material, scene: Scene) -> bool:
    angle, wavelength = scene.light.angle, scene.light.wavelength
    if free_leaves(material) or isinstance(angle, Free) or wavelength is None or free_leaves(scene.ambient):
        return False
    at = np.asarray(wavelength, dtype=float)
    index, ambient = np.real(material(at)), np.real(scene.ambient(at))
    return bool(np.all(index > ambient * np.sin(np.deg2rad(angle)) * (1 + 1e-6)))


def _polarisation(scene: Scene) -> Row:
    if scene.light.signal == "psi-delta":
        return Row("polarisation", True, "ellipsometry compares p with s")
    if _zero(scene.light.angle):
        return Row("polarisation", False, "s and p are one at normal incidence")
    if scene.light.polarisation != "unpolarised":
        return Row("polarisation", False, f"only {scene.light.polarisation} is asked for")
    return Row("polarisation", True, "unpolarised light at an angle: the mean of s and p")


def _transmission(scene: Scene) -> Row:
    if scene.light.signal == "T":
        return Row("transmission", True, "the signal is a transmittance")
    if scene.substrate.back is not None:
        return Row("transmission", True, "light that reaches the back face returns through the layer")
    return Row("transmission", False, "the signal is a reflectance and the substrate has no back face")


def _back_face(scene: Scene) -> Row:
    if scene.substrate.back is None:
        return Row("back-face", False, "the substrate is a half space: no back face was given")
    return Row("back-face", True, "the substrate is a plate; its back face adds incoherently")


def _coherence(scene: Scene) -> Row:
    blurs = {"bandwidth": scene.instrument.bandwidth, "uneven thickness": scene.instrument.thickness_spread}
    present = [name for name, number in blurs.items() if not _zero(number)]
    if present:
        return Row("coherence", True, f"fringes are damped by {' and '.join(present)}")
    return Row("coherence", False, "no bandwidth and no thickness spread were given: monochromatic light")


MOST_ORDERS = 64
ORDERS_ERROR = 1e-6


def _orders(scene: Scene) -> Row:
    if not _coherence(scene).on:
        return Row("orders", False, "the closed form sums all orders")
    if scene.light.wavelength is None:
        raise ValueError("the number of orders depends on the wavelengths: give the light its wavelengths")
    if len(scene.layers) > 1 or scene.light.signal == "psi-delta":
        return _quadrature(scene)
    ratio = float(np.clip(largest_ratio(scene), 1e-12, 0.999))
    count = int(np.clip(np.ceil(np.log(ORDERS_ERROR * (1 - ratio)) / np.log(ratio)), 1, MOST_ORDERS))
    left = 2 * ratio**count / (1 - ratio)
    return Row("orders", True, f"|q| ≤ {ratio:.2g} over the bounds: {count} orders", min(left, 1.0), count)


NODES = 15
"""Wavelengths that stand for the bandwidth where a stack has no series to damp."""


def _quadrature(scene: Scene) -> Row:
    """The error on a fringe of the thickest stack the bounds allow, for every blur up to theirs."""
    wavelength = float(np.min(scene.light.wavelength))
    at = np.asarray(scene.light.wavelength, dtype=float)
    thickness = sum(_upper(layer.thickness) * largest_index(layer.material, at) for layer in scene.layers)
    blur = 4 * np.pi * thickness / wavelength**2 * _upper(scene.instrument.bandwidth) / orders.FWHM
    nodes, weights = np.polynomial.hermite.hermgauss(NODES)
    sigma = np.linspace(0.0, blur, 200)
    kept = np.cos(np.sqrt(2) * sigma[:, None] * nodes) @ weights / np.sqrt(np.pi)
    error = float(np.max(np.abs(kept - np.exp(-0.5 * sigma**2))))
    return Row("orders", True, f"averaged over {NODES} wavelengths of the bandwidth", error, NODES)


def _upper(number: Any) -> float:
    return float(number.upper if isinstance(number, Free) else number or 0.0)


@jax.jit
def _real_index(material: AbstractDispersion, wavelength: Any) -> Any:
    return real(material.index(wavelength))


def largest_index(material: AbstractDispersion, wavelength: np.ndarray) -> float:
    """The largest real index at these wavelengths (nm) over the corners of the bounds (at most 64)."""
    if isinstance(material, Sampled):
        return float(np.max(np.asarray(real(material.value))))
    free = [leaf for _, leaf in free_leaves(material)]
    corners = itertools.islice(itertools.product(*[(f.lower, f.upper) for f in free]), 64)
    return max(float(np.nanmax(_real_index(insert(material, c), wavelength))) for c in corners)


def largest_ratio(scene: Scene) -> float:
    """The largest |q| = |r₁₂ r₂₃| over the corners of the box of bounds, at most 64 of them.

    Measured, not proved: the corners and the start values, times 1.05.
    """
    free = [leaf for _, leaf in free_leaves(scene)]
    corners = itertools.islice(itertools.product(*[(f.lower, f.upper) for f in free]), 64)
    return 1.05 * max(_ratio(insert(scene, values)) for values in [*corners, start_values(scene)])


def _ratio(scene: Scene) -> float:
    at = jnp.asarray(scene.light.wavelength, dtype=float)
    angle = None if _zero(scene.light.angle) else jnp.deg2rad(scene.light.angle)
    layer, substrate = scene.layers[0].material(at), scene.substrate.material(at)
    ambient = scene.ambient.index(at)
    series = [
        orders.bounces(ambient, layer, substrate, 0.0 * at, angle, p)
        for p in ("s" if angle is None else "sp")
    ]
    return float(np.sqrt(np.nanmax(np.stack([np.asarray(abs2(b.upper * b.lower)) for b in series]))))


EFFECTS = (
    Effect("absorption", _absorption),
    Effect("stack", _stack),
    Effect("tunnelling", _tunnelling),
    Effect("oblique", _oblique),
    Effect("polarisation", _polarisation),
    Effect("transmission", _transmission),
    Effect("back-face", _back_face),
    Effect("coherence", _coherence),
    Effect("orders", _orders),
)
"""Every effect there is, in the order that a plan lists them."""
