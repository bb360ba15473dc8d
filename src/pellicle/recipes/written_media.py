"""Media and numbers as a recipe gives them, the reverse of `pellicle.recipes.media`."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic, locate_parameter
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant, Shifted
from pellicle.dispersion.oscillators import AbstractOscillator, Oscillators
from pellicle.dispersion.profiles import PROFILES
from pellicle.dispersion.temperature import AtTemperature, ThermoOptic
from pellicle.errors import UsageError
from pellicle.materials import Material, UnknownMaterial, material
from pellicle.materials.formats.detect import file_of
from pellicle.recipes.dispersion_models import KINDS, MODELS, SERIES, SPLINES, fixed_model, free_model
from pellicle.recipes.free_numbers import free_numbers
from pellicle.scene.free import Free, free_leaves, is_free
from pellicle.scene.graded import Graded
from pellicle.scene.priors import HalfNormal, Normal

_NAME: dict[type, str] = {kind: name for table in (MIXTURES, PROFILES, KINDS) for name, kind in table.items()}


def written_number(thing: Any, name: str) -> float | str | dict[str, Any]:
    """Return a number as a float, a `Free` as a table of its bounds, a tied one as its text.

    Raises UsageError for anything else.
    """
    if isinstance(thing, Free) and thing.tie is not None:
        return str(thing.tie.text)
    if isinstance(thing, Free):
        limits = {} if thing.limits is None else {"limits": [*thing.limits]}
        start = {} if thing.start == 0.5 * (thing.lower + thing.upper) else {"value": thing.start}
        varies = {} if thing.varies is None else {"varies": thing.varies}
        ends = {"first": thing.first, "last": thing.last}
        varies |= {
            key: {"mean": x.mean, "sd": x.sd} if isinstance(x, Normal) else x
            for key, x in ends.items()
            if x is not None
        }
        bounds, prior = {**start, "lower": thing.lower, "upper": thing.upper, **limits, **varies}, thing.prior
        if prior is None:
            return bounds
        if isinstance(prior, Normal):
            return bounds | {"prior": {"mean": prior.mean, "sd": prior.sd}}
        return bounds | {
            "prior": {"half_normal": prior.sd} if isinstance(prior, HalfNormal) else {"log_uniform": True}
        }
    if isinstance(thing, bool) or np.ndim(thing) != 0 or not hasattr(thing, "__float__"):
        raise UsageError(f"{name} must be a number or pl.Free(lower, upper) in a recipe, not {thing!r}")
    return float(thing)


def layer_medium(dispersion: AbstractDispersion, name: str, folder: Path) -> dict[str, Any]:
    """Return the keys `material`, and `free` where it needs it, of a layer. Raises as `medium` does."""
    if isinstance(dispersion, Shifted) or _has_default_bounds(dispersion):
        # items of `free`: those of default bounds, and any of a shifted index
        items = []
        for path, free in free_leaves(dispersion):
            key = locate_parameter(dispersion, path).name
            if free.limits is not None:
                items.append(key)
            elif isinstance(dispersion, Shifted):
                items.append(f"{key}={free.lower!r}:{free.upper!r}")
        for base in _without_default_bounds(dispersion):
            with suppress(UsageError):
                if same(free_numbers(base, items), dispersion):
                    return {"material": written_medium(base, name, folder), "free": items}
    return {"material": written_medium(dispersion, name, folder)}


def written_medium(dispersion: Any, name: str, folder: Path) -> Any:
    """Return a medium as a recipe gives it: a name, a path relative to `folder`, a number or a table.

    **Raises:** UsageError for a medium that a recipe cannot express, naming it by `name`.
    """
    if _has_default_bounds(dispersion):
        for model in MODELS:
            if same(free_model(model), dispersion):
                return model
        spline = _NAME.get(type(dispersion))
        if spline in SPLINES and same(fixed_model(spline, dispersion.knots, spline), dispersion):
            return f"{spline}({','.join(repr(x) for x in dispersion.knots)})"
    if isinstance(dispersion, Material):
        # the name of the catalogue, the page, or the path of the file
        if os.path.exists(file_of(dispersion.page)):
            return Path(os.path.relpath(dispersion.page, folder)).as_posix()
        try:
            if same(material(dispersion.name), dispersion):
                return dispersion.name
        except UnknownMaterial:
            pass
        return dispersion.name if dispersion.page == "exactly 1" or dispersion.clear else dispersion.page
    if isinstance(dispersion, Constant):
        return _constant(dispersion, name)
    if (composite := _composite(dispersion, name, folder)) is not None:
        return composite
    kind = type(dispersion)
    if (model := _NAME.get(kind)) in SERIES:
        fields_of = SERIES[model]
        keys = _numbers(dispersion, name, fields_of)
        for i, numbers in enumerate(zip(*(getattr(dispersion, x) for x in fields_of), strict=True), 1):
            numbered = zip(fields_of, numbers, strict=True)
            keys |= {f"{key}{i}": written_number(x, f"{name}: {key}{i}") for key, x in numbered}
        if keys.keys() <= MODELS[model].keys():
            return {"model": model, **keys}
    if isinstance(dispersion, Oscillators):
        eps_inf = {"eps_inf": written_number(dispersion.eps_inf, f"{name}: eps_inf")}
        terms = [{"kind": _NAME[type(term)], **_numbers(term, name)} for term in dispersion.terms]
        if len(terms) != 1:
            return {"model": "oscillators", **eps_inf, "terms": terms}
        return {"model": terms[0].pop("kind"), **eps_inf, **terms[0]}
    if kind in KINDS.values() and model not in SERIES and getattr(dispersion, "k", 0.0) is not None:
        return {"model": _NAME[kind], **_numbers(dispersion, name)}
    raise UsageError(f"{name}: a recipe cannot express a medium of the kind {kind.__name__}")


def _composite(dispersion: Any, name: str, folder: Path) -> dict[str, Any] | None:
    """The table of a medium of other media; None for any other one."""
    if isinstance(dispersion, Anisotropic):
        media = dispersion.arguments
        axis = [written_number(angle, f"{name}: axis") for angle in media.pop("axis")]
        return {key: written_medium(x, name, folder) for key, x in media.items()} | {"axis": axis}
    if isinstance(dispersion, Graded):
        media = [written_medium(each, name, folder) for each in (dispersion.first, dispersion.second)]
        profile = {"profile": _NAME[type(dispersion.profile)], **_numbers(dispersion.profile, name)}
        return {"graded": media, "mix": dispersion.mix, **profile}
    kind = type(dispersion)
    if kind in MIXTURES.values():
        both = {key: written_medium(getattr(dispersion, key), name, folder) for key in ("host", "inclusion")}
        fraction = written_number(dispersion.fraction, f"{name}: fraction")
        return {"mix": _NAME[kind], **both, "fraction": fraction}
    if isinstance(dispersion, ThermoOptic):
        base = {"base": written_medium(dispersion.base, name, folder)}
        return {"model": "thermo-optic", **base, **_numbers(dispersion, name, ("base",))}
    if isinstance(dispersion, AtTemperature):
        media = {"media": [written_medium(x, name, folder) for x in dispersion.media]}
        return {"model": "at-temperature", **media, **_numbers(dispersion, name, ("media",))}
    return None


def same(one: Any, other: Any) -> bool:
    """Return True for pytrees that are equal but for the types of numbers and the form of paths of files."""
    return bool(eqx.tree_equal(_plain(one), _plain(other)) is True)


def _plain(tree: Any) -> Any:
    """The pytree with numbers as floats, constants without a k of 0, and whole paths of materials."""

    def plain(node: Any) -> Any:
        if isinstance(node, Material):
            page = os.path.abspath(node.page) if os.path.exists(file_of(node.page)) else node.page
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


def _constant(dispersion: Constant, name: str) -> Any:
    n, k = dispersion.n, dispersion.k
    if is_free(n) or is_free(k):
        both = {"n": n} if k is None else {"n": n, "k": k}
        return {"model": "constant", **{key: written_number(x, f"{name}: {key}") for key, x in both.items()}}
    n, k = written_number(n, f"{name}: n"), 0.0 if k is None else written_number(k, f"{name}: k")
    return f"{n!r}+{k!r}j" if k else n


def _numbers(
    module: AbstractDispersion | AbstractOscillator | Any, name: str, without: Sequence[str] = ()
) -> dict[str, Any]:
    """The numbers of a module by its fields, lists of one for each knot included."""
    given = {field.name: getattr(module, field.name) for field in fields(module) if field.name not in without}
    return {
        key: [written_number(one, f"{name}: {key}") for one in x]
        if isinstance(x, tuple)
        else written_number(x, f"{name}: {key}")
        for key, x in given.items()
        if x is not None
    }


def _has_default_bounds(dispersion: Any) -> bool:
    return any(free.limits is not None for _, free in free_leaves(dispersion))


def _without_default_bounds(dispersion: AbstractDispersion) -> Sequence[AbstractDispersion]:
    """Media of which `free` may have made this one."""
    if isinstance(dispersion, Shifted):
        return [dispersion.base]
    leaves, structure = jax.tree_util.tree_flatten(dispersion, is_leaf=is_free)
    fixed = [x.start if is_free(x) and x.limits is not None else x for x in leaves]
    made = jax.tree_util.tree_unflatten(structure, fixed)
    return [made, Constant(made.n)] if isinstance(made, Constant) else [made]
