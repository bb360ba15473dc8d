"""Parts of a film and their tables in a recipe, both ways: layers, substrate, instrument, uncertainty.

Media and numbers are read by `pellicle.recipes.media` and written by `pellicle.recipes.written_media`.

A key of a table is the field of its part that has the same name, so that `_part` reads and `_keys` writes
every key; the functions of each part add what differs.
"""

from collections.abc import Iterable, Sequence
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel

from pellicle.errors import UsageError, did_you_mean
from pellicle.recipes import schema
from pellicle.recipes.media import medium, number, scattering_back
from pellicle.recipes.written_media import layer_medium, written_medium, written_number
from pellicle.scene.film import Reference
from pellicle.scene.free import Free
from pellicle.scene.groups import Group, unlisted
from pellicle.scene.instrument import ONE_NUMBER, SLOW_OFFSET, SLOW_SCALE, Drift, Instrument
from pellicle.scene.layers import SCATTERING_BACKS, Interface, Layer, Plate, Substrate
from pellicle.scene.ties import Tied
from pellicle.scene.uncertainty import StandardUncertainties

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
