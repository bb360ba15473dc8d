"""Recipes of films: tables of a TOML file to a scene."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from pellicle.data.cameras import Camera, Sight, sight
from pellicle.data.options import SPACES, FitOptions, Options, ReadingOptions
from pellicle.errors import DataError, UsageError
from pellicle.recipes import parts
from pellicle.recipes.media import FreeTable, PriorTable, medium
from pellicle.recipes.schema import (
    CameraTable,
    DataTable,
    FileTable,
    GridTable,
    InstrumentTable,
    LayerTable,
    PlateTable,
    RecipeTable,
    ReferenceTable,
    SceneTable,
    of_file,
)
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import check_free_count, free_leaves

TABLES: dict[str, type[BaseModel]] = {
    "": RecipeTable,
    "data": DataTable,
    "file": FileTable,
    "wavelengths": GridTable,
    "scene": SceneTable,
    "reference": ReferenceTable,
    "layer": LayerTable,
    "substrate": PlateTable,
    "instrument": InstrumentTable,
    "camera": CameraTable,
    **dict.fromkeys(("thickness", "plate_mm", "back_collected", "thickness_spread", "roughness"), FreeTable),
    **dict.fromkeys(("fraction", "bandwidth", "angle_spread", "numerical_aperture"), FreeTable),
    **dict.fromkeys(("wavelength_shift", "angle_shift"), FreeTable),
    "prior": PriorTable,
}
"""The table under each key of a recipe, for messages that list the known keys."""


@dataclass(frozen=True)
class FilmRecipe:
    """A recipe of a film: its path and its checked tables."""

    path: str
    tables: RecipeTable

    @property
    def files(self) -> list[str]:
        """Data files, relative to the recipe."""
        data = self.tables.data
        names = [*data.files, *(file.path for file in data.file)]
        return [os.path.normpath(Path(self.path).parent / name) for name in names]

    @property
    def each(self) -> list[FilmRecipe]:
        """One recipe for each `[[data.file]]`, with the keys of that table; empty without such tables."""
        return [FilmRecipe(self.path, of_file(self.tables, file)) for file in self.tables.data.file]

    @property
    def camera(self) -> dict[str, Any]:
        """The keys of `[camera]` that the recipe gives, with paths of files."""
        return self.with_paths(self.tables.camera)

    @property
    def reading(self) -> dict[str, Any]:
        """The options of `[data]` and `[camera]` for reading files that the recipe gives."""
        given = self.with_paths(self.tables.data)
        return {name: x for name, x in given.items() if name in ReadingOptions.declared()} | self.camera

    @property
    def options(self) -> dict[str, Any]:
        """The options of reading and fitting that the recipe gives."""
        return self.reading | FitOptions().over(self.tables.data.given()).given()

    def with_files(self, table: FileTable) -> dict[str, Any]:
        """The files that a table of `[[data.file]]` names, from the working folder."""
        files = {name for name, (_, option) in table.declared().items() if option.is_file}
        paths = {name: x for name, x in self.with_paths(table).items() if name in files}
        return paths | ({"camera": camera} if (camera := self.with_paths(table.camera)) else {})

    def with_paths(self, table: Options) -> dict[str, Any]:
        """The options that a table gives, with paths of files from the working folder."""
        declared, folder = table.declared(), Path(self.path).parent
        return {
            name: os.path.normpath(folder / x) if declared[name][1].is_file else x
            for name, x in table.given().items()
        }

    def sight(self) -> Sight:
        """Sensor and coding of the colours by `[camera]`. Raises DataError, the recipe's path in front."""
        names = {field.name for field in fields(Camera)}
        camera = Camera(**{name: value for name, value in self.camera.items() if name in names})
        try:
            return sight(camera, self.tables.data.signal or "srgb")
        except UsageError as error:
            raise DataError(f"{self.path}: camera: {error}".replace("`", "")) from None

    def scene(self) -> Scene:
        """Build the scene. Raises DataError, the recipe's path in front."""
        try:
            return _scene(self.tables, Path(self.path).parent)
        except ValueError as error:
            # without backticks, which the command line would turn into flags
            raise DataError(f"{self.path}: {error}".replace("`", "")) from None
        except RecursionError:
            raise DataError(f"{self.path}: its materials are nested too deeply") from None


def light_signal(signal: str | None, transmitted: bool | None) -> str:
    """Return the signal of the light: "R" or "T" where colours are measured."""
    if signal in SPACES:
        return "T" if transmitted else "R"
    return signal or "R"


def light(given: Any, transmitted: bool | None, azimuth: Any) -> Light:
    """Light by the options `signal`, `angle`, `polarisation` and `transmission` of reading.

    `azimuth` of the sample is in degrees. Raises UsageError.
    """
    several = isinstance(given.angle, list)
    angle = np.array(given.angle) if several else parts.optional(given.angle, "angle") or 0.0
    signal, through = light_signal(given.signal, transmitted), bool(given.transmission and given.signal)
    return Light(None, angle, signal, given.polarisation or "unpolarised", azimuth, through)


def _scene(tables: RecipeTable, folder: Path) -> Scene:
    scene, data = tables.scene, tables.data
    azimuth = np.array(data.azimuth) if isinstance(data.azimuth, list) else data.azimuth
    lit = light(data, tables.camera.transmitted, azimuth)
    built = Scene(
        [parts.layer(layer, folder) for layer in scene.layer],
        parts.substrate(scene.substrate, folder, lit.signal),
        ambient=medium(scene.ambient, folder, "ambient"),
        light=lit,
        instrument=parts.instrument(tables.instrument),
        uncertainty=parts.uncertainty(scene, tables.instrument),
        reference=None if tables.reference is None else parts.reference(tables.reference, folder),
    )
    check_free_count(len(free_leaves(built)), least=0)
    return built
