"""Effects that a surface can have, and its exact plan, judged from the bounds of its free parameters."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from pellicle.brdf.directions import angle_to_half
from pellicle.brdf.film_colour import node_count
from pellicle.brdf.sensor_bands import ERROR
from pellicle.effects.plan import Plan, Row
from pellicle.scene.free import Free, is_free
from pellicle.scene.surface import SurfaceView

SAME_DIRECTION = 1e-6
"""Angle (radians) between light and half vector below which light and eye count as one direction."""

NO_LAYER = "the layer has no part in the BRDF"


def spectral_sampling(view: SurfaceView) -> Row:
    """On where channels differ."""
    if not view.layered:
        return Row("spectral-sampling", False, "what is left is grey", count=1)
    if "weights" in view.numbers:
        count = view.channels
        return Row("spectral-sampling", count > 1, f"bands of {count} channels", count=count)
    wavelengths = np.asarray(view.numbers["wavelengths"])
    listed = ", ".join(f"{nm:g}" for nm in wavelengths)
    if len(wavelengths) == 1:
        return Row("spectral-sampling", False, f"one channel: {listed} nm", count=1)
    return Row("spectral-sampling", True, f"one wavelength a channel: {listed} nm", count=len(wavelengths))


def bands(view: SurfaceView) -> Row:
    """On where a sensor sees each channel in a band of wavelengths."""
    if not view.layered:
        return Row("bands", False, "what is left is grey")
    if "weights" not in view.numbers:
        return Row("bands", False, "no sensor: each channel is one wavelength")
    count = np.shape(view.numbers["weights"])[0]
    why = f"channels are integrals over bands, by {count} wavelengths (within {ERROR:g} in R)"
    return Row("bands", True, why, count=count)


def roughness(view: SurfaceView) -> Row:
    """On where there is a lobe."""
    if "specular" not in _keys(view):
        return Row("roughness", False, "the diffuse part alone: no lobe")
    if "specular" not in view.numbers:
        return Row("roughness", False, "the lobe has no weight")
    lobe = "a lobe of GGX microfacets" if "roughness" in view.numbers else "cosine lobes"
    return Row("roughness", True, lobe)


def deviation(view: SurfaceView) -> Row | None:
    """On where the two normals may differ; only models with two boundaries have them."""
    return _of_number(view, "deviation", "the angle between the two normals", "the boundaries are parallel")


def multiple_scattering(view: SurfaceView) -> Row | None:
    """On where a surface asks for it; only models with microfacets can."""
    if "multiple_scattering" not in _keys(view):
        return None
    if "multiple_scattering" not in view.numbers:
        return Row("multiple-scattering", False, "not asked for: light meets one facet")
    why = "light reflected more than once between facets, by Kulla and Conty"
    return Row("multiple-scattering", "specular" in view.numbers, why)


def coat(view: SurfaceView) -> Row | None:
    """On where a clear coat may have a lobe; only models with a coat have one."""
    return _of_number(view, "coat", "the lobe of the clear coat", "the clear coat has no lobe")


def diffuse(view: SurfaceView) -> Row | None:
    """On where there may be a diffuse part."""
    return _of_number(view, "diffuse", "the diffuse part", "there is no diffuse part")


def absorption(view: SurfaceView) -> Row | None:
    """On where the extinction of the film is free or not zero; only microfacet models have one."""
    row = _of_number(view, "k", "the film's extinction", "the film has no extinction")
    return None if row is None else Row("absorption", row.on, row.why)


def _keys(view: SurfaceView) -> set[str]:
    return {parameter.key for parameter in view.brdf.parameters}


def _of_number(view: SurfaceView, key: str, what: str, absent: str) -> Row | None:
    """The row of an effect with a number of its own; None where the model does not have it."""
    if key not in _keys(view):
        return None
    if key not in view.numbers:
        return Row(key, False, absent)
    number = view.numbers[key]
    free = any(map(is_free, number)) if isinstance(number, list) else is_free(number)
    return Row(key, True, f"{what} is {'free' if free else 'not zero'}")


def coherence(view: SurfaceView) -> Row:
    """On where the layer takes part: the reflections of its two faces interfere."""
    if not view.layered:
        return Row("coherence", False, NO_LAYER)
    return Row("coherence", view.coherent, "the reflections of the layer's two faces interfere")


def oblique(view: SurfaceView) -> Row | None:
    """On where a facet is lit at an angle; None for a model without a film."""
    if view.brdf.from_film_colour is None:
        return None
    if not view.layered:
        return Row("oblique", False, NO_LAYER)
    if not _lit_aslant(view):
        return Row("oblique", False, "light and eye are in the same direction")
    why = f"facets are lit at up to {np.rad2deg(largest_angle(view)):.3g}°"
    if "coat_n" in view.numbers:
        why = "facets under the coat are lit at an angle"
    if "weights" not in view.numbers or _totally_reflecting(view):
        return Row("oblique", True, why)
    # an integral over bands has flatter fringes than one wavelength: 4e-6 in R for 90 random films
    count = node_count(_bound(view.numbers["thickness"], "upper"))
    if count >= len(view.i):
        return Row("oblique", True, why)
    return Row("oblique", True, f"{why}: the film's colour at {count} angles", count=count)


def polarisation(view: SurfaceView) -> Row | None:
    """On where s and p differ."""
    row = oblique(view)
    if row is None or not row.on:
        why = "s and p are equal at normal incidence" if view.layered else NO_LAYER
        return None if row is None else Row("polarisation", False, why)
    return Row("polarisation", view.polarisation == "unpolarised", "unpolarised light: the mean of s and p")


def tunnelling(view: SurfaceView) -> Row | None:
    """Off where no index can fall below n₀ sin θ: the square root then needs no branch."""
    if view.brdf.from_film_colour is None:
        return None
    if not (view.layered and _lit_aslant(view)):
        why = "normal incidence: every wave propagates" if view.layered else NO_LAYER
        return Row("tunnelling", False, why)
    if unsure := _totally_reflecting(view):
        return Row("tunnelling", True, f"total reflection at the {' and '.join(unsure)} is possible")
    return Row("tunnelling", False, "no real index can fall below n₀ sin θ")


def _lit_aslant(view: SurfaceView) -> bool:
    return view.oblique and largest_angle(view) >= SAME_DIRECTION


def _totally_reflecting(view: SurfaceView) -> list[str]:
    """The media whose real index may fall below n₀ sin θ, which is no larger under a coat than above it."""
    ambient = _bound(view.numbers.get("ambient_n", 1.0), "upper")
    transverse = ambient * np.sin(largest_angle(view)) * (1 + 1e-6)
    return [
        name
        for name, n, k in (("film", "n", "k"), ("base", "base_n", "base_k"))
        if k not in view.numbers and _bound(view.numbers[n], "lower") <= transverse
    ]


def precision(view: SurfaceView) -> Row:
    """On: only a tolerance permits single precision."""
    return Row("precision", True, "double precision, where JAX has it enabled")


JUDGES = (
    *(spectral_sampling, bands, roughness, multiple_scattering, deviation, coat, diffuse, absorption),
    *(coherence, tunnelling, oblique, polarisation, precision),
)
"""One function for each effect of a surface, in the order of a plan; it returns None where the model cannot
have the effect."""


def exact(view: SurfaceView) -> Plan:
    """The effects that a surface has; one is off only where it is provably absent."""
    rows = [judge(view) for judge in JUDGES]
    return Plan(tuple(row for row in rows if row is not None), "brdf", view.polarisation)


def largest_angle(view: SurfaceView) -> float:
    """The largest angle of incidence (radians) on a facet that mirrors the light to the eye."""
    with jax.enable_x64(True):
        return float(np.max(np.asarray(angle_to_half(view.i, view.o)), initial=0.0))


def _bound(number: Any, side: str) -> float:
    """The largest (side "upper") or smallest value of a number, or of the bounds of a free one."""
    each = number if isinstance(number, list) else [number]
    values = [getattr(x, side) if isinstance(x, Free) else np.asarray(x) for x in each]
    return float(max(map(np.max, values)) if side == "upper" else min(map(np.min, values)))
