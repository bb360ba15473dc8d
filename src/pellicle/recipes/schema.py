"""The tables of a recipe, and what may stand in them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from pellicle.brdf.models import MODELS as BRDF_MODELS
from pellicle.data.options import CameraOptions, FitOptions, ReadingOptions
from pellicle.errors import did_you_mean
from pellicle.recipes.medium_schema import FreeTable, Medium, Number
from pellicle.scene.surface import SurfaceUncertainty
from pellicle.scene.uncertainty import Uncertainty


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)


Uncertain = Annotated[float, Field(ge=0)] | None
"""Standard uncertainty of a number that is taken as known; None leaves the usual one."""
_OF_SCENE = {"index", "dispersion", "roughness", "thickness_spread", "interlayer", "overlayer"}
"""Uncertainties of `[scene]`; the others are those of the instrument."""
_EVERY = [field.name for field in fields(Uncertainty)]


def _uncertainties(names: Iterable[str]) -> Any:
    """A table of the keys `NAME_uncertainty` of a record of standard uncertainties."""
    keys: dict[str, Any] = {f"{name}_uncertainty": (Uncertain, None) for name in names}
    return create_model("UncertaintyTable", __base__=_Table, **keys)


BACK = ("back_collected", "back_reflections")
"""Keys of a plate: which part of the light from beneath it reaches the detector."""


class PlateTable(_Table):
    """A substrate with more than a material, such as a plate with an incoherent back face."""

    material: Medium
    back: Medium | None = None
    plate_mm: Number = 1.0
    back_collected: Number | None = None
    back_reflections: int | None = None
    roughness: Number | None = None
    index_uncertainty: Uncertain = None


class LayerTable(_Table):
    """One `[[scene.layer]]`: a material with a thickness, or with plate_mm where it is incoherent, or
    `between`, a mixing rule for the media above and below, in `steps` slices or with a `fraction` of the one
    below."""

    name: str | None = None
    material: Medium | None = None
    between: str | None = None
    steps: int | None = None
    fraction: Number | None = None
    thickness: Number | None = None
    plate_mm: Number | None = None
    back_collected: Number | None = None
    back_reflections: int | None = None
    thickness_spread: Number | None = None
    roughness: Number | None = None
    drift: Number | None = None
    index_uncertainty: Uncertain = None
    free: list[str] = []

    @model_validator(mode="after")
    def _one_kind(self):
        if (self.material is None) == (self.between is None):
            raise ValueError('a layer has a material, or between = "bruggeman" to mix its neighbours')
        if (self.thickness is None) == (self.plate_mm is None):
            raise ValueError("a layer has a thickness in nm, or plate_mm where it is an incoherent plate")
        of_layer = {"thickness_spread", "roughness", "drift", "index_uncertainty"}
        if self.between is not None:
            kind, foreign = "between, a mixed interface", {*of_layer, *BACK, "plate_mm", "free"}
        elif self.plate_mm is not None:
            kind, foreign = "plate_mm, an incoherent plate", {*of_layer, "steps", "fraction"}
        else:
            kind, foreign = "a coherent layer", {*BACK, "steps", "fraction"}
        if rejected := self.model_fields_set & foreign:
            raise ValueError(f"{' and '.join(sorted(rejected))} does not go with {kind}")
        return self


class GroupTable(_Table):
    """One `[[scene.group]]`: layers that are repeated. It lies below the layer that `after` names, or below
    so many `[[scene.layer]]`; without it, below all of them."""

    repeat: int
    after: str | int | None = None
    layer: list[LayerTable]


class GridTable(_Table):
    """Evenly spaced wavelengths in nm."""

    start: float = Field(gt=0)
    stop: float
    step: float = Field(gt=0)


class LevelTable(_Table):
    """A gain or an offset that is one number at each time of a series, and how it changes."""

    varies: Literal["slowly", "freely", "shared"]


class InstrumentTable(_uncertainties(name for name in _EVERY if name not in _OF_SCENE)):
    """`[instrument]`."""

    scale: Literal["free", "slow"] | LevelTable | float = 1.0
    offset: Literal["free", "slow"] | LevelTable | float = 0.0
    bandwidth: Number | None = None
    thickness_spread: Number | None = None
    angle_spread: Number | None = None
    numerical_aperture: Number | None = None
    apodisation: Number | None = None
    stray_light: Number | None = None
    wavelength_shift: Number | None = None
    angle_shift: Number | None = None


_Angle = Annotated[
    float | Annotated[list[float], Field(min_length=1)] | FreeTable | None,
    ReadingOptions.declared()["angle"][1],
]
_Noise = Annotated[Annotated[float, Field(gt=0)] | str | None, ReadingOptions.declared()["noise"][1]]


class ReadingTable(_Table, ReadingOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """Options of reading data files, named as the flags of the command line."""

    azimuth: float | list[float] | None = None


class CameraTable(_Table, CameraOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """`[camera]`: what sees the colours of a film, and under which light; files are CSV."""


class _OwnTable(ReadingTable):
    """Keys that override those of `[data]`, `[instrument]` and `[camera]`."""

    angle: _Angle = None  # pyright: ignore[reportIncompatibleVariableOverride]
    noise: _Noise = None  # pyright: ignore[reportIncompatibleVariableOverride]
    instrument: InstrumentTable = InstrumentTable()
    camera: CameraTable = CameraTable()
    back: Literal[False] | None = None

    @property
    def rescales(self) -> bool:
        """True where this file has a scale or an offset of its own."""
        return self.instrument.scale != 1.0 or self.instrument.offset != 0.0


class FileTable(_OwnTable):
    """One `[[data.file]]`: its keys override those of `[data]`, `[instrument]` and `[camera]`."""

    path: str

    @model_validator(mode="before")
    @classmethod
    def _table(cls, given):
        if isinstance(given, str):
            raise ValueError(f"a table with a path was expected, not {given!r}: names alone go into files")
        return given


class DataTable(ReadingTable, FitOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """`[data]`."""

    angle: _Angle = None  # pyright: ignore[reportIncompatibleVariableOverride]
    noise: _Noise = None  # pyright: ignore[reportIncompatibleVariableOverride]
    files: list[str] = []
    file: list[FileTable] = []
    wavelengths: GridTable | list[float] | None = None
    joint: bool = False
    repeats: bool = False

    @model_validator(mode="after")
    def _one_list(self):
        if self.files and self.file:
            raise ValueError("files and [[data.file]] exclude each other: name every file in one of them")
        if self.joint and self.repeats:
            raise ValueError("joint and repeats exclude each other: repeats are fitted one by one")
        return self


MOST_LAYERS = 500
"""Layers of a scene: 300 are simulated in 8 s of processor time, which grows with their number; a filter with
more of them repeats some."""


class SceneTable(_uncertainties(name for name in _EVERY if name in _OF_SCENE)):
    """`[scene]`."""

    ambient: Medium = 1.0
    substrate: Medium | PlateTable
    layer: list[LayerTable] = Field([])
    group: list[GroupTable] = Field([])
    uncertainty: Literal["usual", "none"] = "usual"

    @model_validator(mode="after")
    def _has_layers(self):
        if (count := len(self.layer)) > MOST_LAYERS:
            raise ValueError(
                f"{count} layers, and a scene has at most {MOST_LAYERS}: write layers that repeat once, as a"
                " [[scene.group]] with repeat = N"
            )
        if not self.layer and not self.group:
            raise ValueError(
                "scene.layer is missing: a scene has at least one [[scene.layer]] or [[scene.group]]"
            )
        return self


class ReferenceTable(_Table):
    """`[reference]`: the known sample of a contrast, of counts or of relative reflectances."""

    substrate: Medium | PlateTable
    layer: list[LayerTable] = []
    group: list[GroupTable] = []
    form: Literal["relative", "normalised"] = "relative"


class SampleLayerTable(LayerTable):
    """One `[[sample.layer]]`: keys of its own of the layer of the scene with that name; else a layer of this
    sample alone, below the layer or the number of layers that `after` names."""

    name: str  # pyright: ignore[reportGeneralTypeIssues,reportIncompatibleVariableOverride]
    after: str | int | None = None

    @model_validator(mode="after")
    def _one_kind(self):
        return self  # checked with the keys of the scene's layer


class SampleTable(_OwnTable):
    """One `[[sample]]` of several in one fit: its files, and what is not as in `[scene]`; `without` names
    layers that it lacks. Further keys are numbers of its own, by their names in the scene."""

    model_config = ConfigDict(extra="allow", strict=False, allow_inf_nan=False)
    name: str
    files: list[str] = []
    file: list[FileTable] = []
    substrate: Medium | PlateTable | None = None
    ambient: Medium | None = None
    layer: list[SampleLayerTable] = []
    without: list[str] = []

    @model_validator(mode="after")
    def _has_files(self):
        if not self.files and not self.file:
            raise ValueError(f'sample {self.name} has no files: give it files = ["{self.name}.csv"]')
        if not self.name or "." in self.name:
            raise ValueError(f"a sample has a name without dots, not {self.name!r}")
        return self


_OF_LIGHT = ("angle", *(f"instrument.{name}" for name in InstrumentTable.model_fields))
"""Names of numbers of light and instrument."""


class RecipeTable(_Table):
    """A whole recipe. `shared` names free numbers of light and instrument that its samples have in common."""

    data: DataTable = DataTable()
    scene: SceneTable
    sample: list[SampleTable] = []
    shared: list[str] = []
    reference: ReferenceTable | None = None

    @model_validator(mode="after")
    def _samples(self):
        names = [one.name for one in self.sample]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"two samples have the name {twice[0]!r}: give each its own")
        for name in self.shared:
            if name not in _OF_LIGHT or not names:
                near = did_you_mean(name, _OF_LIGHT)
                raise ValueError(
                    f"shared names numbers of light and instrument that the samples of [[sample]] have in"
                    f' common, as in shared = ["instrument.numerical_aperture"], not {name!r}{near}'
                )
        if names and (self.data.files or self.data.file):
            raise ValueError("files of [data] and [[sample]] exclude each other: each sample names its files")
        return self

    instrument: InstrumentTable = InstrumentTable()
    camera: CameraTable = CameraTable()


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


class SurfaceTable(_uncertainties(field.name for field in fields(SurfaceUncertainty))):
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
    uncertainty: Literal["usual", "none"] = "usual"


class SurfaceSceneTable(_Table):
    """`[scene]`."""

    surface: SurfaceTable


class SurfaceRecipeTable(_Table):
    """A whole recipe of a surface."""

    data: SurfaceDataTable = SurfaceDataTable()
    scene: SurfaceSceneTable
