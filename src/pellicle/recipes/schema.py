"""The tables of a recipe, and what may stand in them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from pellicle.brdf.models import MODELS as BRDF_MODELS
from pellicle.data.options import CameraOptions, FitOptions, ReadingOptions
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.profiles import PROFILES
from pellicle.dispersion.temperature import AtTemperature, ThermoOptic
from pellicle.errors import did_you_mean
from pellicle.recipes.dispersion_models import MODELS, SPLINES, TERMS
from pellicle.scene.layers import Uncertainty
from pellicle.scene.priors import HalfNormal, LogUniform, Normal, Prior
from pellicle.scene.surface import SurfaceUncertainty

UNIAXIAL, BIAXIAL = ("ordinary", "extraordinary"), ("x", "y", "z")
_NUMBER = {"anyOf": [{"type": "number"}, {"$ref": "#/$defs/FreeTable"}, {"type": "string"}]}
_NUMBER_PER_KNOT = {"anyOf": [*_NUMBER["anyOf"], {"type": "array", "items": _NUMBER}]}


def _table_schema(properties: dict[str, Any], *required: str) -> dict[str, Any]:
    """A table of these keys and no other, in a schema."""
    needed = {"required": [*required]} if required else {}
    return {"properties": properties, **needed, "additionalProperties": False}


def _choose(schema: dict[str, Any], tables: Iterable[dict[str, Any]]) -> None:
    """Replace the keys of a schema by several tables, one of which must fit."""
    schema.pop("additionalProperties", None)
    schema["anyOf"] = [*tables]


def _anisotropic_schema(schema: dict[str, Any]) -> None:
    """List the keys of both kinds, for editors."""
    medium = {"type": ["string", "number", "object"]}
    tables = []
    for keys in (UNIAXIAL, BIAXIAL):
        axis = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": len(keys)}
        tables.append(_table_schema({**dict.fromkeys(keys, medium), "axis": axis}, *keys))
    _choose(schema, tables)


class AnisotropicTable(BaseModel):
    """`{ ordinary = "TiO2-o", extraordinary = "TiO2-e", axis = [0, 0] }`, or `{ x = ..., y = ..., z = ... }`.

    The principal media are media of any kind. `axis` is [theta, phi], of x, y and z [theta, phi, psi], each a
    number of degrees or a table of bounds.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_anisotropic_schema)

    @model_validator(mode="before")
    @classmethod
    def _is_meant(cls, given: Any) -> Any:
        known = (*UNIAXIAL, *BIAXIAL, "axis")
        if not isinstance(given, dict) or not any(key in known or did_you_mean(key, known) for key in given):
            raise ValueError("a birefringent material has ordinary and extraordinary, or x, y and z")
        return given


def _profile_schema(schema: dict[str, Any]) -> None:
    """Add to the schema which numbers each profile has, for editors."""
    kinds: dict[str, Any] = {"values": {"type": "array", "minItems": 2, "items": _NUMBER}}
    kinds["knots"] = {"type": "array", "minItems": 2, "items": {"type": "number"}}
    shared, tables = schema.pop("properties"), []
    for name, kind in PROFILES.items():
        numbers = {field.name: kinds.get(field.name, _NUMBER) for field in fields(kind)}
        required = ["graded"] if name == "linear" else ["graded", "profile"]  # linear is the default
        tables.append(_table_schema({**shared, "profile": {"const": name}, **numbers}, *required))
    _choose(schema, tables)
    schema.pop("required", None)


class GradedTable(BaseModel):
    """`{ graded = ["SiO2", "Si3N4"], profile = "linear", top = 0.1, bottom = { lower = 0, upper = 1 } }`.

    Further keys are the numbers of the profile. `mix` is the mixing rule, "bruggeman" by default.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_profile_schema)
    graded: list[Any] = Field(min_length=2, max_length=2)
    profile: str = "linear"
    mix: str = Field("bruggeman", json_schema_extra={"enum": [*MIXTURES]})


class PriorTable(BaseModel):
    """A prior in the parameter's unit, truncated at the bounds.

    `{ mean = 100, sd = 5 }`, `{ half_normal = 0.01 }` (its standard deviation) or `{ log_uniform = true }`.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    mean: float | None = None
    sd: float | None = Field(None, gt=0)
    half_normal: float | None = Field(None, gt=0)
    log_uniform: Literal[True] | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> PriorTable:
        keys = {name for name, value in vars(self).items() if value is not None}
        if keys not in ({"mean", "sd"}, {"half_normal"}, {"log_uniform"}):
            raise ValueError("give mean and sd, or half_normal, or log_uniform = true")
        return self

    def prior(self) -> Prior:
        """Build the prior."""
        if self.half_normal is not None:
            return HalfNormal(self.half_normal)
        if self.mean is None or self.sd is None:
            return LogUniform()
        return Normal(self.mean, self.sd)


class FreeTable(BaseModel):
    """A free number by its bounds, with optional start value and prior; or a fixed one by its value.

    `limits` mark default bounds, which a fit of spectra may widen up to them.
    """

    model_config = ConfigDict(extra="forbid")
    value: float | None = None
    lower: float | None = None
    upper: float | None = None
    limits: tuple[float, float] | None = None
    prior: PriorTable | None = None


Number = float | FreeTable | str
"""A number; a text is an expression of other parameters, to which it is tied."""


def _model_schema(schema: dict[str, Any]) -> None:
    """Add to the schema which parameters each model has, for editors."""
    choices: list[dict[str, Any]] = []
    for name, specs in MODELS.items():
        number = _NUMBER_PER_KNOT if name in SPLINES else _NUMBER
        properties = {"model": {"const": name}, **dict.fromkeys(specs, number)}
        if name in SPLINES:
            properties["knots"] = {"type": "array", "items": {"type": "number"}}
        choices.append(_table_schema(properties))
    kinds = [{"kind": {"const": kind}, **dict.fromkeys(specs, _NUMBER)} for kind, specs in TERMS.items()]
    term = [_table_schema(keys, "kind") for keys in kinds]
    terms = {"type": "array", "minItems": 1, "items": {"anyOf": term}}
    choices.append(
        _table_schema({"model": {"const": "oscillators"}, "eps_inf": _NUMBER, "terms": terms}, "terms")
    )
    for name, kind in (("thermo-optic", ThermoOptic), ("at-temperature", AtTemperature)):
        keys = dict.fromkeys((field.name for field in fields(kind)), True)
        choices.append(
            _table_schema(keys | {"model": {"const": name}, "temperature": _NUMBER}, "temperature")
        )
    _choose(schema, choices)


class MediumTable(BaseModel):
    """A dispersion model, `{ model = "cauchy", A = ..., B = ... }`: further keys are its parameters.

    `{ model = "oscillators", eps_inf = ..., terms = [{ kind = "lorentz", ... }, ...] }` is a sum.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_model_schema)
    model: str


class MixTable(BaseModel):
    """`{ mix = "bruggeman", host = "SiO2", inclusion = "air", fraction = { lower = 0, upper = 0.5 } }`.

    `host` and `inclusion` are media of any kind; `materials = [host, inclusion]` is another way to give them.
    """

    model_config = ConfigDict(extra="allow")
    mix: str = Field(json_schema_extra={"enum": [*MIXTURES]})


Medium = str | float | MediumTable | MixTable | GradedTable | AnisotropicTable


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


class InstrumentTable(_uncertainties(name for name in _EVERY if name not in _OF_SCENE)):
    """`[instrument]`."""

    scale: Literal["free", "slow"] | float = 1.0
    offset: Literal["free", "slow"] | float = 0.0
    bandwidth: Number | None = None
    thickness_spread: Number | None = None
    angle_spread: Number | None = None
    numerical_aperture: Number | None = None
    wavelength_shift: Number | None = None
    angle_shift: Number | None = None


_Angle = Annotated[
    float | Annotated[list[float], Field(min_length=1)] | FreeTable | None,
    ReadingOptions.declared()["angle"][1],
]
_Noise = Annotated[float | None, Field(gt=0)]


class ReadingTable(_Table, ReadingOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """Options of reading data files, named as the flags of the command line."""

    azimuth: float | list[float] | None = None


class CameraTable(_Table, CameraOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """`[camera]`: what sees the colours of a film, and under which light; files are CSV."""


class FileTable(ReadingTable):
    """One `[[data.file]]`: its keys override those of `[data]`, `[instrument]` and `[camera]`."""

    angle: _Angle = None  # pyright: ignore[reportIncompatibleVariableOverride]
    noise: _Noise = None  # pyright: ignore[reportIncompatibleVariableOverride]
    path: str
    instrument: InstrumentTable = InstrumentTable()
    camera: CameraTable = CameraTable()
    back: Literal[False] | None = None

    @property
    def rescales(self) -> bool:
        """True where this file has a scale or an offset of its own."""
        return self.instrument.scale != 1.0 or self.instrument.offset != 0.0

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


class SceneTable(_uncertainties(name for name in _EVERY if name in _OF_SCENE)):
    """`[scene]`."""

    ambient: Medium = 1.0
    substrate: Medium | PlateTable
    layer: list[LayerTable] = Field([])
    group: list[GroupTable] = Field([])
    uncertainty: Literal["usual", "none"] = "usual"

    @model_validator(mode="after")
    def _has_layers(self):
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


class RecipeTable(_Table):
    """A whole recipe."""

    data: DataTable = DataTable()
    scene: SceneTable
    reference: ReferenceTable | None = None
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
