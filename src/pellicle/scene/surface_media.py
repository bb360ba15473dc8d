"""Indices of a surface's film and base from their media."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pellicle.brdf.models import Model
from pellicle.dispersion.base import known_index
from pellicle.errors import UsageError
from pellicle.materials import materials_in
from pellicle.optics.pair import imag, real
from pellicle.scene.free import free_leaves
from pellicle.scene.layers import MediumLike, medium

KEYS = {"film": ("n", "k"), "base": ("base_n", "base_k")}
"""Keys of the index of each part of a surface."""
CLEAR = 1e-4
"""Extinction below which a medium counts as clear in a model whose film or base cannot absorb: over 1000 nm
it absorbs 0.3 % of blue light."""


def index_numbers(
    part: str, value: MediumLike | None, nm: np.ndarray, numbers: Mapping[str, Any], brdf: Model
) -> dict[str, np.ndarray]:
    """Return n and k of the `part` "film" or "base" of a model at wavelengths `nm`, by the model's keys.

    Empty without a medium.

    **Raises:** UsageError where the model has no such part, and where it is given twice, free, or absorbs in
    a model that has no extinction for it; ValueError for an unknown medium and for missing data.
    """
    if value is None:
        return {}
    n_key, k_key = KEYS[part]
    known = {parameter.key for parameter in brdf.parameters}
    if n_key not in known:
        raise UsageError(f"{brdf.name} has no {part}: its lower boundary reflects everything")
    if clash := {n_key, k_key} & numbers.keys():
        raise UsageError(f"{part} and {' and '.join(sorted(clash))} exclude each other")
    dispersion = medium(value)
    if free_leaves(dispersion):
        own = " and ".join(key for key in KEYS[part] if key in known)
        raise UsageError(f"{part} cannot be free: give {own} with bounds of their own in its place")
    for material in materials_in(dispersion):
        material.check_range(nm)
    index = known_index(dispersion, nm)
    n, k = (np.broadcast_to(np.asarray(part_of(index), float), nm.shape) for part_of in (real, imag))
    if not (np.all(np.isfinite(n)) and np.all(np.isfinite(k))):
        raise UsageError(f"{part}: its index is not finite at {nm.min():g} to {nm.max():g} nm")
    if k_key in known:
        return {n_key: n, k_key: k}
    if np.max(k) > CLEAR:
        raise UsageError(
            f"{part}: {brdf.name} knows no extinction there, and this medium has k up to {np.max(k):.2g}"
        )
    return {n_key: n}
