"""Words of the command line and of recipes: media, models, ranges, numbers that may be free."""

from __future__ import annotations

import re
from collections.abc import Iterable

import jax
import numpy as np

from pellicle.data.tabular.numbers import number, span
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant, Shifted
from pellicle.dispersion.parameter_names import locate_parameter
from pellicle.errors import UsageError
from pellicle.materials import UnknownMaterial, material
from pellicle.recipes.dispersion_models import MODELS as MODELS
from pellicle.recipes.dispersion_models import bare, called, checked, default_bounds
from pellicle.recipes.dispersion_models import model as model
from pellicle.recipes.dispersion_models import nearest as nearest
from pellicle.scene.free import Free, is_free

_CALL = re.compile(r"\s*([A-Za-z][\w-]*)\s*(?:\((.*)\))?\s*")


def thickness(text: str) -> Free | float:
    """`LO:HI` in nm as a free thickness, or one number as a fixed one."""
    if ":" not in text:
        fixed = number(text, "--thickness", "LO:HI in nm, as in 10:3000, or a number")
        if fixed < 0:
            raise UsageError(f"--thickness must not be negative, got {text} nm")
        return fixed
    low, high = span(text, "--thickness")
    if low < 0:
        raise UsageError(f"--thickness must not be negative: its lower bound is {low:g} nm")
    return Free(low, high)


def free_or_number(text: str, what: str, lower: float, upper: float, start: float) -> Free | float:
    """`free`, `LO:HI` or a number."""
    if text == "free":
        return Free(lower, upper, start=start)
    if ":" in text:
        return Free(*span(text, what))
    return number(text, what)


def drift(text: str, what: str) -> str | float:
    """`free`, `slow` or a number, for scale and offset."""
    return text if text in ("free", "slow") else number(text, what)


def medium(text: str, free: Iterable[str] = (), what: str = "--layer") -> AbstractDispersion:
    """A medium from a word: a name, a number (`1.46`, `2.9+0.1j`), a model or an n,k table.

    `cauchy` leaves its parameters free within the default bounds of `MODELS`; `cauchy(1.46,3000)`
    fixes them, in the order of that table; `spline(400,500,600,800)` gives its knots instead. `free`
    holds items `n`, `k`, `A` or `n=1.3:1.7`: see `freed`. Raises UsageError.
    """
    return freed(_known(text.strip(), what), list(free))


def _known(text: str, what: str) -> AbstractDispersion:
    try:
        value = complex(re.sub("i$", "j", text.replace(" ", "")))
    except ValueError:
        return _named(text, what)
    if not np.isfinite(value) or value.real < 0 or value.imag < 0:
        raise UsageError(f"{what} {text}: an index is n + ik with n and k finite and not negative")
    return Constant(value.real, value.imag if value.imag else None)


def _named(text: str, what: str) -> AbstractDispersion:
    match = _CALL.fullmatch(text)
    if match is None or match[1].lower() not in MODELS:
        return _catalogued(text)
    name, given = match[1].lower(), match[2]
    if given is None:
        return bare(name)
    return called(
        name, [number(v, f"{what} {name}") for v in given.split(",") if v.strip()], f"{what} {text}"
    )


def _catalogued(name: str) -> AbstractDispersion:
    try:
        return material(name)
    except UnknownMaterial as error:
        if name.lower() in (*MIXTURES, "oscillators"):
            raise UsageError(f"{name} is made of several parts: describe it in a recipe") from None
        close = nearest(name.lower(), MODELS, 0.8)
        raise UsageError(f"no material or model {name!r}{close}" if close else str(error)) from None


def freed(dispersion: AbstractDispersion, items: list[str]) -> AbstractDispersion:
    """The dispersion with the named numbers freed: `n`, `k`, or a model's own, each with optional bounds.

    A plain number is replaced: n ± 0.5 but at least 1, k from 0 to 1. To anything else an added
    constant is freed: n within ± 0.5 as long as the sum stays at least 1 (or a tenth of its least
    value, for a metal), k from 0 to 1.
    """
    for item in items:
        name, _, bounds = item.partition("=")
        limits = span(bounds, f"--free {name}") if bounds else None
        if name in ("n", "k"):
            dispersion = _free_index(dispersion, name, limits)
        else:
            dispersion = _free_own(dispersion, name, limits)
    return dispersion


def _free_own(dispersion: AbstractDispersion, name: str, limits: tuple[float, float] | None):
    """The model's own number of that name, freed within `limits` or the model's default bounds."""
    leaves, structure = jax.tree_util.tree_flatten_with_path(dispersion, is_leaf=is_free)
    own = [i for i, (_, leaf) in enumerate(leaves) if is_free(leaf) or isinstance(leaf, int | float)]
    known = {locate_parameter(dispersion, leaves[i][0]).name: i for i in own}
    if not known or (isinstance(dispersion, Constant | Shifted) and name not in known):
        raise UsageError(
            f"--free {name}: the layer has no such number; n and k can be freed for any material"
        )
    if name not in known:
        *first, last = known
        listed = f"{', '.join(first)} and {last}" if first else last
        raise UsageError(
            f"--free {name}{nearest(name, known)}: the layer has {listed}, and n and k can be added"
        )
    path, leaf = leaves[known[name]]
    bounds = limits or default_bounds(locate_parameter(dispersion, path), leaf)
    if bounds is None:
        raise UsageError(f"--free {name}: give bounds, as in --free {name}=LO:HI")
    value = leaf.start if is_free(leaf) else leaf
    start = value if limits is None and bounds[0] <= value <= bounds[1] and not is_free(leaf) else None
    numbers = [leaf for _, leaf in leaves]
    numbers[known[name]] = Free(*bounds, start=start)
    freed = jax.tree_util.tree_unflatten(structure, numbers)
    return checked(freed, f"--free {name}")


def _free_index(dispersion: AbstractDispersion, name: str, limits: tuple[float, float] | None):
    if isinstance(dispersion, Constant):
        if name == "k":
            return Constant(dispersion.n, _free_k(dispersion.k or 0.0, limits))
        n = float(dispersion.n)
        low, high = limits or (max(1.0, n - 0.5), max(1.0, n) + 0.5)
        return Constant(Free(low, high, start=min(max(n, low), high)), dispersion.k)
    shifted = dispersion if isinstance(dispersion, Shifted) else Shifted(dispersion)
    if name == "k":
        return Shifted(shifted.base, shifted.n, _free_k(0.0, limits))
    low, high = limits or _room(dispersion)
    return Shifted(shifted.base, Free(low, high, start=min(max(0.0, low), high)), shifted.k)


def _free_k(value: float, limits: tuple[float, float] | None) -> Free:
    low, high = limits or (0.0, 1.0)
    if low < 0:
        raise UsageError(f"--free k: an extinction coefficient must not be negative, got {low:g}")
    start = value if value > low else low + 0.05 * (high - low)
    return Free(low, high, start=min(start, high))


def _room(dispersion: AbstractDispersion) -> tuple[float, float]:
    """How far a constant may be added to n."""
    low, high = getattr(dispersion, "wavelength_range", (380.0, 780.0))
    at = np.linspace(max(low, 250.0), min(high, 1700.0), 64)
    least = float(np.nanmin(np.real(dispersion(at)))) if at[0] < at[-1] else 1.0
    return (max(-0.5, 1.0 - least) if least >= 1 else -0.9 * least, 0.5)
