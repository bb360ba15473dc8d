"""Recipes: a TOML file that says what is there, how it was looked at and what to fit."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from pellicle.errors import DataError
from pellicle.recipes import media_words
from pellicle.recipes.media import FreeTable, Medium, Number, PriorTable, medium, number
from pellicle.recipes.media_words import nearest
from pellicle.recipes.schema import (
    DataTable,
    FileTable,
    GridTable,
    InstrumentTable,
    LayerTable,
    PlateTable,
    RecipeTable,
    SceneTable,
    of_file,
)
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import Free
from pellicle.scene.instrument import Instrument
from pellicle.scene.layers import Interface, Layer, Plate, Substrate


class Recipe(BaseModel):
    """A recipe that was read: its tables and where it lies."""

    path: str
    tables: RecipeTable

    @property
    def files(self) -> list[str]:
        """Data files, relative to the recipe."""
        data = self.tables.data
        names = [*data.files, *(file.path for file in data.file)]
        return [os.path.normpath(Path(self.path).parent / name) for name in names]

    @property
    def each(self) -> list[Recipe]:
        """The recipe as each `[[data.file]]` changes it, none where there are no such tables."""
        return [Recipe(path=self.path, tables=of_file(self.tables, file)) for file in self.tables.data.file]

    def scene(self) -> Scene:
        """The scene it describes. Raises DataError with the recipe's name in front."""
        try:
            return _scene(self.tables, Path(self.path).parent)
        except ValueError as error:
            raise DataError(f"{self.path}: {error}") from None


def read_recipe(path: str | os.PathLike[str]) -> Recipe:
    """Read and check a recipe. Raises DataError: which key, what was expected, the nearest known one."""
    name = str(path)
    try:
        raw = Path(path).read_bytes()
    except IsADirectoryError:
        raise DataError(f"{name}: is a folder; give the recipe's TOML file") from None
    except OSError as error:
        raise DataError(f"{name}: cannot be read ({error.strerror}); check the recipe's path") from None
    try:
        loaded = tomllib.loads(raw.decode("utf-8"))
    except UnicodeDecodeError:
        raise DataError(f"{name}: is no text, and a recipe is a TOML file; data go before --recipe") from None
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{name}: is not TOML, as a recipe must be: {error}") from None
    try:
        return Recipe(path=name, tables=RecipeTable.model_validate(loaded))
    except ValidationError as error:
        raise DataError(f"{name}: {_first(error)}") from None


_KEYS: dict[str, type[BaseModel]] = {
    "": RecipeTable,
    "data": DataTable,
    "file": FileTable,
    "wavelengths": GridTable,
    "scene": SceneTable,
    "layer": LayerTable,
    "substrate": PlateTable,
    "instrument": InstrumentTable,
    "thickness": FreeTable,
    "plate_mm": FreeTable,
    "bandwidth": FreeTable,
    "thickness_spread": FreeTable,
    "roughness": FreeTable,
    "angle_spread": FreeTable,
    "numerical_aperture": FreeTable,
    "wavelength_shift": FreeTable,
    "prior": PriorTable,
}


def _first(error: ValidationError) -> str:
    """The most telling error in one sentence: an unknown key or an infinity before what unions made of it."""
    found = error.errors(include_url=False)
    telling = (e for kind in ("extra_forbidden", "finite_number") for e in found if e["type"] == kind)
    chosen = next(telling, found[0])
    # unions put the name of the branch they tried into the location
    branches = ("str", "float", "list[float]")
    where = [str(part) for part in chosen["loc"] if not str(part)[:1].isupper() and part not in branches]
    key = ".".join(where)
    if chosen["type"] == "extra_forbidden":
        owner = next((part for part in reversed(where[:-1]) if not part.isdigit()), "")
        known = list(_KEYS.get(owner, RecipeTable).model_fields)
        return f"unknown key {key!r}{nearest(where[-1], known)}; known here: {', '.join(known)}"
    if chosen["type"] == "missing":
        return f"{key} is missing"
    if chosen["type"] == "value_error":
        return f"{key}: {chosen.get('ctx', {}).get('error', chosen['msg'])}"
    return f"{key}: {chosen['msg'][0].lower()}{chosen['msg'][1:]}, got {chosen['input']!r}"


def _scene(tables: RecipeTable, folder: Path) -> Scene:
    scene, data = tables.scene, tables.data
    layers = [_layer(layer, folder) for layer in scene.layer]
    instrument = tables.instrument
    return Scene(
        layers,
        _substrate(scene.substrate, folder),
        ambient=medium(scene.ambient, folder),
        light=Light(
            None, optional(data.angle, "angle") or 0.0, data.signal or "R", data.polarisation or "unpolarised"
        ),
        instrument=Instrument(
            instrument.scale,
            instrument.offset,
            optional(instrument.bandwidth, "bandwidth"),
            optional(instrument.thickness_spread, "thickness_spread"),
            optional(instrument.angle_spread, "angle_spread"),
            optional(instrument.numerical_aperture, "numerical_aperture"),
            optional(instrument.wavelength_shift, "wavelength_shift", natural=None),
        ),
    )


def _layer(given: LayerTable, folder: Path) -> Layer | Interface | Plate:
    thickness: Any = optional(given.thickness, "thickness")
    stated: Any = given.material  # the table has seen to it that what a kind needs is there
    if given.between is not None:
        return Interface(thickness, 1 if given.steps is None else given.steps, given.between, given.name)
    material = media_words.freed(medium(stated, folder), given.free)
    if given.plate_mm is not None:
        return Plate(material, number(given.plate_mm, "plate_mm", natural=0.0), given.name)
    spread = optional(given.thickness_spread, "thickness_spread")
    return Layer(material, thickness, given.name, spread, optional(given.roughness, "roughness"))


def _substrate(given: Medium | PlateTable, folder: Path) -> Substrate:
    if not isinstance(given, PlateTable):
        return Substrate(medium(given, folder))
    back = None if given.back is None else medium(given.back, folder)
    plate_mm = number(given.plate_mm, "plate_mm", natural=0.0)
    return Substrate(medium(given.material, folder), back, plate_mm, optional(given.roughness, "roughness"))


def optional(given: Number | None, what: str, natural: float | None = 0.0) -> float | Free | None:
    """A number that may be absent."""
    return None if given is None else number(given, what, natural=natural)
