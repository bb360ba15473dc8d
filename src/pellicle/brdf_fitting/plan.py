"""What a surface calls for, as the lines of a plan."""

from __future__ import annotations

import numpy as np

from pellicle.effects import Row
from pellicle.free import Free
from pellicle.planning import Plan
from pellicle.surfaces.surface import Surface


def plan(surface: Surface) -> Plan:
    """The effects of a BRDF, judged from what is free and what is zero."""
    keys = {p.key for p in surface.brdf.parameters}
    rows = [_sampling(surface), _roughness(keys)]
    if "k" in keys:
        rows.append(_row(surface, "absorption", "k", "the film's extinction", "the film has no extinction"))
    if "deviation" in keys:
        tilt = "the angle between the two normals"
        rows.append(_row(surface, "deviation", "deviation", tilt, "the two boundaries are parallel"))
    rows.append(_row(surface, "diffuse", "diffuse", "the diffuse part", "there is no diffuse part"))
    rows.append(Row("precision", True, "float64: a fit's minima are compared"))
    return Plan(tuple(rows), "brdf", "unpolarised")


def _sampling(surface: Surface) -> Row:
    listed = ", ".join(f"{nm:g}" for nm in surface.seen_at)
    return Row("spectral-sampling", True, f"one wavelength a channel: {listed} nm", count=surface.channels)


def _roughness(keys: set[str]) -> Row:
    if "roughness" in keys:
        return Row("roughness", True, "a lobe of GGX microfacets")
    lobe = any(key.startswith("exponent") for key in keys)
    return Row("roughness", lobe, "a cosine lobe" if lobe else "the diffuse part alone: no lobe")


def _row(surface: Surface, effect: str, key: str, what: str, absent: str) -> Row:
    about = next(p for p in surface.brdf.parameters if p.key == key)
    given = surface.numbers.get(key, about.value)
    if isinstance(given, Free):
        return Row(effect, True, f"{what} is free")
    return Row(effect, True, f"{what} is not zero") if np.any(given) else Row(effect, False, absent)
