"""Words of the command line and of recipes: media, and numbers that may be free."""

import re
from collections.abc import Iterable

import jax
import numpy as np

from pellicle.data.options import parse_number, parse_range
from pellicle.dispersion.anisotropic import Anisotropic, locate_parameter
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant, Shifted
from pellicle.errors import UsageError, did_you_mean
from pellicle.materials import UnknownMaterial, material
from pellicle.recipes.dispersion_models import (
    MODELS,
    Parameter,
    check_dispersion,
    fixed_model,
    free_by_default,
    free_model,
)
from pellicle.scene.free import Free, is_free
from pellicle.scene.graded import Graded

_DECIMAL_COMMA = re.compile(r"\s*\d+,\d+\s*")
_LIKE_AN_INDEX = 0.9
"""A lower bound of what is added to an index beyond which the index itself is meant."""

_CALL = re.compile(r"\s*([A-Za-z][\w-]*)\s*(?:\((.*)\))?\s*")


def thickness(text: str) -> Free | float:
    """Parse `LO:HI` in nm as a free thickness, or one number as a fixed one. Raises UsageError."""
    if ":" not in text:
        fixed = parse_number(text, "`thickness`", "LO:HI in nm, as in 10:3000, or a number")
        if fixed < 0:
            raise UsageError(f"`thickness` must not be negative, got {text} nm")
        return fixed
    low, high = parse_range(text, "`thickness`")
    if low < 0:
        raise UsageError(f"`thickness` must not be negative: its lower bound is {low:g} nm")
    return Free(low, high)


def free_or_number(text: str, name: str, default: Free) -> Free | float:
    """Parse `free` (the default), `LO:HI` or a number. Raises UsageError."""
    if text == "free":
        return default
    if ":" in text:
        return Free(*parse_range(text, name))
    return parse_number(text, name)


def drift(text: str, name: str) -> str | float:
    """Parse `free`, `slow` or a number, for scale and offset. Raises UsageError."""
    return text if text in ("free", "slow") else parse_number(text, name)


def medium(text: str, free: Iterable[str] = (), name: str = "`layer`") -> AbstractDispersion:
    """Return the dispersion for a word: a material or its file, a number (`1.46`, `2.9+0.1j`) or a model.

    `cauchy` leaves the model's parameters free within the default bounds of `MODELS`; `cauchy(1.46,3000)`
    fixes them, in the order of that table; `spline(400,500,600,800)` gives knots. `free` has items such as
    `n`, `k`, `A` or `n=1.3:1.7`: see `free_numbers`. `name` is the argument that messages name.

    Raises UsageError, or DataError for a file that cannot be read.
    """
    return free_numbers(_dispersion(text.strip(), name), free)


def scattering_back(
    word: str, signal: str, part: tuple[Free | float | None, int | None]
) -> tuple[AbstractDispersion, float]:
    """Medium behind a back face that is `rough` or `taped`, and the share of its light that is collected: 0.

    `part` is the share and the number of reflections that were given with it. Raises UsageError for either,
    and for a transmittance.
    """
    if part != (None, None):
        raise UsageError(f"`back` {word} returns no light: leave out `back_collected` and `back_reflections`")
    if signal == "T":
        raise UsageError(
            f"light through a {word} back is scattered or blocked, and its transmittance is not simulated"
        )
    return Constant(1.0), 0.0


def _dispersion(text: str, name: str) -> AbstractDispersion:
    try:
        index = complex(re.sub("i$", "j", text.replace(" ", "")))
    except ValueError:
        return _model_or_material(text, name)
    if not np.isfinite(index) or index.real < 0 or index.imag < 0:
        raise UsageError(f"{name} must be an index n + ik with n and k finite and not negative, got {text}")
    return Constant(index.real, index.imag if index.imag else None)


def _model_or_material(text: str, name: str) -> AbstractDispersion:
    match = _CALL.fullmatch(text)
    if match is None or match[1].lower() not in MODELS:
        return _material(text)
    model, numbers = match[1].lower(), match[2]
    if numbers is None:
        return free_model(model)
    label = f"{name}: a parameter of {model}"
    return fixed_model(model, [parse_number(v, label) for v in numbers.split(",") if v.strip()], name)


def _material(name: str) -> AbstractDispersion:
    try:
        return material(name)
    except UnknownMaterial as error:
        if name.lower() in (*MIXTURES, "oscillators"):
            raise UsageError(f"{name} consists of several parts: describe it in a recipe") from None
        if _DECIMAL_COMMA.fullmatch(name):
            raise UsageError(
                f"{name!r} is no material; an index has a decimal point: {name.replace(',', '.')}"
            ) from None
        close = did_you_mean(name.lower(), MODELS, 0.8)
        raise UsageError(f"no material or model {name!r}{close}" if close else str(error)) from None


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
        if name in ("n", "k"):
            dispersion = _free_index(dispersion, name, bounds)
        else:
            dispersion = _free_parameter(dispersion, name, bounds)
    return dispersion


def _free_parameter(
    dispersion: AbstractDispersion, name: str, bounds: tuple[float, float] | None
) -> AbstractDispersion:
    """Free the model's own number of that name within `bounds` or the model's default ones."""
    leaves, structure = jax.tree_util.tree_flatten_with_path(dispersion, is_leaf=is_free)
    numbers = [i for i, (_, leaf) in enumerate(leaves) if is_free(leaf) or isinstance(leaf, int | float)]
    known = {locate_parameter(dispersion, leaves[i][0]).name: i for i in numbers}
    if not known or (isinstance(dispersion, Constant | Shifted) and name not in known):
        raise UsageError(f"cannot free {name!r}: the layer has no such number; n and k can always be freed")
    if name not in known:
        *first, last = known
        listed = f"{', '.join(first)} and {last}" if first else last
        close = did_you_mean(name, known)
        raise UsageError(f"cannot free {name!r}{close}: the layer has {listed}, and n and k can be added")
    path, leaf = leaves[known[name]]
    free = Free(*bounds) if bounds else free_by_default(locate_parameter(dispersion, path), leaf)
    if free is None:
        raise UsageError(f"cannot free {name!r} without bounds: write {name}=LO:HI")
    replaced = [leaf for _, leaf in leaves]
    replaced[known[name]] = free
    return check_dispersion(jax.tree_util.tree_unflatten(structure, replaced), f"cannot free {name!r}")


def _free_index(
    dispersion: AbstractDispersion, name: str, bounds: tuple[float, float] | None
) -> AbstractDispersion:
    if isinstance(dispersion, Constant):
        n, k = _start(dispersion.n), _start(dispersion.k or 0.0)
        if name == "k":
            return Constant(dispersion.n, _free_k(k, bounds))
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
    return Shifted(shifted.base, _within(bounds, _free_shift(dispersion)), shifted.k)


def _start(number: Parameter) -> float:
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
    least = float(np.nanmin(np.real(dispersion(wavelength)))) if rises else 1.0
    lowest = 1.0 - least if least >= 1 else -0.9 * least
    return Free(max(-0.5, lowest), 0.5, start=0.0, limits=(lowest, 2.0))
