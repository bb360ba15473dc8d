"""Recipes: a TOML file that says what is there, how it was looked at and what to fit."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pellicle.errors import DataError
from pellicle.io import words
from pellicle.io.media import FreeTable, Medium, Number, PriorTable, medium, number
from pellicle.io.words import nearest
from pellicle.scene import Free, Instrument, Layer, Light, Scene, Substrate


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)


class PlateTable(_Table):
    """A substrate that is a plate with an incoherent back face."""

    material: Medium
    back: Medium | None = None
    plate_mm: Number = 1.0


class LayerTable(_Table):
    """One `[[scene.layer]]`."""

    name: str | None = None
    material: Medium
    thickness: Number
    free: list[str] = []


class GridTable(_Table):
    """Evenly spaced wavelengths in nm."""

    start: float = Field(gt=0)
    stop: float
    step: float = Field(gt=0)


class DataTable(_Table):
    """`[data]`."""

    files: list[str] = []
    signal: Literal["R", "T", "psi-delta"] | None = None
    angle: float | None = Field(default=None, ge=0, le=90)
    polarisation: Literal["unpolarised", "s", "p"] | None = None
    noise: float | None = Field(default=None, gt=0)
    range: tuple[float, float] | None = None
    wavelengths: GridTable | list[float] | None = None
    joint: bool = False


class SceneTable(_Table):
    """`[scene]`."""

    ambient: Medium = 1.0
    substrate: Medium | PlateTable
    layer: list[LayerTable] = Field(min_length=1)


class InstrumentTable(_Table):
    """`[instrument]`."""

    scale: Literal["free", "slow"] | float = 1.0
    offset: Literal["free", "slow"] | float = 0.0
    bandwidth: Number | None = None
    thickness_spread: Number | None = None


class RecipeTable(_Table):
    """A whole recipe."""

    data: DataTable = DataTable()
    scene: SceneTable
    instrument: InstrumentTable = InstrumentTable()


class Recipe(BaseModel):
    """A recipe that was read: its tables and where it lies."""

    path: str
    tables: RecipeTable

    @property
    def files(self) -> list[str]:
        """Data files, relative to the recipe."""
        return [os.path.normpath(Path(self.path).parent / name) for name in self.tables.data.files]

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
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{name}: is not TOML: {error}") from None
    try:
        return Recipe(path=name, tables=RecipeTable.model_validate(loaded))
    except ValidationError as error:
        raise DataError(f"{name}: {_first(error)}") from None


_KEYS: dict[str, type[BaseModel]] = {
    "": RecipeTable,
    "data": DataTable,
    "wavelengths": GridTable,
    "scene": SceneTable,
    "layer": LayerTable,
    "substrate": PlateTable,
    "instrument": InstrumentTable,
    "thickness": FreeTable,
    "plate_mm": FreeTable,
    "bandwidth": FreeTable,
    "thickness_spread": FreeTable,
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
    return f"{key}: {chosen['msg'][0].lower()}{chosen['msg'][1:]}, got {chosen['input']!r}"


def _scene(tables: RecipeTable, folder: Path) -> Scene:
    scene, data = tables.scene, tables.data
    layers = [
        Layer(
            words.freed(medium(layer.material, folder), layer.free),
            number(layer.thickness, "thickness", natural=0.0),
            layer.name,
        )
        for layer in scene.layer
    ]
    instrument = tables.instrument
    return Scene(
        layers,
        _substrate(scene.substrate, folder),
        ambient=medium(scene.ambient, folder),
        light=Light(None, data.angle or 0.0, data.signal or "R", data.polarisation or "unpolarised"),
        instrument=Instrument(
            instrument.scale,
            instrument.offset,
            optional(instrument.bandwidth, "bandwidth"),
            optional(instrument.thickness_spread, "thickness_spread"),
        ),
    )


def _substrate(given: Medium | PlateTable, folder: Path) -> Substrate:
    if not isinstance(given, PlateTable):
        return Substrate(medium(given, folder))
    back = None if given.back is None else medium(given.back, folder)
    return Substrate(medium(given.material, folder), back, number(given.plate_mm, "plate_mm", natural=0.0))


def optional(given: Number | None, what: str) -> float | Free | None:
    """A number that may be absent."""
    return None if given is None else number(given, what, natural=0.0)
