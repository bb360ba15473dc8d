"""Which effects a surface calls for, judged from what it has and from the bounds of what is free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from pellicle.brdf.directions import angle_to_half
from pellicle.effects.plan import Plan, Row
from pellicle.effects.removal import in_single
from pellicle.scene.free import Free, is_free
from pellicle.scene.surface import LAYERED, SurfaceView

ALONG = 1e-6
"""Radians between light and eye, halved, below which they are one."""

NO_LAYER = "nothing of the layer is seen"


def spectral_sampling(lit: SurfaceView) -> Row:
    """On where channels differ."""
    if not lit.layered:
        return Row("spectral-sampling", False, "the diffuse part alone is grey", count=1)
    at = np.asarray(lit.numbers["wavelengths"])
    listed = ", ".join(f"{nm:g}" for nm in at)
    if len(at) == 1:
        return Row("spectral-sampling", False, f"one channel: {listed} nm", count=1)
    return Row("spectral-sampling", True, f"one wavelength a channel: {listed} nm", count=len(at))


def roughness(lit: SurfaceView) -> Row:
    """On where there is a lobe."""
    if "specular" not in {p.key for p in lit.brdf.parameters}:
        return Row("roughness", False, "the diffuse part alone: no lobe")
    if "specular" not in lit.numbers:
        return Row("roughness", False, "the lobe has no weight")
    return Row(
        "roughness", True, "a lobe of GGX microfacets" if "roughness" in lit.numbers else "cosine lobes"
    )


def deviation(lit: SurfaceView) -> Row | None:
    """On where the two normals differ, or may; only a model of two boundaries has them."""
    return _of_number(lit, "deviation", "the angle between the two normals", "the boundaries are parallel")


def diffuse(lit: SurfaceView) -> Row | None:
    """On where there is a diffuse part, or may be."""
    return _of_number(lit, "diffuse", "the diffuse part", "there is no diffuse part")


def absorption(lit: SurfaceView) -> Row | None:
    """On where the film's extinction is free, or not zero; only microfacets know one."""
    row = _of_number(lit, "k", "the film's extinction", "the film has no extinction")
    return None if row is None else Row("absorption", row.on, row.why)


def _of_number(lit: SurfaceView, key: str, what: str, absent: str) -> Row | None:
    if key not in {p.key for p in lit.brdf.parameters}:
        return None
    if key not in lit.numbers:
        return Row(key, False, absent)
    return Row(key, True, f"{what} is {'free' if _free(lit.numbers[key]) else 'not zero'}")


def coherence(lit: SurfaceView) -> Row:
    """On where anything of the layer is seen: what its two faces reflect interferes."""
    if not lit.layered:
        return Row("coherence", False, NO_LAYER)
    return Row("coherence", lit.coherent, "what the layer's two faces reflect interferes")


def oblique(lit: SurfaceView) -> Row | None:
    """On where a facet is lit at an angle; only of a film."""
    if lit.brdf.coloured is None:
        return None
    if not lit.layered:
        return Row("oblique", False, NO_LAYER)
    steepest = largest_angle(lit)
    if not lit.oblique or steepest < ALONG:
        return Row("oblique", False, "the light returns to where it comes from")
    return Row("oblique", True, f"facets are lit at up to {np.rad2deg(steepest):.3g}°")


def polarisation(lit: SurfaceView) -> Row | None:
    """On where s and p differ."""
    row = oblique(lit)
    if row is None or not row.on:
        why = "s and p are one at normal incidence" if lit.layered else NO_LAYER
        return None if row is None else Row("polarisation", False, why)
    return Row("polarisation", lit.polarisation == "unpolarised", "unpolarised light: the mean of s and p")


def tunnelling(lit: SurfaceView) -> Row | None:
    """Off where no index can fall below n₀ sin θ: then a root needs no branch."""
    if lit.brdf.coloured is None:
        return None
    row = oblique(lit)
    if row is not None and not row.on:
        why = "normal incidence: every wave propagates" if lit.layered else NO_LAYER
        return Row("tunnelling", False, why)
    transverse = _bound(lit.numbers.get("ambient_n", 1.0), "upper") * np.sin(largest_angle(lit)) * (1 + 1e-6)
    real = [("film", "n", "k"), ("base", "base_n", "base_k")]
    unsure = [
        name for name, n, k in real if k not in lit.numbers and _bound(lit.numbers[n], "lower") <= transverse
    ]
    if unsure:
        return Row("tunnelling", True, f"total reflection at the {' and '.join(unsure)} is not ruled out")
    return Row("tunnelling", False, "no real index can fall below n₀ sin θ")


def precision(lit: SurfaceView) -> Row:
    """On: only a tolerance says that single precision will do."""
    return Row("precision", True, "double, as far as JAX is set to it")


JUDGES = (
    *(spectral_sampling, roughness, deviation, diffuse, absorption),
    *(coherence, tunnelling, oblique, polarisation, precision),
)
"""One for every effect that a surface can have, in the order that a plan lists them; None says that its
model cannot have it."""


def exact(lit: SurfaceView) -> Plan:
    """The effects that a surface calls for; one is off only where it is provably absent."""
    rows = [judge(lit) for judge in JUDGES]
    return Plan(tuple(row for row in rows if row is not None), "brdf", lit.polarisation)


def largest_angle(lit: SurfaceView) -> float:
    """The largest angle (radians) at which a facet that mirrors the light to the eye is lit."""
    with jax.enable_x64(True):
        return float(np.max(np.asarray(angle_to_half(lit.i, lit.o)), initial=0.0))


def _free(number: Any) -> bool:
    return any(map(is_free, number)) if isinstance(number, list) else is_free(number)


def _bound(number: Any, side: str) -> float:
    """The largest (side "upper") or smallest value that a number, or the bounds of a free one, allow."""
    each = number if isinstance(number, list) else [number]
    values = [getattr(x, side) if isinstance(x, Free) else np.asarray(x) for x in each]
    return float(max(map(np.max, values)) if side == "upper" else min(map(np.min, values)))


_LOBES = ("specular", "roughness", "exponent", "exponent_reflection", "exponent_transmission")


_NORMALS = ("deviation", "azimuth")


@dataclass(frozen=True)
class LeftOut:
    """An effect that a plan leaves out."""

    effect: str

    def __call__(self, lit: SurfaceView) -> SurfaceView:
        return _WITHOUT[self.effect](lit)


def _roughness(lit: SurfaceView) -> SurfaceView:
    """The diffuse part alone; where that is grey nothing of the layer is left."""
    if lit.model in LAYERED:
        return _dropped(lit, *_LOBES, *_NORMALS)
    kept = {"wavelengths", "diffuse"}
    return _dropped(lit, *(lit.numbers.keys() - kept))


def _spectral_sampling(lit: SurfaceView) -> SurfaceView:
    """The middle channel for all of them."""
    middle = lit.channels // 2

    def one(number: Any) -> Any:
        if isinstance(number, list):
            return [number[middle]]
        return number if np.ndim(number) == 0 else number[middle : middle + 1]

    return replace(lit, numbers={key: one(number) for key, number in lit.numbers.items()})


def _dropped(lit: SurfaceView, *keys: str) -> SurfaceView:
    return replace(lit, numbers={key: x for key, x in lit.numbers.items() if key not in keys})


_WITHOUT: dict[str, Callable[[SurfaceView], SurfaceView]] = {
    "roughness": _roughness,
    "spectral-sampling": _spectral_sampling,
    "coherence": lambda lit: replace(lit, coherent=False),
    "oblique": lambda lit: replace(lit, oblique=False),
    "polarisation": lambda lit: replace(lit, polarisation="s"),
    "deviation": lambda lit: _dropped(lit, *_NORMALS),
    "absorption": lambda lit: _dropped(lit, "k"),
    "diffuse": lambda lit: _dropped(lit, "diffuse"),
    "precision": in_single,
}


CAN_BE_LEFT_OUT = tuple(_WITHOUT)
"""Effects that a tolerance may leave out, those that save most first."""
