"""Recipes of surfaces: tables of a TOML file to a BRDF whose numbers are fixed or free."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from pellicle.brdf.models import MODELS as BRDF_MODELS
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.options import FitOptions
from pellicle.data.read_brdf import read_brdf_samples
from pellicle.data.sensors import band_sensor
from pellicle.errors import DataError, UsageError
from pellicle.recipes.media import Medium, Number, medium, number
from pellicle.scene.free import check_free_count
from pellicle.scene.surface import Surface

_NUMBERS: TypeAdapter[Any] = TypeAdapter(Number | list[float])


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class SurfaceDataTable(_Table, FitOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """`[data]`: `noise` is a standard deviation (1/sr) or a share of the signal ("2 %"), for all channels or
    for each; `residual` is the scale of the comparison, `samples` the most to keep of a file, `max_theta` the
    largest angle from the normal (degrees) of samples to keep."""

    signal: Literal["brdf"] = "brdf"
    files: list[str] = []
    columns: str | list[str] | None = None
    noise: float | str | list[float | str] | None = None
    residual: Literal["linear", "cosine", "log", "cube-root"] | None = None
    samples: int | None = Field(default=None, gt=0)
    max_theta: float | None = Field(default=None, gt=0, le=90)


class SurfaceTable(_Table):
    """`[scene.surface]`: further keys are the model's own numbers.

    `sensor` gives each channel its band: an observer of the CIE, "srgb", or a file of a camera's
    sensitivities; the light is an `illuminant` of the CIE or a `lamp`, a file of its spectrum. `film` and
    `base` are media.
    """

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    model: str = Field(json_schema_extra={"enum": [*BRDF_MODELS]})
    wavelengths: list[float] | None = Field(default=None, min_length=1)
    sensor: str | None = None
    illuminant: Literal["E", "A", "D50", "D55", "D65", "D75"] | None = None
    lamp: str | None = None
    film: Medium | None = None
    base: Medium | None = None


class SurfaceSceneTable(_Table):
    """`[scene]`."""

    surface: SurfaceTable


class SurfaceRecipeTable(_Table):
    """A whole recipe of a surface."""

    data: SurfaceDataTable = SurfaceDataTable()
    scene: SurfaceSceneTable


TABLES: dict[str, type[BaseModel]] = {
    "": SurfaceRecipeTable,
    "data": SurfaceDataTable,
    "scene": SurfaceSceneTable,
}
"""The table under each key of a recipe, for messages that list the known keys."""


@dataclass(frozen=True)
class SurfaceRecipe:
    """A recipe of a surface: its path and its checked tables."""

    path: str
    tables: SurfaceRecipeTable

    @property
    def files(self) -> list[str]:
        """Data files, relative to the recipe."""
        return [os.path.normpath(Path(self.path).parent / name) for name in self.tables.data.files]

    def scene(self) -> Surface:
        """Build the surface. Raises DataError, the recipe's path in front."""
        try:
            return _surface(self.tables.scene.surface, Path(self.path).parent)
        except ValueError as error:
            # without backticks, which the command line would turn into flags
            raise DataError(f"{self.path}: scene.surface: {error}".replace("`", "")) from None
        except RecursionError:
            raise DataError(f"{self.path}: scene.surface: its base is nested too deeply") from None

    def read(self, file: str) -> BrdfSamples:
        """Read samples as `[data]` says, with σ where it gives `noise`. Raises DataError or UsageError.

        Spectra are taken at the surface's wavelengths, or integrated over the bands of its sensor.
        """
        data, surface = self.tables.data, self.scene()
        sensor = surface.sensor
        samples = read_brdf_samples(
            file,
            columns=data.columns,
            samples=data.samples,
            max_theta=data.max_theta,
            wavelengths=surface.channel_wavelengths,
            bands=None if sensor is None else (sensor.wavelength, sensor.weights),
        )
        if data.noise is None:
            return samples
        try:
            return samples.with_noise(data.noise)
        except UsageError as error:
            raise DataError(f"{self.path}: data.{error}".replace("`", "")) from None

    def with_data(self, **keys: Any) -> SurfaceRecipe:
        """The recipe with these keys of `[data]` replaced."""
        data = self.tables.data.model_copy(update=keys)
        return replace(self, tables=self.tables.model_copy(update={"data": data}))


def _surface(table: SurfaceTable, folder: Path) -> Surface:
    surface = Surface(
        table.model,
        {key: _number(value, key) for key, value in (table.model_extra or {}).items()},
        None if table.wavelengths is None else tuple(table.wavelengths),
        band_sensor(table.sensor, table.illuminant, table.lamp, folder),
        None if table.film is None else medium(table.film, folder, "film"),
        None if table.base is None else medium(table.base, folder, "base"),
    )
    check_free_count(len(surface.free_numbers()), least=0)
    return surface


def _number(value: Any, key: str) -> Any:
    try:
        table = _NUMBERS.validate_python(value)
    except ValidationError:
        raise UsageError(
            f"{key}: a number, a list of one for each channel, or {{ lower = ..., upper = ... }} was"
            f" expected, got {value!r}"
        ) from None
    return table if isinstance(table, list) else number(table, key)
