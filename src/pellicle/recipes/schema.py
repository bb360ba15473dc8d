"""The tables of a recipe, and what may stand in them."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from pellicle.data.options import CameraOptions, FitOptions, ReadingOptions
from pellicle.recipes.media import FreeTable, Medium, Number


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


_Angle = Annotated[
    float | Annotated[list[float], Field(min_length=1)] | FreeTable | None,
    ReadingOptions.declared()["angle"][1],
]
_Noise = Annotated[float | None, Field(gt=0)]


class _Reading(_Table, ReadingOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """Options of reading data files, named as the flags of the command line."""

    azimuth: float | list[float] | None = None


class CameraTable(_Table, CameraOptions):  # pyright: ignore[reportGeneralTypeIssues]
    """`[camera]`: what sees the colours of a film, and under which light; files are CSV."""


class FileTable(_Reading):
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


class DataTable(_Reading, FitOptions):  # pyright: ignore[reportGeneralTypeIssues]
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


class ReferenceTable(_Table):
    """`[reference]`: the known sample of a contrast, of counts or of relative reflectances."""

    substrate: Medium | PlateTable
    layer: list[LayerTable] = []
    form: Literal["relative", "normalised"] = "relative"


class RecipeTable(_Table):
    """A whole recipe."""

    data: DataTable = DataTable()
    scene: SceneTable
    reference: ReferenceTable | None = None
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
