"""Media of a fitted scene with changed indices, and the systematic effects that the indices allow."""

from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic, each_principal, ordinary_index
from pellicle.dispersion.empirical import Scaled, Tabulated
from pellicle.optics.pair import Pair, imag, real
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, insert, is_free, remembered
from pellicle.scene.layers import Layer

OXIDE_INDEX = 1.46
"""Index of a native oxide, about that of SiO₂."""
_LIKE_OXIDE = 0.05
_OXIDISES = 2.0
"""Substrates of a higher index than this, or with absorption, are semiconductors and metals with an oxide."""
_GAS = 0.01
"""Media whose index is within this of 1 are gases."""


class AllowedEffects(NamedTuple):
    """Effects that the indices of a scene allow: which layers and whether its substrate are no gas, whether
    that oxidises, and whether the last layer is like an oxide already."""

    layers: tuple[bool, ...]
    substrate: bool
    oxidises: bool
    like_oxide: bool


@remembered
def allowed_effects(scene: Scene, values: tuple[float, ...] | None) -> AllowedEffects:
    """Effects that the indices allow at these values of the free numbers; None where no medium has any."""
    free = free_leaves(scene)
    at = insert(scene, [0.5] * len(free) if values is None else values)
    nm, foot = np.asarray(at.light.wavelength), at.layers[-1]
    bulk, layers = at.substrate.material, [x.material if isinstance(x, Layer) else None for x in at.layers]
    return AllowedEffects(
        tuple(medium is not None and _solid(medium, nm) for medium in layers),
        _solid(bulk, nm),
        bool(_median(bulk, nm) > _OXIDISES or np.median(np.asarray(imag(ordinary_index(bulk, nm)))) > 0.1),
        isinstance(foot, Layer)
        and not free_leaves(getattr(scene.layers[-1], "material", None))
        and like_oxide(foot.material, nm),
    )


def scaled(medium: Any, change: Any, shape: Any = 1.0) -> Any:
    """The medium with a relative change of its index, in an anisotropic one the same of all its indices."""
    return each_principal(lambda own: Scaled(own, change, shape), medium)


def with_slope(medium: Any, nm: np.ndarray) -> Any:
    """The medium with the slope in wavelength of all that is tabulated in it, from neighbouring points."""
    if isinstance(medium, Anisotropic):
        return medium.with_media(lambda own: with_slope(own, nm))
    if not isinstance(medium, Tabulated):
        return jax.tree.map(
            lambda part: with_slope(part, nm) if isinstance(part, Tabulated) else part,
            medium,
            is_leaf=lambda part: isinstance(part, Tabulated) or is_free(part),
        )
    return medium if medium.slope is not None else _table_with_slope(medium, nm)


@remembered
def _table_with_slope(medium: Tabulated, nm: np.ndarray) -> Tabulated:
    """The table with its slope. Equal tables of many layers are one object, which a program has once."""
    order, first, inverse = np.unique(nm, return_index=True, return_inverse=True)

    def slope(x: Any) -> Any:
        column = np.broadcast_to(np.asarray(x), nm.shape)[first]
        return (np.gradient(column, order) if len(order) > 1 else np.zeros(1))[inverse]

    value = medium.value
    if isinstance(value, Pair):
        parts = [None if x is None else slope(x) for x in (value.re, value.im)]
        return Tabulated(medium.wavelength, value, Pair(*parts))
    return Tabulated(medium.wavelength, value, slope(value))


def like_oxide(medium: Any, nm: np.ndarray) -> bool:
    """Test if the index of a medium is about that of a native oxide."""
    return abs(_median(medium, nm) - OXIDE_INDEX) < _LIKE_OXIDE


def _median(medium: Any, nm: np.ndarray) -> float:
    return float(np.median(np.asarray(real(ordinary_index(medium, nm)))))


def _solid(medium: Any, nm: np.ndarray) -> bool:
    index = ordinary_index(medium, nm)
    return bool(np.max(np.hypot(np.asarray(real(index)) - 1, np.asarray(imag(index)))) > _GAS)
