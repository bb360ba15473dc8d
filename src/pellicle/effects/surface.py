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


def spectral_sampling(view: SurfaceView) -> Row:
    """On where channels differ."""
    if not view.layered:
        return Row("spectral-sampling", False, "the diffuse part alone is grey", count=1)
    at = np.asarray(view.numbers["wavelengths"])
    listed = ", ".join(f"{nm:g}" for nm in at)
    if len(at) == 1:
        return Row("spectral-sampling", False, f"one channel: {listed} nm", count=1)
    return Row("spectral-sampling", True, f"one wavelength a channel: {listed} nm", count=len(at))


def roughness(view: SurfaceView) -> Row:
    """On where there is a lobe."""
    if "specular" not in {p.key for p in view.brdf.parameters}:
        return Row("roughness", False, "the diffuse part alone: no lobe")
    if "specular" not in view.numbers:
        return Row("roughness", False, "the lobe has no weight")
    return Row(
        "roughness", True, "a lobe of GGX microfacets" if "roughness" in view.numbers else "cosine lobes"
    )


def deviation(view: SurfaceView) -> Row | None:
    """On where the two normals differ, or may; only a model of two boundaries has them."""
    return _of_number(view, "deviation", "the angle between the two normals", "the boundaries are parallel")


def diffuse(view: SurfaceView) -> Row | None:
    """On where there is a diffuse part, or may be."""
    return _of_number(view, "diffuse", "the diffuse part", "there is no diffuse part")


def absorption(view: SurfaceView) -> Row | None:
    """On where the film's extinction is free, or not zero; only microfacets know one."""
    row = _of_number(view, "k", "the film's extinction", "the film has no extinction")
    return None if row is None else Row("absorption", row.on, row.why)


def _of_number(view: SurfaceView, key: str, what: str, absent: str) -> Row | None:
    if key not in {p.key for p in view.brdf.parameters}:
        return None
    if key not in view.numbers:
        return Row(key, False, absent)
    return Row(key, True, f"{what} is {'free' if _free(view.numbers[key]) else 'not zero'}")


def coherence(view: SurfaceView) -> Row:
    """On where anything of the layer is seen: what its two faces reflect interferes."""
    if not view.layered:
        return Row("coherence", False, NO_LAYER)
    return Row("coherence", view.coherent, "what the layer's two faces reflect interferes")


def oblique(view: SurfaceView) -> Row | None:
    """On where a facet is lit at an angle; only of a film."""
    if view.brdf.from_film_colour is None:
        return None
    if not view.layered:
        return Row("oblique", False, NO_LAYER)
    steepest = largest_angle(view)
    if not view.oblique or steepest < ALONG:
        return Row("oblique", False, "the light returns to where it comes from")
    return Row("oblique", True, f"facets are lit at up to {np.rad2deg(steepest):.3g}°")


def polarisation(view: SurfaceView) -> Row | None:
    """On where s and p differ."""
    row = oblique(view)
    if row is None or not row.on:
        why = "s and p are one at normal incidence" if view.layered else NO_LAYER
        return None if row is None else Row("polarisation", False, why)
    return Row("polarisation", view.polarisation == "unpolarised", "unpolarised light: the mean of s and p")


def tunnelling(view: SurfaceView) -> Row | None:
    """Off where no index can fall below n₀ sin θ: then a root needs no branch."""
    if view.brdf.from_film_colour is None:
        return None
    row = oblique(view)
    if row is not None and not row.on:
        why = "normal incidence: every wave propagates" if view.layered else NO_LAYER
        return Row("tunnelling", False, why)
    ambient = _bound(view.numbers.get("ambient_n", 1.0), "upper")
    transverse = ambient * np.sin(largest_angle(view)) * (1 + 1e-6)
    real = [("film", "n", "k"), ("base", "base_n", "base_k")]
    unsure = [
        name
        for name, n, k in real
        if k not in view.numbers and _bound(view.numbers[n], "lower") <= transverse
    ]
    if unsure:
        return Row("tunnelling", True, f"total reflection at the {' and '.join(unsure)} is not ruled out")
    return Row("tunnelling", False, "no real index can fall below n₀ sin θ")


def precision(view: SurfaceView) -> Row:
    """On: only a tolerance says that single precision will do."""
    return Row("precision", True, "double, as far as JAX is set to it")


JUDGES = (
    *(spectral_sampling, roughness, deviation, diffuse, absorption),
    *(coherence, tunnelling, oblique, polarisation, precision),
)
"""One for every effect that a surface can have, in the order that a plan lists them; None says that its
model cannot have it."""


def exact(view: SurfaceView) -> Plan:
    """The effects that a surface calls for; one is off only where it is provably absent."""
    rows = [judge(view) for judge in JUDGES]
    return Plan(tuple(row for row in rows if row is not None), "brdf", view.polarisation)


def largest_angle(view: SurfaceView) -> float:
    """The largest angle (radians) at which a facet that mirrors the light to the eye is lit."""
    with jax.enable_x64(True):
        return float(np.max(np.asarray(angle_to_half(view.i, view.o)), initial=0.0))


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

    def __call__(self, view: SurfaceView) -> SurfaceView:
        return _WITHOUT[self.effect](view)


def _roughness(view: SurfaceView) -> SurfaceView:
    """The diffuse part alone; where that is grey nothing of the layer is left."""
    if view.model in LAYERED:
        return _dropped(view, *_LOBES, *_NORMALS)
    kept = {"wavelengths", "diffuse"}
    return _dropped(view, *(view.numbers.keys() - kept))


def _spectral_sampling(view: SurfaceView) -> SurfaceView:
    """The middle channel for all of them."""
    middle = view.channels // 2

    def one(number: Any) -> Any:
        if isinstance(number, list):
            return [number[middle]]
        return number if np.ndim(number) == 0 else number[middle : middle + 1]

    return replace(view, numbers={key: one(number) for key, number in view.numbers.items()})


def _dropped(view: SurfaceView, *keys: str) -> SurfaceView:
    return replace(view, numbers={key: x for key, x in view.numbers.items() if key not in keys})


_WITHOUT: dict[str, Callable[[SurfaceView], SurfaceView]] = {
    "roughness": _roughness,
    "spectral-sampling": _spectral_sampling,
    "coherence": lambda view: replace(view, coherent=False),
    "oblique": lambda view: replace(view, oblique=False),
    "polarisation": lambda view: replace(view, polarisation="s"),
    "deviation": lambda view: _dropped(view, *_NORMALS),
    "absorption": lambda view: _dropped(view, "k"),
    "diffuse": lambda view: _dropped(view, "diffuse"),
    "precision": in_single,
}


CAN_BE_LEFT_OUT = tuple(_WITHOUT)
"""Effects that a tolerance may leave out, those that save most first."""
