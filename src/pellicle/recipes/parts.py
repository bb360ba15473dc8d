"""Parts of a film and their tables in a recipe, both ways: layers, substrate, instrument, uncertainty.

A key of a table is the field of its part that has the same name, so that `_part` reads and `_keys` writes
every key; the functions of each part add what differs.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from pellicle.errors import UsageError
from pellicle.recipes import media_words
from pellicle.recipes.media import FreeTable, Medium, Number, medium, number
from pellicle.recipes.schema import InstrumentTable, LayerTable, PlateTable, ReferenceTable, SceneTable
from pellicle.recipes.written_media import layer_medium
from pellicle.recipes.written_media import medium as written_medium
from pellicle.recipes.written_media import number as written_number
from pellicle.scene.film import Reference
from pellicle.scene.free import Free
from pellicle.scene.instrument import ONE_NUMBER, SLOW_OFFSET, SLOW_SCALE, Drift, Instrument
from pellicle.scene.layers import SCATTERING_BACKS, Interface, Layer, Plate, Substrate, Uncertainty

_SIGNED = ("wavelength_shift", "angle_shift")
"""Numbers that may be negative."""
_OF_THE_SCENE = ("index", "dispersion", "roughness", "thickness_spread", "interlayer")
"""Uncertainties that stand in [scene]; the others stand in [instrument]."""


def optional(value: Number | None, name: str) -> float | Free | None:
    """Return a number that may be absent. Raises UsageError as `number` does."""
    return None if value is None else number(value, name, minimum=None if name in _SIGNED else 0.0)


def _part(kind: type, table: BaseModel, **given: Any) -> Any:
    """A part whose fields are the keys of a table, but for those that are `given`."""
    found = {field.name: getattr(table, field.name, None) for field in fields(kind)}
    read = {
        name: optional(x, name) if isinstance(x, float | FreeTable) else x
        for name, x in found.items()
        if x is not None and name not in given
    }
    return kind(**read, **given)


def _keys(part: Any, label: str, leave_out: Iterable[str] = ()) -> dict[str, Any]:
    """Keys of the table of a part, but for fields that have their default or that `leave_out` names."""
    found = {}
    for field in fields(part):
        x, default = getattr(part, field.name), None if field.default is MISSING else field.default
        if field.name in leave_out or x is None or (not isinstance(x, Free) and x == default):
            continue
        found[field.name] = x if isinstance(x, str | int) else written_number(x, f"{label}: {field.name}")
    return found


def layer(table: LayerTable, folder: Path) -> Layer | Interface | Plate:
    """The layer of a table. Raises UsageError."""
    if table.between is not None:
        return _part(Interface, table, mix=table.between)
    stated: Any = table.material  # LayerTable has checked that it is there
    material = media_words.free_numbers(medium(stated, folder), table.free)
    return _part(Layer if table.plate_mm is None else Plate, table, material=material)


def layer_keys(layer: Layer | Interface | Plate, position: int, folder: Path) -> dict[str, Any]:
    """The table of a layer, the inverse of `layer`. Raises UsageError, naming it."""
    label = layer.name or f"layer {position + 1}"
    head = {} if layer.name is None else {"name": layer.name}
    if isinstance(layer, Interface):
        head["between"] = layer.mix
    else:
        head |= layer_medium(layer.material, label, folder)
    keys = _keys(layer, label, ("name", "mix", "material"))
    if isinstance(layer, Plate):
        keys = {"plate_mm": written_number(layer.plate_mm, f"{label}: plate_mm"), **keys}
    return head | keys


def substrate(value: Medium | PlateTable, folder: Path, signal: str) -> Substrate:
    """The substrate of a table or a medium, for light of a signal. Raises UsageError."""
    if not isinstance(value, PlateTable):
        return Substrate(medium(value, folder, "substrate"))
    given: dict[str, Any] = {"material": medium(value.material, folder)}
    if isinstance(value.back, str) and value.back in SCATTERING_BACKS:
        part = optional(value.back_collected, "back_collected"), value.back_reflections
        given["back"], given["back_collected"] = media_words.scattering_back(value.back, signal, part)
    elif value.back is not None:
        given["back"] = medium(value.back, folder, "back")
    return _part(Substrate, value, **given)


def substrate_keys(substrate: Substrate, folder: Path) -> Any:
    """The medium of a substrate or its table, the inverse of `substrate`. Raises UsageError."""
    material = written_medium(substrate.material, "the substrate", folder)
    keys = _keys(substrate, "substrate", ("material", "back"))
    if substrate.back is not None:
        keys = {"back": written_medium(substrate.back, "the medium behind the substrate", folder), **keys}
    return {"material": material, **keys} if keys else material


def reference(table: ReferenceTable, folder: Path) -> Reference:
    """Return the reference of a recipe, whose reflectance is known."""
    layers = [layer(one, folder) for one in table.layer]
    return Reference(substrate(table.substrate, folder, "R"), layers, table.form)


def reference_tables(reference: Reference, folder: Path) -> dict[str, Any]:
    """Return `[reference]` and `[[reference.layer]]`."""
    form = {} if reference.form == "relative" else {"form": reference.form}
    return {
        "reference": {"substrate": substrate_keys(reference.substrate, folder), **form},
        "reference.layer": [layer_keys(one, i, folder) for i, one in enumerate(reference.layers)],
    }


def instrument(table: InstrumentTable) -> Instrument:
    """The instrument of a table. Raises UsageError."""
    return _part(Instrument, table, scale=table.scale, offset=table.offset)


def instrument_keys(instrument: Instrument, uncertainty: Uncertainty) -> dict[str, Any]:
    """The table of an instrument and its uncertainties, the inverse of `instrument`. Raises UsageError."""
    found = {}
    for key, slow in (("scale", SLOW_SCALE), ("offset", SLOW_OFFSET)):
        value = getattr(instrument, key)
        if isinstance(value, Drift):
            if value not in (slow, ONE_NUMBER):
                raise UsageError(f"{key}: a recipe has free and slow, not a drift of degree {value.degree}")
            found[key] = "slow" if value == slow else "free"
    rest = [field.name for field in fields(Uncertainty) if field.name not in _OF_THE_SCENE]
    return found | _keys(instrument, "instrument", found) | _uncertainty_keys(uncertainty, rest)


def uncertainty(scene: SceneTable, instrument: InstrumentTable) -> Uncertainty:
    """The usual uncertainties, or none, with those that a recipe gives in their place."""
    stated = {}
    for name in (field.name for field in fields(Uncertainty)):
        for table in (scene, instrument):
            value = getattr(table, f"{name}_uncertainty", None)
            if value is not None:
                stated[name] = value
    return replace(Uncertainty() if scene.uncertainty == "usual" else Uncertainty.none(), **stated)


def uncertainty_keys(uncertainty: Uncertainty) -> dict[str, Any]:
    """Keys of `[scene]` of the uncertainties, the inverse of `uncertainty` beside `instrument_keys`."""
    none = {} if _base(uncertainty) == Uncertainty() else {"uncertainty": "none"}
    return none | _uncertainty_keys(uncertainty, _OF_THE_SCENE)


def _base(uncertainty: Uncertainty) -> Uncertainty:
    """The usual uncertainties or none, whichever leaves fewer to state."""

    def stated(base: Uncertainty) -> int:
        return sum(getattr(uncertainty, f.name) != getattr(base, f.name) for f in fields(Uncertainty))

    return min((Uncertainty(), Uncertainty.none()), key=stated)


def _uncertainty_keys(uncertainty: Uncertainty, names: Iterable[str]) -> dict[str, Any]:
    """Uncertainties `names` that differ from the usual ones or none."""
    base = _base(uncertainty)
    return {
        f"{name}_uncertainty": float(getattr(uncertainty, name))
        for name in names
        if getattr(uncertainty, name) != getattr(base, name)
    }
