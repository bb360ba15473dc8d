"""Recipes of surfaces: a TOML file that names a BRDF's model and what of it is free."""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.read_brdf import read_brdf_samples
from pellicle.errors import DataError, UsageError
from pellicle.recipes.dispersion_models import nearest
from pellicle.recipes.media import Medium, Number, medium, number
from pellicle.scene.surface import Surface

_NUMBERS: TypeAdapter[Any] = TypeAdapter(Number | list[float])


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class DataTable(_Table):
    """`[data]`: `residual` is what is compared, `samples` the most that are kept of a file."""

    signal: Literal["brdf"] = "brdf"
    files: list[str] = []
    columns: str | list[str] | None = None
    noise: float | None = Field(default=None, gt=0)
    residual: Literal["linear", "cosine", "log", "cube-root"] | None = None
    samples: int | None = Field(default=None, gt=0)


class SurfaceTable(_Table):
    """`[scene.surface]`: what else it holds are the keys of the model."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    model: str
    wavelengths: list[float] | None = Field(default=None, min_length=1)
    base: Medium | None = None


class SceneTable(_Table):
    """`[scene]`."""

    surface: SurfaceTable


class RecipeTable(_Table):
    """A whole recipe of a surface."""

    data: DataTable = DataTable()
    scene: SceneTable


_KEYS = {"data": DataTable, "scene": SceneTable, "": RecipeTable}


@dataclass(frozen=True)
class SurfaceRecipe:
    """A recipe that was read: its surface, and how the samples are read and compared."""

    path: str
    files: list[str]
    surface: Surface
    data: DataTable

    def read(self, file: str) -> BrdfSamples:
        """Samples of a BRDF, with σ where `noise` gives one. Raises DataError or UsageError."""
        found = read_brdf_samples(file, columns=self.data.columns, samples=self.data.samples)
        if self.data.noise is None:
            return found
        return replace(found, sigma=np.full_like(found.values, self.data.noise))


def read_surface_recipe(path: str | os.PathLike[str]) -> SurfaceRecipe:
    """Read and check a recipe. Raises DataError: which key, what was expected, the nearest known one."""
    name, folder = str(path), Path(path).parent
    try:
        tables = RecipeTable.model_validate(tomllib.loads(Path(path).read_text("utf-8")))
    except ValidationError as error:
        raise DataError(f"{name}: {_told(error)}") from None
    files = [os.path.normpath(folder / file) for file in tables.data.files]
    try:
        return SurfaceRecipe(name, files, _surface(tables.scene.surface, folder), tables.data)
    except ValueError as error:
        raise DataError(f"{name}: scene.surface: {error}") from None


def _told(error: ValidationError) -> str:
    found = error.errors(include_url=False)
    chosen = next((e for e in found if e["type"] == "extra_forbidden"), found[0])
    where = [str(part) for part in chosen["loc"]]
    key = ".".join(where)
    if chosen["type"] == "extra_forbidden":
        known = list(_KEYS.get(where[-2] if len(where) > 1 else "", RecipeTable).model_fields)
        return f"unknown key {key!r}{nearest(where[-1], known)}; known here: {', '.join(known)}"
    if chosen["type"] == "missing":
        return f"{key} is missing"
    return f"{key}: {chosen['msg'][0].lower()}{chosen['msg'][1:]}, got {chosen['input']!r}"


def _surface(table: SurfaceTable, folder: Path) -> Surface:
    numbers = {key: _number(value, key) for key, value in (table.model_extra or {}).items()}
    wavelengths = None if table.wavelengths is None else tuple(table.wavelengths)
    bare = Surface(table.model, {}, wavelengths)
    if table.base is not None:
        if clash := {"base_n", "base_k"} & numbers.keys():
            raise UsageError(f"base and {' and '.join(sorted(clash))} exclude each other")
        index = np.asarray(medium(table.base, folder)(np.array(bare.seen_at)))
        numbers |= {"base_n": np.real(index).tolist(), "base_k": np.imag(index).tolist()}
    return Surface(table.model, numbers, wavelengths)


def _number(given: Any, key: str) -> Any:
    try:
        found = _NUMBERS.validate_python(given)
    except ValidationError:
        raise UsageError(
            f"{key}: a number, a list of one for each channel, or {{ lower = ..., upper = ... }} was"
            f" expected, got {given!r}"
        ) from None
    return found if isinstance(found, list) else number(found, key)
