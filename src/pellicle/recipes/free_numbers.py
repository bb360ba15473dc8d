"""Numbers of a dispersion that flags and recipes free, as `n`, `k`, `A=1.4:1.6`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import jax
import numpy as np

from pellicle.data.options import parse_range
from pellicle.dispersion.anisotropic import Anisotropic, locate_parameter
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant, Shifted
from pellicle.errors import UsageError, did_you_mean
from pellicle.recipes import dispersion_models as models
from pellicle.scene.free import Free, check_parts, insert, is_free, start_values
from pellicle.scene.graded import Graded

_LIKE_AN_INDEX = 0.9
"""A lower bound of what is added to an index beyond which the index itself is meant."""


def free_numbers(dispersion: AbstractDispersion, items: Iterable[str]) -> AbstractDispersion:
    """Free the named numbers of a dispersion: `n`, `k`, or a model's own, each with optional bounds.

    A constant index is replaced: n ± 0.5 but at least 1 (or 0.01, where it absorbs), k from 0 to 1. For any
    other dispersion a constant is added: to n within ± 0.5 as long as the sum stays at least 1 (or a tenth of
    its least value, for a metal), to k from 0 to 1. Raises UsageError.
    """
    for item in items:
        if isinstance(dispersion, Graded):
            raise UsageError("cannot free numbers of a graded material: give bounds to those of its profile")
        name, _, words = item.partition("=")
        if isinstance(dispersion, Anisotropic) and (name in ("n", "k") or name.startswith("axis_")):
            raise UsageError(
                f"cannot free {name!r} of a birefringent layer: in the recipe, give bounds to its principal"
                " media, or to the angles of its axis"
            )
        bounds = parse_range(words, f"the range of {name}") if words else None
        free = _free_index if name in ("n", "k") else _free_parameter
        dispersion = free(dispersion, name, bounds)
    return dispersion


def _free_parameter(
    dispersion: AbstractDispersion, name: str, bounds: tuple[float, float] | None
) -> AbstractDispersion:
    """Free the model's own number of that name within `bounds` or the model's default ones."""
    leaves, structure = jax.tree_util.tree_flatten_with_path(dispersion, is_leaf=is_free)
    numbers = [i for i, (_, leaf) in enumerate(leaves) if is_free(leaf) or isinstance(leaf, int | float)]
    located = [locate_parameter(dispersion, leaves[i][0]) for i in numbers]
    known = {location.name: (location, i) for location, i in zip(located, numbers, strict=True)}
    if not known or (isinstance(dispersion, Constant | Shifted) and name not in known):
        own = "the layer has no such number; n and k can always be freed"
        if name == "thickness":
            own = (
                "its bounds free it, as in `thickness=Free(10, 1000)`; here are numbers of its index, n and k"
            )
        raise UsageError(f"cannot free {name!r}: {own}")
    if name not in known:
        *first, last = known
        listed = f"{', '.join(first)} and {last}" if first else last
        close = did_you_mean(name, known)
        raise UsageError(f"cannot free {name!r}{close}: the layer has {listed}, and n and k can be added")
    location, position = known[name]
    replaced = [leaf for _, leaf in leaves]
    replaced[position] = Free(*bounds) if bounds else models.free_by_default(location, replaced[position])
    if replaced[position] is None:
        raise UsageError(f"cannot free {name!r} without bounds: write {name}=LO:HI")
    changed = jax.tree_util.tree_unflatten(structure, replaced)
    with models.usage_errors(f"cannot free {name!r}: "):
        check_parts(changed)
    return changed


def _free_index(
    dispersion: AbstractDispersion, name: str, bounds: tuple[float, float] | None
) -> AbstractDispersion:
    if isinstance(dispersion, Constant):
        n, k = _start(dispersion.n), _start(dispersion.k or 0.0)
        if name == "k":
            return Constant(dispersion.n, _free_k(k, bounds))
        if bounds and bounds[0] < 0:
            raise UsageError(
                f"cannot free 'n' from {bounds[0]:g}: the bounds of a constant index are those of the index"
                f" itself, as in n={0.9 * n:.4g}:{1.1 * n:.4g}"
            )
        least, most = (1.0, 5.0) if dispersion.k is None else (0.01, 10.0)  # of transparent films, of metals
        low, high = max(least, n - 0.5), max(least, n) + 0.5
        default = Free(low, high, start=max(n, low), limits=(least, max(most, high)))
        return Constant(_within(bounds, default), dispersion.k)
    shifted = dispersion if isinstance(dispersion, Shifted) else Shifted(dispersion)
    if name == "k":
        return Shifted(shifted.base, shifted.n, _free_k(0.0, bounds))
    if bounds and bounds[0] >= _LIKE_AN_INDEX:
        low, high = bounds
        raise UsageError(
            f"cannot free 'n' within {low:g} to {high:g}: it is added to the index of this material; write "
            "n=-0.1:0.1 for an index near the given one, or take the model cauchy for an unknown one"
        )
    return Shifted(shifted.base, _within(bounds, _free_shift(shifted.base)), shifted.k)


def _start(number: Any) -> float:
    return number.start if isinstance(number, Free) else float(number)


def _within(bounds: tuple[float, float] | None, default: Free) -> Free:
    """A number free within the bounds that the user gives, else the default."""
    if bounds is None:
        return default
    low, high = bounds
    return Free(low, high, start=min(max(default.start, low), high))


def _free_k(value: float, bounds: tuple[float, float] | None) -> Free:
    low, high = bounds or (0.0, 1.0)
    if low < 0:
        raise UsageError(f"cannot free 'k': an extinction coefficient must not be negative, got {low:g}")
    start = value if value > low else low + 0.05 * (high - low)
    return Free(low, high, start=min(start, high), limits=None if bounds else (0.0, 20.0))


def _free_shift(dispersion: AbstractDispersion) -> Free:
    """A constant that is added to n. With more than 2 of it the material is another one."""
    low, high = getattr(dispersion, "wavelength_range", (380.0, 780.0))
    wavelength = np.linspace(max(low, 250.0), min(high, 1700.0), 64)
    rises = wavelength[0] < wavelength[-1]
    with jax.enable_x64(True):  # the same bounds wherever the scene is built, as a recipe is checked by them
        index = insert(dispersion, start_values(dispersion))(wavelength) if rises else 1.0
    least = float(np.nanmin(np.real(index)))
    lowest = 1.0 - least if least >= 1 else -0.9 * least
    return Free(max(-0.5, lowest), 0.5, start=0.0, limits=(lowest, 2.0))
