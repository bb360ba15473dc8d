"""Reading recipes: TOML files that describe a film, or a surface by its BRDF."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, TypeAdapter, ValidationError

from pellicle.colour.observers import Sensor
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.cameras import Camera, Sight, band_sensor, sight
from pellicle.data.options import SPACES, FitOptions, Options, ReadingOptions
from pellicle.data.read_brdf import read_brdf_samples
from pellicle.errors import DataError, UsageError
from pellicle.materials.formats import complete_ease as complete_ease_text
from pellicle.materials.formats import regress_pro as regress_pro_text
from pellicle.recipes import complete_ease, parts, regress_pro, schema
from pellicle.recipes.media import medium, number
from pellicle.recipes.messages import first_error, remedy
from pellicle.recipes.samples import of_sample, scene_table
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import check_free_count, free_leaves
from pellicle.scene.surface import Surface, SurfaceUncertainty
from pellicle.scene.uncertainty import Uncertainty


def read_recipe(path: str | os.PathLike[str]) -> FilmRecipe | SurfaceRecipe:
    """Read and check a recipe: TOML, a model of CompleteEASE (`.mod`, `.SEsnap`), or of Regress Pro (`.rcp`).

    **Arguments:** `path` of the recipe. Data files and tables of n and k that it names are relative to it.

    **Returns:** a `FilmRecipe`, or a `SurfaceRecipe` where the recipe has `[scene.surface]` or the signal
    "brdf". Both have `path`, `files` and `scene()`, which builds the `Scene` or the `Surface`.

    **Raises:** DataError in one sentence: which key, what was expected, the nearest known key; or which layer
    of another program's model a scene cannot express.
    """
    content = b""
    try:
        content = Path(path).read_bytes()
        loaded = _of_other_program(content, Path(path)) or tomllib.loads(content.decode("utf-8-sig"))
        return checked(loaded, str(path))
    except IsADirectoryError:
        raise DataError(f"{path}: is a folder; give the recipe's TOML file") from None
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); check the recipe's path") from None
    except UnicodeDecodeError:
        raise DataError(
            f"{path}: is not UTF-8 text, and a recipe is a TOML file; data files are arguments of their own"
        ) from None
    except tomllib.TOMLDecodeError as error:
        known = remedy(content.decode("utf-8-sig"), error)
        if not known and not re.search(rb"[=\[]", content[:4096]):
            known = "is a table, and a recipe is a TOML file; data files are arguments of their own"
        raise DataError(f"{path}: {known or f'is not TOML, as a recipe must be: {error}'}") from None
    except RecursionError:
        raise DataError(f"{path}: is not a recipe: its brackets are nested too deeply") from None
    except ValueError as error:
        raise DataError(f"{path}: {error}") from None


def _of_other_program(content: bytes, path: Path) -> dict[str, Any] | None:
    """The tables of a model of another program; None for a recipe in TOML."""
    if (model := complete_ease_text.model(content)) is not None:
        return complete_ease.tables(model, path.name)
    if (words := regress_pro_text.words(content)) is not None:
        return regress_pro.tables(words, path.name)
    return None


def checked(loaded: dict[str, Any], path: str) -> FilmRecipe | SurfaceRecipe:
    """Return the recipe of parsed tables. Raises UsageError for the first wrong key, in one sentence."""
    data, scene = loaded.get("data"), loaded.get("scene")
    by_signal = isinstance(data, dict) and data.get("signal") == "brdf"
    if by_signal or (isinstance(scene, dict) and "surface" in scene):
        return SurfaceRecipe(path, _validated(loaded, schema.SurfaceRecipeTable))
    return FilmRecipe(path, _validated(loaded, schema.RecipeTable))


def _validated(loaded: dict[str, Any], table: type[BaseModel]) -> Any:
    """Check a parsed recipe. Raises UsageError: which key, what was expected, the nearest known one."""
    try:
        return table.model_validate(loaded)
    except ValidationError as error:
        raise UsageError(first_error(error, table)) from None


@contextmanager
def _of_recipe(path: str, kind: type[ValueError] = UsageError, part: str = "") -> Iterator[None]:
    """Turn errors of this kind about the content of a recipe into DataErrors, its path in front."""
    try:
        yield
    except kind as error:
        # without backticks, which the command line would turn into flags
        raise DataError(f"{path}: {part}{error}".replace("`", "")) from None
    except RecursionError:
        what = "base is" if part else "materials are"
        raise DataError(f"{path}: {part}its {what} nested too deeply") from None


@dataclass(frozen=True)
class FilmRecipe:
    """A recipe of a film: its path and its checked tables."""

    path: str
    tables: schema.RecipeTable
    sample: schema.SampleTable | None = None
    """Of which of several samples it is."""

    @property
    def files(self) -> list[str]:
        """Data files, relative to the recipe."""
        data = self.tables.data
        if self.samples:
            return [file for one in self.samples for file in one.files]
        names = [*data.files, *(file.path for file in data.file)]
        return [os.path.normpath(Path(self.path).parent / name) for name in names]

    @property
    def each(self) -> list[FilmRecipe]:
        """One recipe for each `[[data.file]]`, with the keys of that table, or for each file of each sample;
        empty without such tables."""
        if self.sample is not None:
            return []
        if self.tables.sample:
            return [
                FilmRecipe(self.path, _of_file(tables, file), sample)
                for sample in self.tables.sample
                for tables in [_of_sample(self.path, self.tables, sample)]
                for file in [*(schema.FileTable(path=x) for x in sample.files), *sample.file]
            ]
        return [FilmRecipe(self.path, _of_file(self.tables, file)) for file in self.tables.data.file]

    @property
    def samples(self) -> list[FilmRecipe]:
        """One recipe for each file of each sample; empty without `[[sample]]`."""
        return self.each if self.tables.sample else []

    @property
    def first(self) -> FilmRecipe:
        """The recipe of the first file: this one, or that of the first `[[data.file]]`."""
        return next(iter(self.each), self)

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
        return self.reading | FitOptions.of(self.tables.data.given()).given()

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
        with _of_recipe(self.path, part="camera: "):
            return sight(camera, self.tables.data.signal or "srgb")

    def scene(self, fitted: bool = False) -> Scene:
        """Build the scene. Raises DataError, the path in front; if `fitted`, where nothing is free."""
        tables = self.tables
        if self.samples:
            names = ", ".join(one.name for one in tables.sample)
            raise DataError(
                f"{self.path}: has [[sample]] tables ({names}), which fit, sample, simulate and plan take"
                " together; write a recipe of one sample for this"
            )
        described, data, folder = tables.scene, tables.data, Path(self.path).parent
        azimuth = np.array(data.azimuth) if isinstance(data.azimuth, list) else data.azimuth
        with _of_recipe(self.path, ValueError):
            lit = light(data, tables.camera.transmitted, azimuth)
            scene = Scene(
                parts.layers(described, folder),
                parts.substrate(described.substrate, folder, lit.signal),
                ambient=medium(described.ambient, name="ambient", folder=folder),
                light=lit,
                instrument=parts.instrument(tables.instrument),
                uncertainty=parts.uncertainty(Uncertainty, described, tables.instrument),
                reference=None if tables.reference is None else parts.reference(tables.reference, folder),
            )
            if self.sample is not None:
                scene = of_sample(scene, self.sample, tables.shared)
            check_free_count(len(free_leaves(scene)), least=int(fitted))
        return scene


def light(given: Any, transmitted: bool | None, azimuth: Any) -> Light:
    """Light by the options `signal`, `angle`, `polarisation` and `transmission` of reading.

    `azimuth` of the sample is in degrees. Raises UsageError.
    """
    several = isinstance(given.angle, list)
    angle = np.array(given.angle) if several else parts.optional(given.angle, "angle") or 0.0
    of_colours = "T" if transmitted else "R"
    signal = of_colours if given.signal in SPACES else given.signal or "R"
    through = bool(given.transmission and given.signal)
    return Light(None, angle, signal, given.polarisation or "unpolarised", azimuth, through)


_NUMBERS: TypeAdapter[Any] = TypeAdapter(float | schema.FreeTable | list[float])


def _of_sample(path: str, tables: schema.RecipeTable, sample: schema.SampleTable) -> schema.RecipeTable:
    """The recipe of one sample, with its own layers and keys. Raises DataError, the path in front."""
    with _of_recipe(path):
        tables = tables.model_copy(update={"scene": scene_table(tables.scene, sample)})
    return _of_file(tables, sample)


def _of_file(tables: schema.RecipeTable, file: schema.FileTable | schema.SampleTable) -> schema.RecipeTable:
    """The recipe of one file: with its own signal, angle, noise and so on, and no other file."""
    reading = {name: x for name in schema.ReadingTable.model_fields if (x := getattr(file, name)) is not None}
    scene, plate = tables.scene, tables.scene.substrate
    if file.back is False and isinstance(plate, schema.PlateTable):
        bare = plate.model_copy(update=dict.fromkeys(("back", *schema.BACK)))
        scene = scene.model_copy(update={"substrate": bare})
    own = [file] if isinstance(file, schema.FileTable) else []
    parts = {"data": tables.data.model_copy(update={**reading, "file": own}), "scene": scene}
    for name in ("instrument", "camera"):
        table = getattr(file, name)
        given = {key: getattr(table, key) for key in table.model_fields_set}
        parts[name] = getattr(tables, name).model_copy(update=given)
    return tables.model_copy(update=parts)


def surface_samples(
    file: str | os.PathLike[str], surface: Surface, noise: Any = None, **options: Any
) -> BrdfSamples:
    """Read samples of a surface: spectra at its wavelengths, or integrated over the bands of its sensor.

    `options` are those of `read_brdf_samples`, and raise as they do.
    """
    sensor = surface.sensor
    bands = None if sensor is None else (sensor.wavelength, sensor.weights)
    samples = read_brdf_samples(file, wavelengths=surface.channel_wavelengths, bands=bands, **options)
    return samples if noise is None else samples.with_noise(noise)


@dataclass(frozen=True)
class SurfaceRecipe:
    """A recipe of a surface: its path and its checked tables."""

    path: str
    tables: schema.SurfaceRecipeTable

    @property
    def files(self) -> list[str]:
        """Data files, relative to the recipe."""
        return [os.path.normpath(Path(self.path).parent / name) for name in self.tables.data.files]

    @cached_property
    def sensor(self) -> Sensor | None:
        """The sensor of the surface, whose files are read once; None without one. Raises DataError."""
        table = self.tables.scene.surface
        with _of_recipe(self.path, ValueError, "scene.surface: "):
            return band_sensor(table.sensor, table.illuminant, table.lamp, Path(self.path).parent)

    def scene(self, fitted: bool = False) -> Surface:
        """Build the surface. Raises DataError as `FilmRecipe.scene` does."""
        table = self.tables.scene.surface
        folder, sensor = Path(self.path).parent, self.sensor
        with _of_recipe(self.path, ValueError, "scene.surface: "):
            numbers: dict[str, Any] = {}
            for key, value in (table.model_extra or {}).items():
                try:
                    one = _NUMBERS.validate_python(value)
                except ValidationError:
                    raise UsageError(
                        f"{key}: a number, a list of one for each channel, or {{ lower = ..., upper = ... }}"
                        f" was expected, got {value!r}"
                    ) from None
                numbers[key] = one if isinstance(one, list) else number(one, key)
            surface = Surface(
                table.model,
                numbers,
                None if table.wavelengths is None else tuple(table.wavelengths),
                sensor,
                None if table.film is None else medium(table.film, name="film", folder=folder),
                None if table.base is None else medium(table.base, name="base", folder=folder),
                parts.uncertainty(SurfaceUncertainty, table),
            )
        with _of_recipe(self.path):
            check_free_count(len(surface.free_numbers()), least=int(fitted))
        return surface

    def read(self, file: str) -> BrdfSamples:
        """Read samples as `[data]` says, with σ where it gives `noise`. Raises DataError or UsageError.

        Spectra are taken at the surface's wavelengths, or integrated over the bands of its sensor.
        """
        data = self.tables.data
        options = {"columns": data.columns, "samples": data.samples, "max_theta": data.max_theta}
        samples = surface_samples(file, self.scene(), **options)
        if data.noise is None:
            return samples
        with _of_recipe(self.path, part="data."):
            return samples.with_noise(data.noise)

    def with_data(self, **keys: Any) -> SurfaceRecipe:
        """The recipe with these keys of `[data]` replaced."""
        data = self.tables.data.model_copy(update=keys)
        return replace(self, tables=self.tables.model_copy(update={"data": data}))
