"""Media and numbers as a recipe writes them: the inverse of `pellicle.recipes.media`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant, Sellmeier, Shifted
from pellicle.dispersion.oscillators import AbstractOscillator, Oscillators
from pellicle.dispersion.parameter_names import locate_parameter
from pellicle.dispersion.profiles import PROFILES
from pellicle.errors import UsageError
from pellicle.materials import Material, UnknownMaterial, material
from pellicle.recipes.dispersion_models import KINDS, MODELS, SPLINES, TERMS, fixed_model, free_model
from pellicle.recipes.media import BIAXIAL, UNIAXIAL
from pellicle.recipes.media_words import free_numbers
from pellicle.scene.free import Free, free_leaves, is_free
from pellicle.scene.graded import Graded
from pellicle.scene.priors import HalfNormal, Normal

_MIX = {kind: name for name, kind in MIXTURES.items()}
_PROFILE = {kind: name for name, kind in PROFILES.items()}
_TERM = {kind: name for name, (kind, _) in TERMS.items()}
_MODEL: dict[type, str] = {kind: name for name, kind in KINDS.items()}


def number(thing: Any, name: str) -> float | dict[str, Any]:
    """Return a number as a float, a `Free` as a table of its bounds. Raises UsageError for anything else."""
    if isinstance(thing, Free):
        limits = {} if thing.limits is None else {"limits": [*thing.limits]}
        start = {} if thing.start == 0.5 * (thing.lower + thing.upper) else {"value": thing.start}
        return {**start, "lower": thing.lower, "upper": thing.upper, **limits, **_prior(thing)}
    if isinstance(thing, bool) or np.ndim(thing) != 0 or not hasattr(thing, "__float__"):
        raise UsageError(f"{name} must be a number or pl.Free(lower, upper) in a recipe, not {thing!r}")
    return float(thing)


def _prior(free: Free) -> dict[str, Any]:
    if free.prior is None:
        return {}
    if isinstance(free.prior, Normal):
        return {"prior": {"mean": free.prior.mean, "sd": free.prior.sd}}
    if isinstance(free.prior, HalfNormal):
        return {"prior": {"half_normal": free.prior.sd}}
    return {"prior": {"log_uniform": True}}


def layer_medium(dispersion: AbstractDispersion, name: str, folder: Path) -> dict[str, Any]:
    """Return the keys `material`, and `free` where it needs it, of a layer. Raises as `medium` does."""
    if isinstance(dispersion, Shifted) or _has_default_bounds(dispersion):
        for base in _without_default_bounds(dispersion):
            items = _freed(dispersion)
            try:
                again = same(free_numbers(base, items), dispersion)
            except UsageError:
                continue
            if again:
                return {"material": medium(base, name, folder), "free": items}
    return {"material": medium(dispersion, name, folder)}


def medium(dispersion: Any, name: str, folder: Path) -> Any:
    """Return a medium as a recipe gives it: a name, a path relative to `folder`, a number or a table.

    **Raises:** UsageError for a medium that a recipe cannot express, naming it by `name`.
    """
    for kind in _words(dispersion):
        return kind
    if isinstance(dispersion, Material):
        return _material(dispersion, folder)
    if isinstance(dispersion, Constant):
        return _constant(dispersion, name)
    if isinstance(dispersion, Anisotropic):
        return _anisotropic(dispersion, name, folder)
    if isinstance(dispersion, Graded):
        media = [medium(each, name, folder) for each in (dispersion.first, dispersion.second)]
        profile = {"profile": _PROFILE[type(dispersion.profile)], **_numbers(dispersion.profile, name)}
        return {"graded": media, "mix": dispersion.mix, **profile}
    kind = type(dispersion)
    if kind in _MIX:
        both = {key: medium(getattr(dispersion, key), name, folder) for key in ("host", "inclusion")}
        return {"mix": _MIX[kind], **both, "fraction": number(dispersion.fraction, f"{name}: fraction")}
    if isinstance(dispersion, Sellmeier) and len(dispersion.B) <= 3:
        pairs = zip(dispersion.B, dispersion.C, strict=True)
        each = {f"{key}{i}": x for i, pair in enumerate(pairs, 1) for key, x in zip("BC", pair, strict=True)}
        return {"model": "sellmeier", **{key: number(x, f"{name}: {key}") for key, x in each.items()}}
    if isinstance(dispersion, Oscillators):
        return _oscillators(dispersion, name)
    if kind in _MODEL and kind is not Sellmeier and getattr(dispersion, "k", 0.0) is not None:
        return {"model": _MODEL[kind], **_numbers(dispersion, name)}
    raise UsageError(f"{name}: a recipe cannot express a medium of the kind {kind.__name__}")


def same(one: Any, other: Any) -> bool:
    """Return True for pytrees that are equal but for the types of numbers and the form of paths of files."""
    return bool(eqx.tree_equal(_plain(one), _plain(other)) is True)


def _plain(tree: Any) -> Any:
    """The pytree with numbers as floats, constants without a k of 0, and whole paths of materials."""

    def plain(node: Any) -> Any:
        if isinstance(node, Material):
            page = os.path.abspath(node.page) if os.path.exists(node.page) else node.page
            return page, node.clear, node.dispersion
        if isinstance(node, Constant):
            k = node.k
            return Constant(plain(node.n), None if isinstance(k, int | float) and k == 0 else plain(k))
        if isinstance(node, str | bool) or is_free(node) or node is None:
            return node
        return float(node) if np.ndim(node) == 0 else np.asarray(node)

    def stop(node: Any) -> bool:
        return isinstance(node, Material | Constant) or is_free(node)

    return jax.tree_util.tree_map(plain, tree, is_leaf=stop)


def _material(dispersion: Material, folder: Path) -> str:
    """The name of the catalogue, the page, or the path of the file."""
    if os.path.exists(dispersion.page):
        return Path(os.path.relpath(dispersion.page, folder)).as_posix()
    try:
        if same(material(dispersion.name), dispersion):
            return dispersion.name
    except UnknownMaterial:
        pass
    return dispersion.name if dispersion.page == "exactly 1" or dispersion.clear else dispersion.page


def _constant(dispersion: Constant, name: str) -> Any:
    n, k = dispersion.n, dispersion.k
    if is_free(n) or is_free(k):
        both = {"n": n} if k is None else {"n": n, "k": k}
        return {"model": "constant", **{key: number(x, f"{name}: {key}") for key, x in both.items()}}
    n, k = number(n, f"{name}: n"), 0.0 if k is None else number(k, f"{name}: k")
    return f"{n!r}+{k!r}j" if k else n


def _anisotropic(dispersion: Anisotropic, name: str, folder: Path) -> dict[str, Any]:
    one = dispersion.is_uniaxial
    keys = zip("xz" if one else "xyz", UNIAXIAL if one else BIAXIAL, strict=True)
    media = {key: medium(getattr(dispersion, field), name, folder) for field, key in keys}
    angles = [dispersion.theta, dispersion.phi, *([] if one else [dispersion.psi])]
    return {**media, "axis": [number(angle, f"{name}: axis") for angle in angles]}


def _oscillators(dispersion: Oscillators, name: str) -> dict[str, Any]:
    eps_inf = {"eps_inf": number(dispersion.eps_inf, f"{name}: eps_inf")}
    terms = [{"kind": _TERM[type(term)], **_numbers(term, name)} for term in dispersion.terms]
    if len(terms) != 1:
        return {"model": "oscillators", **eps_inf, "terms": terms}
    return {"model": terms[0].pop("kind"), **eps_inf, **terms[0]}


def _numbers(module: AbstractDispersion | AbstractOscillator | Any, name: str) -> dict[str, Any]:
    """The numbers of a module by its fields, lists of one for each knot included."""
    found = {}
    for field in fields(module):
        x, label = getattr(module, field.name), f"{name}: {field.name}"
        if x is not None:
            several = isinstance(x, tuple)
            found[field.name] = [number(each, label) for each in x] if several else number(x, label)
    return found


def _words(dispersion: Any) -> Iterable[str]:
    """The word that leaves a model's parameters free within their default bounds."""
    if not _has_default_bounds(dispersion):
        return
    for model in MODELS:
        if same(free_model(model), dispersion):
            yield model
    kind = _MODEL.get(type(dispersion))
    if kind in SPLINES and same(fixed_model(kind, dispersion.knots, kind), dispersion):
        yield f"{kind}({','.join(repr(x) for x in dispersion.knots)})"


def _has_default_bounds(dispersion: Any) -> bool:
    return any(free.limits is not None for _, free in free_leaves(dispersion))


def _freed(dispersion: AbstractDispersion) -> list[str]:
    """Items of `free` for a layer: those of default bounds, and any of a shifted index."""
    items = []
    for path, free in free_leaves(dispersion):
        name = locate_parameter(dispersion, path).name
        if free.limits is not None:
            items.append(name)
        elif isinstance(dispersion, Shifted):
            items.append(f"{name}={free.lower!r}:{free.upper!r}")
    return items


def _without_default_bounds(dispersion: AbstractDispersion) -> Sequence[AbstractDispersion]:
    """Media of which `free` may have made this one."""
    if isinstance(dispersion, Shifted):
        return [dispersion.base]
    leaves, structure = jax.tree_util.tree_flatten(dispersion, is_leaf=is_free)
    fixed = [x.start if is_free(x) and x.limits is not None else x for x in leaves]
    made = jax.tree_util.tree_unflatten(structure, fixed)
    return [made, Constant(made.n)] if isinstance(made, Constant) else [made]
