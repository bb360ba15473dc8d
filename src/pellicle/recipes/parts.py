"""Parts of a film and their tables in a recipe, both ways: layers, substrate, instrument, uncertainty.

Media and numbers are read by `pellicle.recipes.media` and written here.

A key of a table is the field of its part that has the same name, so that `_part` reads and `_keys` writes
every key; the functions of each part add what differs.
"""

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any, TypeVar, get_args

import equinox as eqx
import jax
import numpy as np
from pydantic import BaseModel

from pellicle.dispersion.anisotropic import Anisotropic, locate_parameter
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant, Shifted
from pellicle.dispersion.oscillators import AbstractOscillator, Oscillators
from pellicle.dispersion.profiles import PROFILES
from pellicle.dispersion.temperature import AtTemperature, ThermoOptic
from pellicle.errors import UsageError, did_you_mean
from pellicle.materials import Material, UnknownMaterial, material
from pellicle.materials.formats.detect import file_of
from pellicle.recipes import schema
from pellicle.recipes.dispersion_models import KINDS, MODELS, SERIES, SPLINES, fixed_model, free_model
from pellicle.recipes.free_numbers import free_numbers
from pellicle.recipes.media import medium, number, scattering_back
from pellicle.scene.film import Reference
from pellicle.scene.free import Free, free_leaves, is_free
from pellicle.scene.graded import Graded
from pellicle.scene.groups import Group, unlisted
from pellicle.scene.instrument import ONE_NUMBER, SLOW_OFFSET, SLOW_SCALE, Drift, Instrument
from pellicle.scene.layers import SCATTERING_BACKS, Interface, Layer, Plate, Substrate
from pellicle.scene.priors import HalfNormal, Normal
from pellicle.scene.ties import Tied
from pellicle.scene.uncertainty import StandardUncertainties

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


_SIGNED = ("wavelength_shift", "angle_shift", "drift")
"""Numbers that may be negative."""


def optional(value: schema.Number | None, name: str) -> float | Free | Tied | None:
    """Return a number that may be absent. Raises UsageError as `number` does."""
    return None if value is None else number(value, name, minimum=None if name in _SIGNED else 0.0)


def _part(kind: type, table: BaseModel, **given: Any) -> Any:
    """A part whose fields are the keys of a table, but for those that are `given`."""
    values = {field.name: getattr(table, field.name, None) for field in fields(kind)}
    annotations = {name: field.annotation for name, field in type(table).model_fields.items()}
    numeric = {name for name, kinds in annotations.items() if schema.FreeTable in get_args(kinds)}
    read = {
        name: optional(x, name) if name in numeric else x
        for name, x in values.items()
        if x is not None and name not in given
    }
    return kind(**read, **given)


def _keys(part: Any, label: str, leave_out: Iterable[str] = ()) -> dict[str, Any]:
    """Keys of the table of a part, but for fields that have their default or that `leave_out` names."""
    keys = {}
    for field in fields(part):
        x, default = getattr(part, field.name), None if field.default is MISSING else field.default
        if field.name in leave_out or x is None or (not isinstance(x, Free) and x == default):
            continue
        keys[field.name] = x if isinstance(x, str | int) else written_number(x, f"{label}: {field.name}")
    return keys


def layer(table: schema.LayerTable, folder: Path) -> Layer | Interface | Plate:
    """The layer of a table. Raises UsageError."""
    if table.between is not None:
        return _part(Interface, table, mix=table.between)
    stated: Any = table.material  # LayerTable has checked that it is there
    material = medium(stated, table.free, "material", folder)
    return _part(Layer if table.plate_mm is None else Plate, table, material=material)


def layers(table: schema.SceneTable | schema.ReferenceTable, folder: Path) -> list[Any]:
    """The layers and groups of a table, from the ambient down. Raises UsageError."""
    names, every = [one.name for one in table.layer], [layer(one, folder) for one in table.layer]
    below: list[list[Group]] = [[] for _ in range(len(every) + 1)]
    for group in table.group:
        place = len(every) if group.after is None else group.after
        if isinstance(place, str):
            if place not in names:
                known = [name for name in names if name]
                raise UsageError(
                    f"group: after: no layer is named {place!r}{did_you_mean(place, known)}; give the name of"
                    " a layer, or the number of layers above the group"
                )
            place = names.index(place) + 1
        if not 0 <= place <= len(every):
            raise UsageError(f"group: after: {place} layers cannot lie above it: there are {len(every)}")
        below[place].append(Group([layer(one, folder) for one in group.layer], group.repeat))
    return [*below[0], *(x for one, groups in zip(every, below[1:], strict=True) for x in (one, *groups))]


def layer_tables(layers: Sequence[Layer | Interface | Plate], owner: str, folder: Path) -> dict[str, Any]:
    """The tables `layer` and `group` of an owner, the inverse of `layers`. Raises UsageError."""
    single: list[dict[str, Any]] = []
    groups: list[dict[str, Any]] = []
    position = 0
    for item in unlisted(layers):
        if not isinstance(item, Group):
            single.append(layer_keys(item, position, folder))
            position += 1
            continue
        own = [layer_keys(x, position + i, folder) for i, x in enumerate(item.layers)]
        groups.append({"repeat": item.repeat, "after": len(single), "layer": own})
        position += len(own)
    groups = [{k: x for k, x in g.items() if k != "after" or x < len(single)} for g in groups]
    return {f"{owner}.layer": single, f"{owner}.group": groups}


def layer_keys(layer: Layer | Interface | Plate, position: int, folder: Path) -> dict[str, Any]:
    """The table of a layer, the inverse of `layer`. Raises UsageError, naming it."""
    label = layer.name or f"layer {position + 1}"
    head = {} if layer.name is None else {"name": layer.name}
    if isinstance(layer, Interface):
        head["between"] = layer.mix
    else:
        head |= layer_medium(layer.material, label, folder)
    keys = _keys(layer, label, ("name", "mix", "material", "group"))
    if isinstance(layer, Plate):
        keys = {"plate_mm": written_number(layer.plate_mm, f"{label}: plate_mm"), **keys}
    return head | keys


def substrate(value: schema.Medium | schema.PlateTable, folder: Path, signal: str) -> Substrate:
    """The substrate of a table or a medium, for light of a signal. Raises UsageError."""
    if not isinstance(value, schema.PlateTable):
        return Substrate(medium(value, name="substrate", folder=folder))
    given: dict[str, Any] = {"material": medium(value.material, name="material", folder=folder)}
    if isinstance(value.back, str) and value.back in SCATTERING_BACKS:
        part: Any = optional(value.back_collected, "back_collected"), value.back_reflections
        given["back"], given["back_collected"] = scattering_back(value.back, signal, part)
    elif value.back is not None:
        given["back"] = medium(value.back, name="back", folder=folder)
    return _part(Substrate, value, **given)


def substrate_keys(substrate: Substrate, folder: Path) -> Any:
    """The medium of a substrate or its table, the inverse of `substrate`. Raises UsageError."""
    material = written_medium(substrate.material, "the substrate", folder)
    keys = _keys(substrate, "substrate", ("material", "back"))
    if substrate.back is not None:
        keys = {"back": written_medium(substrate.back, "the medium behind the substrate", folder), **keys}
    return {"material": material, **keys} if keys else material


def reference(table: schema.ReferenceTable, folder: Path) -> Reference:
    """Return the reference of a recipe, whose reflectance is known."""
    return Reference(substrate(table.substrate, folder, "R"), layers(table, folder), table.form)


def reference_tables(reference: Reference, folder: Path) -> dict[str, Any]:
    """Return `[reference]` and `[[reference.layer]]`."""
    form = {} if reference.form == "relative" else {"form": reference.form}
    return {
        "reference": {"substrate": substrate_keys(reference.substrate, folder), **form},
        **layer_tables(reference.layers, "reference", folder),
    }


def instrument(table: schema.InstrumentTable) -> Instrument:
    """The instrument of a table. Raises UsageError."""
    levels = [vars(x) if isinstance(x, schema.LevelTable) else x for x in (table.scale, table.offset)]
    return _part(Instrument, table, scale=levels[0], offset=levels[1])


def instrument_keys(instrument: Instrument) -> dict[str, Any]:
    """The table of an instrument, the inverse of `instrument`. Raises UsageError."""
    keys = {}
    for key, slow in (("scale", SLOW_SCALE), ("offset", SLOW_OFFSET)):
        value = getattr(instrument, key)
        if isinstance(value, Drift):
            varies = {"varies": value.varies}, Drift(varies=value.varies)
            known = ("free", ONE_NUMBER), ("slow", slow), varies
            if not (words := [word for word, drift in known if value == drift]):
                raise UsageError(f"{key}: a recipe has free and slow, not a drift of degree {value.degree}")
            keys[key] = words[0]
    return keys | _keys(instrument, "instrument", keys)


Stated = TypeVar("Stated", bound=StandardUncertainties)


def uncertainty(kind: type[Stated], scene: Any, *others: Any) -> Stated:
    """The usual uncertainties of a kind, or none, by the word of the table `scene`, with those that this and
    other tables give in their place."""
    stated = {
        field.name: value
        for field in fields(kind)
        for table in (scene, *others)
        if (value := getattr(table, f"{field.name}_uncertainty", None)) is not None
    }
    return replace(kind() if scene.uncertainty == "usual" else kind.none(), **stated)


def uncertainty_keys(uncertainty: StandardUncertainties) -> dict[str, Any]:
    """Keys of a recipe, the inverse of `uncertainty`: those that differ from the usual uncertainties or from
    none, whichever are fewer."""
    kind = type(uncertainty)

    def stated(base: StandardUncertainties) -> dict[str, Any]:
        return {name: float(x) for name, x in vars(uncertainty).items() if x != getattr(base, name)}

    usual, none = stated(kind()), stated(kind.none())
    fewest = usual if len(usual) <= len(none) else none
    word = {} if fewest is usual else {"uncertainty": "none"}
    return word | {f"{name}_uncertainty": x for name, x in fewest.items()}
