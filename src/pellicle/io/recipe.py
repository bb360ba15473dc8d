"""Recipes: a TOML file that says what is there, how it was looked at and what to fit."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pellicle.errors import DataError
from pellicle.io import words
from pellicle.io.media import FreeTable, Medium, Number, PriorTable, medium, number
from pellicle.io.words import nearest
from pellicle.scene import Free, Instrument, Interface, Layer, Light, Plate, Scene, Substrate


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)


class PlateTable(_Table):
    """A substrate that is a plate with an incoherent back face."""

    material: Medium
    back: Medium | None = None
    plate_mm: Number = 1.0
    roughness: Number | None = None


class LayerTable(_Table):
    """One `[[scene.layer]]`: a material with a thickness, or with plate_mm where it is incoherent, or
    `between`, a mixing rule for the media above and below, in `steps` slices."""

    name: str | None = None
    material: Medium | None = None
    between: str | None = None
    steps: int | None = None
    thickness: Number | None = None
    plate_mm: Number | None = None
    thickness_spread: Number | None = None
    roughness: Number | None = None
    free: list[str] = []

    @model_validator(mode="after")
    def _one_kind(self):
        if (self.material is None) == (self.between is None):
            raise ValueError('a layer has a material, or between = "bruggeman" to mix its neighbours')
        if (self.thickness is None) == (self.plate_mm is None):
            raise ValueError("a layer has a thickness in nm, or plate_mm where it is an incoherent plate")
        rejected = self.model_fields_set & self._foreign()
        if rejected:
            raise ValueError(f"{' and '.join(sorted(rejected))} does not go with {self._kind()}")
        return self

    def _kind(self) -> str:
        if self.between is not None:
            return "between, a mixed interface"
        return "plate_mm, an incoherent plate" if self.plate_mm is not None else "a coherent layer"

    def _foreign(self) -> set[str]:
        if self.between is not None:
            return {"plate_mm", "thickness_spread", "roughness", "free"}
        return {"steps", "thickness_spread", "roughness"} if self.plate_mm is not None else {"steps"}


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
    angle_spread: Number | None = None
    numerical_aperture: Number | None = None


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
    "roughness": FreeTable,
    "angle_spread": FreeTable,
    "numerical_aperture": FreeTable,
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
        light=Light(None, data.angle or 0.0, data.signal or "R", data.polarisation or "unpolarised"),
        instrument=Instrument(
            instrument.scale,
            instrument.offset,
            optional(instrument.bandwidth, "bandwidth"),
            optional(instrument.thickness_spread, "thickness_spread"),
            optional(instrument.angle_spread, "angle_spread"),
            optional(instrument.numerical_aperture, "numerical_aperture"),
        ),
    )


def _layer(given: LayerTable, folder: Path) -> Layer | Interface | Plate:
    thickness: Any = optional(given.thickness, "thickness")
    stated: Any = given.material  # the table has seen to it that what a kind needs is there
    if given.between is not None:
        return Interface(thickness, 1 if given.steps is None else given.steps, given.between, given.name)
    material = words.freed(medium(stated, folder), given.free)
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


def optional(given: Number | None, what: str) -> float | Free | None:
    """A number that may be absent."""
    return None if given is None else number(given, what, natural=0.0)
