"""Samples of a recipe: the tables and the scene of each, with what is not as in `[scene]`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
from pydantic import TypeAdapter, ValidationError

from pellicle.errors import UsageError, did_you_mean
from pellicle.recipes import schema
from pellicle.recipes.media import number
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, is_free
from pellicle.scene.names import aliases_of, location_of
from pellicle.scene.samples import Sample
from pellicle.scene.ties import Tied, bound

_NUMBER: TypeAdapter[Any] = TypeAdapter(schema.Number)
_MEDIUM_KEYS = ("material", "free")


def scene_table(scene: schema.SceneTable, sample: schema.SampleTable) -> schema.SceneTable:
    """The table of the scene of one sample. Raises UsageError for a layer that it cannot have."""
    layers, names = [*scene.layer], [one.name for one in scene.layer]
    known = [name for name in names if name]
    for name in [*sample.without, *(x.after for x in sample.layer if isinstance(x.after, str))]:
        if name not in names:
            raise UsageError(
                f"sample {sample.name}: no layer of the scene is named {name!r}{did_you_mean(name, known)}"
            )
    for own in sample.layer:
        given = {key: getattr(own, key) for key in own.model_fields_set if key != "after"}
        if own.name in names:
            base = scene.layer[names.index(own.name)]
            given = {key: getattr(base, key) for key in base.model_fields_set} | given
            at = next(i for i, one in enumerate(layers) if one.name == own.name)
            layers[at] = _layer(given, sample)
            continue
        place = len(layers) if own.after is None else own.after
        if isinstance(place, str):
            place = 1 + next(i for i, one in enumerate(layers) if one.name == place)
        if not 0 <= place <= len(layers):
            above = f"{place} layers cannot lie above it: there are {len(layers)}"
            raise UsageError(f"sample {sample.name}: layer {own.name}: after: {above}")
        layers.insert(place, _layer(given, sample))
    given = {"layer": [one for one in layers if one.name not in sample.without]}
    given |= {key: x for key in ("substrate", "ambient") if (x := getattr(sample, key)) is not None}
    return scene.model_copy(update=given)


def _layer(given: Mapping[str, Any], sample: schema.SampleTable) -> schema.LayerTable:
    try:
        return schema.LayerTable(**given)
    except ValidationError as error:
        [first, *_] = error.errors(include_url=False)
        words = str(first.get("ctx", {}).get("error", first["msg"]))
        raise UsageError(f"sample {sample.name}: layer {given.get('name')}: {words}") from None


def _numbers(given: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Numbers of further keys by their names, those of tables in tables included."""
    for key, value in given.items():
        if isinstance(value, dict) and not value.keys() & schema.FreeTable.model_fields.keys():
            yield from _numbers(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def of_sample(scene: Scene, sample: schema.SampleTable, also: Sequence[str] = ()) -> Scene:
    """The scene of a sample with its own numbers, and the names of those that it has of `[scene]`, and of
    numbers of light and instrument that it `also` shares.

    Raises UsageError for an unknown name.
    """
    numbers = dict(_numbers(sample.model_extra or {}))
    leaf = lambda x: is_free(x) or type(x) is Tied  # noqa: E731
    pairs, structure = jax.tree_util.tree_flatten_with_path(scene, is_leaf=leaf)
    known, leaves = {}, [x for _, x in pairs]
    for i, (path, x) in enumerate(pairs):
        if path[0].name in ("layers", "substrate", "ambient") and (leaf(x) or isinstance(x, int | float)):
            known |= dict.fromkeys(aliases_of(scene, path, location_of(scene, path).name), i)
    for name, value in numbers.items():
        if name not in known:
            near = did_you_mean(name, [*known, *schema.SampleTable.model_fields])
            raise UsageError(f"sample {sample.name}: {name!r} is no key and no number of the scene{near}")
        try:
            leaves[known[name]] = number(_NUMBER.validate_python(value), name)
        except ValidationError:
            raise UsageError(f"sample {sample.name}: {name}: a number was expected, not {value!r}") from None
    changed = bound(jax.tree_util.tree_unflatten(structure, leaves), again=True)
    free = (
        (path, aliases_of(changed, path, location_of(changed, path).name)) for path, _ in free_leaves(changed)
    )
    shared = [
        aliases[-1]
        for path, aliases in free
        if aliases[-1] in also or not (_own(changed, path, sample) or numbers.keys() & {*aliases})
    ]
    return replace(changed, sample=Sample(sample.name, tuple(shared)))


def _own(scene: Scene, path: tuple, sample: schema.SampleTable) -> bool:
    """True for a free number that the tables of the sample give, and for those of light and instrument."""
    part = path[0].name
    if part != "layers":
        return part in ("light", "instrument") or getattr(sample, part, None) is not None
    table = next((x for x in sample.layer if x.name == scene.layers[path[1].idx].name), None)
    if table is None:
        return False
    return path[2].name in table.model_fields_set or (
        path[2].name in _MEDIUM_KEYS and bool(table.model_fields_set & {*_MEDIUM_KEYS})
    )
