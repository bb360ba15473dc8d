"""The tables of a recipe, and what may stand in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from pellicle.data.tabular.units import BITS, SIGNAL_UNITS, WAVELENGTH_UNITS, colour_unit, wavelength_unit
from pellicle.recipes.media import FreeTable, Medium, Number


def _unit(known: Sequence[str], find: Callable[[str], str | None]) -> AfterValidator:
    """Refuses what is no unit, as the flags do."""

    def check(given: str) -> str:
        if find(given) is None:
            raise ValueError(f"must be one of {', '.join(known)}, not {given!r}")
        return given

    return AfterValidator(check)


WavelengthUnit = Annotated[str, _unit(WAVELENGTH_UNITS, wavelength_unit)]
SignalUnit = Annotated[str, _unit((*SIGNAL_UNITS, *BITS), colour_unit)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)


Uncertain = Annotated[float, Field(ge=0)] | None
"""Standard uncertainty of a number that is taken as known; None leaves the usual one."""


_BACK = ("back_collected", "back_reflections")
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
    index_uncertainty: Uncertain = None
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
            return {"plate_mm", *_BACK, "thickness_spread", "roughness", "index_uncertainty", "free"}
        return (
            {"steps", "fraction", "thickness_spread", "roughness", "index_uncertainty"}
            if self.plate_mm is not None
            else {"steps", "fraction", *_BACK}
        )


class GridTable(_Table):
    """Evenly spaced wavelengths in nm."""

    start: float = Field(gt=0)
    stop: float
    step: float = Field(gt=0)


class InstrumentTable(_Table):
    """`[instrument]`."""

    scale: Literal["free", "slow"] | float = 1.0
    offset: Literal["free", "slow"] | float = 0.0
    bandwidth: Number | None = None
    thickness_spread: Number | None = None
    angle_spread: Number | None = None
    numerical_aperture: Number | None = None
    wavelength_shift: Number | None = None
    angle_shift: Number | None = None
    wavelength_uncertainty: Uncertain = None
    bandwidth_uncertainty: Uncertain = None
    angle_uncertainty: Uncertain = None
    angle_spread_uncertainty: Uncertain = None
    scale_uncertainty: Uncertain = None
    offset_uncertainty: Uncertain = None
    psi_uncertainty: Uncertain = None
    delta_uncertainty: Uncertain = None
    depolarisation_uncertainty: Uncertain = None
    mueller_uncertainty: Uncertain = None


Signal: TypeAlias = Literal[
    "R", "T", "psi-delta", "mueller", "generalised-psi-delta", "srgb", "rgb", "xyz", "lab"
]


Degrees: TypeAlias = Annotated[float, Field(ge=0, le=90)]
"""Angle of incidence."""


class _Reading(_Table):
    """Reading options of data files, named as the flags of the command line."""

    spectrum: str | None = None
    signal: Signal | None = None
    angle: Degrees | Annotated[list[Degrees], Field(min_length=1)] | FreeTable | None = None
    azimuth: float | list[float] | None = None
    polarisation: Literal["unpolarised", "s", "p"] | None = None
    noise: float | None = Field(default=None, gt=0)
    columns: str | list[str] | None = None
    wavelength_unit: WavelengthUnit | None = None
    signal_unit: SignalUnit | None = None
    range: tuple[float, float] | None = None
    folded: bool | None = None
    analyser: float | None = Field(default=None, gt=0, lt=90)
    spot: int | None = Field(default=None, ge=1)
    elements: list[str] | None = None
    region: str | list[int] | list[list[int]] | None = None
    points: str | list[int] | list[list[int]] | None = None


class CameraTable(_Table):
    """`[camera]`: what sees the colours of a film, and under which light; files are CSV."""

    observer: Literal["1931", "1964"] = "1931"
    illuminant: Literal["E", "A", "D50", "D55", "D65", "D75"] = "D65"
    lamp: str | None = None
    sensitivities: str | None = None
    chart: str | None = None
    gamma: float = Field(default=1.0, ge=0.1, le=10)
    white_balance: Literal["fixed", "free"] = "fixed"
    white: str | list[int] | None = None
    transmitted: bool = False


class FileTable(_Reading):
    """One `[[data.file]]`: its keys override those of `[data]`, `[instrument]` and `[camera]`."""

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


class DataTable(_Reading):
    """`[data]`."""

    files: list[str] = []
    file: list[FileTable] = []
    wavelengths: GridTable | list[float] | None = None
    joint: bool = False
    repeats: bool = False
    loss: Literal["least-squares", "huber", "student-t"] | None = None

    @model_validator(mode="after")
    def _one_list(self):
        if self.files and self.file:
            raise ValueError("files and [[data.file]] exclude each other: name every file in one of them")
        if self.joint and self.repeats:
            raise ValueError("joint and repeats exclude each other: repeats are fitted one by one")
        return self


class SceneTable(_Table):
    """`[scene]`."""

    ambient: Medium = 1.0
    substrate: Medium | PlateTable
    layer: list[LayerTable] = Field(min_length=1)
    uncertainty: Literal["usual", "none"] = "usual"
    index_uncertainty: Uncertain = None
    dispersion_uncertainty: Uncertain = None
    roughness_uncertainty: Uncertain = None
    thickness_spread_uncertainty: Uncertain = None
    interlayer_uncertainty: Uncertain = None


class RecipeTable(_Table):
    """A whole recipe."""

    data: DataTable = DataTable()
    scene: SceneTable
    instrument: InstrumentTable = InstrumentTable()
    camera: CameraTable = CameraTable()


def of_file(tables: RecipeTable, file: FileTable) -> RecipeTable:
    """The recipe of one file: with its own signal, angle, noise and so on, and no other file."""
    words = {name: getattr(file, name) for name in _Reading.model_fields}
    said = {name: value for name, value in words.items() if value is not None}
    data = tables.data.model_copy(update={**said, "file": [file]})
    own = {name: getattr(file.instrument, name) for name in file.instrument.model_fields_set}
    instrument = tables.instrument.model_copy(update=own)
    camera = tables.camera.model_copy(
        update={name: getattr(file.camera, name) for name in file.camera.model_fields_set}
    )
    scene, plate = tables.scene, tables.scene.substrate
    if file.back is False and isinstance(plate, PlateTable):
        scene = scene.model_copy(
            update={"substrate": plate.model_copy(update=dict.fromkeys(("back", *_BACK)))}
        )
    return tables.model_copy(
        update={"data": data, "instrument": instrument, "camera": camera, "scene": scene}
    )
