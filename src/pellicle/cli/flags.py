"""Flags of the commands and of cubes, by group; those of reading and fits follow from `data/options.py`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, make_dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Generic, TypeVar, get_args

from cyclopts import Group, Parameter

from pellicle.data.options import COLOURS as OF_COLOURS
from pellicle.data.options import (
    CameraOptions,
    FileOptions,
    FitOptions,
    Option,
    Options,
    length_range,
    named,
    parse_signal,
)
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.recipes.read import FilmRecipe
    from pellicle.scene.film import Light, Scene


SCENE = Group("Scene", sort_key=1)
INSTRUMENT = Group("Instrument", sort_key=2)
READING = Group("Reading", sort_key=3)
SAMPLER = Group("Sampler", sort_key=4)
OUTPUT = Group("Output", sort_key=5)
COLOURS = Group("Colours", sort_key=6)
DEFAULT_THICKNESS = "1:5000"

Record = TypeVar("Record", bound=Options)
Kind = TypeVar("Kind", bound="OptionFlags")


def flag(group: Group, help: str | None = None, **how: Any) -> Parameter:
    """A flag with a value; without `help`, the text below the field of a class is its help."""
    # help=None would hide that text
    return Parameter(group=group, **how) if help is None else Parameter(group=group, help=help, **how)


def switch(group: Group, help: str | None = None, **how: Any) -> Parameter:
    """A flag without a --no- form, such as one without a value."""
    return flag(group, help, negative="", **how)


class Flags:
    """Base of the groups of flags."""

    def given(self) -> list[str]:
        """The flags that the user gave."""
        return named(name for name, value in vars(self).items() if value is not None)


class OptionFlags(Flags, Generic[Record]):
    """Base of the flags of a record of options."""

    record: ClassVar[type[Options]]

    def options(self) -> Record:
        """The options that the flags give. Raises UsageError for a wrong value."""
        values = {}
        for name, (_, option) in self.record.declared().items():
            value = getattr(self, name, None)
            if value is not None:
                value = option.parse(value, f"`{name}`") if option.parse and isinstance(value, str) else value
                try:
                    values[name] = option.check(value)
                except UsageError:
                    raise
                except ValueError as error:
                    raise UsageError(f"`{name}` {error}") from None
        made: Any = self.record(**values)
        return made


def flags_of(record: type[Options], *names: str) -> Callable[[type[Kind]], type[Kind]]:
    """Return a decorator that gives a class a flag for each option of a record, or for `names` of them."""

    def decorate(cls: type[Kind]) -> type[Kind]:
        declared = {name: record.declared()[name] for name in names or record.declared()}
        made = [(name, _flag_type(*about), field(default=None)) for name, about in declared.items()]
        space = {"record": record, "__doc__": cls.__doc__, "__module__": cls.__module__}
        flags: Any = make_dataclass(
            cls.__name__, made, bases=(cls,), namespace=space, frozen=True, kw_only=True
        )
        return flags

    return decorate


def _flag_type(hint: Any, option: Option) -> Any:
    """Type of a flag: text where the option parses it, else the first type of the option."""
    group = COLOURS if option.kinds == (OF_COLOURS,) else READING
    kind = str if option.parse is not None else get_args(hint)[0]
    negative = None if option.negative else ""
    return Annotated[kind | None, flag(group, option.help, metavar=option.metavar or None, negative=negative)]


@flags_of(CameraOptions)
class CameraFlags(OptionFlags[CameraOptions]):
    """Flags of what sees colours; a recipe's [camera] supplies what is not given."""


@flags_of(FileOptions)
class FileFlags(OptionFlags[FileOptions]):
    """Flags for reading files; a recipe's [data] and [camera] supply what is not given."""


@flags_of(FitOptions)
class FitFlags(OptionFlags[FitOptions]):
    """Flags of a fit; a recipe's [data] supplies what is not given."""


@dataclass(frozen=True)
class SceneFlags(Flags):
    """Flags that describe a scene, None where not given."""

    layer: Annotated[
        str | None,
        flag(
            SCENE,
            "Layer: a material (SiO2), an index (1.46, 2.9+0.1j), a file of n and k, or a dispersion "
            "model: constant, cauchy, cauchy-urbach, sellmeier, lorentz, gaussian, brendel-bormann, drude, "
            "drude-smith, tauc-lorentz, cody-lorentz, new-amorphous, forouhi-bloomer, critical-point, cppb, "
            "adachi-m0, adachi-m1, psemi, tanguy, gervais, harmonic-oscillators, uv-pole, ir-pole, spline or "
            "spline-kk, with free parameters; cauchy(1.46,3000) fixes them. "
            "Recipes can also mix and add models.",
        ),
    ] = None
    substrate: Annotated[str | None, flag(SCENE, "Substrate: the same forms as --layer.")] = None
    ambient: Annotated[str | None, flag(SCENE, "Medium in front of the layer (air).")] = None
    thickness: Annotated[str | None, flag(SCENE)] = None
    """Bounds LO:HI in nm (1:5000), or one number to fix it."""
    free: Annotated[
        str | None,
        flag(
            SCENE,
            "Parameters of the layer to free: n,k or A=1.4:1.6. To the index of a material or a model, n "
            "and k are added (n=-0.1:0.1); of a number they are the index (n=1.3:1.7).",
        ),
    ] = None
    back: Annotated[str | None, flag(SCENE)] = None
    """Medium behind a substrate that is a plate; or rough, or taped."""
    plate_mm: Annotated[float | None, flag(SCENE, "Thickness of the plate in mm (1).")] = None
    back_collected: Annotated[str | None, flag(SCENE)] = None
    """Share of the light from the back face that is collected, 0 to 1, free, or LO:HI (1)."""
    back_reflections: Annotated[int | None, flag(SCENE)] = None
    """Most reflections at the back face of light that is collected (any number)."""
    scale: Annotated[str | None, flag(INSTRUMENT, "free, slow or a number (1).")] = None
    offset: Annotated[str | None, flag(INSTRUMENT, "free, slow or a number (0).")] = None
    bandwidth: Annotated[str | None, flag(INSTRUMENT)] = None
    """Full width at half maximum in nm, free, or LO:HI."""
    uncertainty: Annotated[str | None, flag(INSTRUMENT)] = None
    """usual: errors include those of ordinary instruments and samples; or none."""

    def scene(self, reading: FileOptions) -> Scene:
        """Build the scene that the flags describe, in the light of `reading`.

        **Raises:** UsageError for a missing flag or a value out of range; DataError for a table of n and k
        that cannot be read.
        """
        try:
            return self._scene(reading)
        except (UsageError, DataError):
            raise
        except ValueError as error:
            raise UsageError(str(error)) from None

    def _scene(self, reading: FileOptions) -> Scene:
        from pellicle.recipes import media as w
        from pellicle.scene.film import Scene
        from pellicle.scene.free import Free
        from pellicle.scene.instrument import Instrument
        from pellicle.scene.layers import SCATTERING_BACKS, Layer, Substrate
        from pellicle.scene.uncertainty import Uncertainty

        layer, substrate = self.layer, self.substrate
        if layer is None or substrate is None:
            missing = "--layer" if layer is None else "--substrate"
            raise UsageError(
                f"{missing} is missing: give layer and substrate, as in "
                "--layer SiO2 --substrate Si, or give a --recipe"
            )
        if self.uncertainty not in (None, "usual", "none"):
            raise UsageError(f"--uncertainty must be usual or none, not {self.uncertainty!r}")
        if self.plate_mm is not None and self.back is None:
            raise UsageError("--plate-mm needs --back: which medium lies behind the plate, as in --back air")
        if self.plate_mm is not None and not 0 < self.plate_mm < inf:
            raise UsageError(f"--plate-mm must be a finite number above zero, got {self.plate_mm:g}")
        free = [item.strip() for item in (self.free or "").split(",") if item.strip()]
        film = Layer(w.medium(layer, free), w.thickness(self.thickness or DEFAULT_THICKNESS))
        part, lit = self.back_collected, light(reading)
        collected = None if part is None else w.free_or_number(part, "`back_collected`", Free(0.0, 1.0))
        if self.back in SCATTERING_BACKS:
            back, collected = w.scattering_back(self.back, lit.signal, (collected, self.back_reflections))
        else:
            back = None if self.back is None else w.medium(self.back, name="`back`")
        material = w.medium(substrate, name="`substrate`")
        plate = {"back_collected": collected, "back_reflections": self.back_reflections}
        bandwidth, slit = self.bandwidth, Free(0.0, 20.0, start=2.0, limits=(0.0, 50.0))
        return Scene(
            film,
            Substrate(material, back, self.plate_mm or 1.0, **plate),
            ambient=w.medium(self.ambient or "air", name="`ambient`"),
            light=lit,
            instrument=Instrument(
                w.drift(self.scale or "1", "`scale`"),
                w.drift(self.offset or "0", "`offset`"),
                None if bandwidth is None else w.free_or_number(bandwidth, "`bandwidth`", slit),
            ),
            uncertainty=Uncertainty() if self.uncertainty != "none" else Uncertainty.none(),
        )


def light(reading: FileOptions, azimuth: Any = None) -> Light:
    """Signal, angle and polarisation of a scene, where the file does not give them.

    `azimuth` of the sample in degrees is that of a recipe: films that have one cannot be described by flags.
    """
    from pellicle.recipes import read

    return read.light(reading, reading.transmitted, azimuth)


FEWEST_STEPS = 10


@dataclass(frozen=True)
class SamplerFlags(Flags):
    """Flags of the sampling of a posterior."""

    walkers: Annotated[int | None, flag(SAMPLER)] = None
    """Number of walkers, even (four per parameter, at least 32)."""
    steps: Annotated[int | None, flag(SAMPLER, "Maximum number of steps (20000).")] = None
    seed: Annotated[int, flag(SAMPLER, "Seed of the random numbers.")] = 0

    def checked(self) -> SamplerFlags:
        """These flags. Raises UsageError for an impossible number."""
        if self.steps is not None and self.steps < FEWEST_STEPS:
            raise UsageError(f"--steps must be at least {FEWEST_STEPS}, got {self.steps}")
        if self.walkers is not None and (self.walkers < 4 or self.walkers % 2):
            raise UsageError(f"--walkers must be an even number of at least 4, got {self.walkers}")
        if not 0 <= self.seed < 2**32:
            raise UsageError(f"--seed must lie in 0 to 4294967295, got {self.seed}")
        return self


@dataclass(frozen=True)
class BatchFlags(Flags):
    """Flags of the results of several files."""

    out: Annotated[str | None, flag(OUTPUT)] = None
    """Folder for report, figures and tables; an interrupted chain in it is continued."""
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object a line.")] = False
    jobs: Annotated[int | None, flag(OUTPUT)] = None
    """Number of processes that share several files; by default more than one where this saves time."""
    refit: Annotated[bool, switch(OUTPUT)] = False
    """Fit all files, also those whose results an earlier run left in --out."""
    spec: Annotated[list[str] | None, switch(OUTPUT, metavar="NAME=LO:HI")] = None
    """Limits of a parameter: pass, fail or undecided by its 95 % error; several may be given."""
    figure: Annotated[str | None, flag(OUTPUT, metavar="NAME.pdf")] = None
    """Figure for a paper, 86 mm wide: data, fit, residuals, n and k (.pdf, .svg or .png)."""

    def checked(self) -> BatchFlags:
        """These flags. Raises UsageError for an impossible number of processes."""
        if self.jobs is not None and self.jobs < 1:
            raise UsageError(f"--jobs must be at least 1, got {self.jobs}")
        if self.spec:
            from pellicle.reporting.specification import parse_limits

            parse_limits(self.spec)
        return self


FRAMES = Group("Camera frames", sort_key=6)

OF_RECIPE = ("signal", "polarisation", "noise", "range", "wavelength_unit", "signal_unit")
"""Keys of a recipe's [data] that supply flags which are not given."""


@dataclass(frozen=True)
class CubeOnlyFlags(Flags):
    """Flags that only a cube has, None where not given."""

    variable: Annotated[str | None, flag(READING)] = None
    """Name of the variable to read, where a cube has several."""
    wavelengths: Annotated[
        str | None,
        flag(
            READING,
            "Wavelengths of a cube's bands, where its file has none: START:STOP:STEP, numbers with "
            "commas, or a file with one a line.",
        ),
    ] = None
    without_bands: Annotated[str | None, flag(READING)] = None
    """Dead bands to leave out in nm: LO:HI or single ones, as in 755:775,820."""
    mask: Annotated[str | None, flag(READING)] = None
    """Pixels to use: PNG, TIFF or .npy that is not zero there, or the name of a variable."""
    white_frame: Annotated[str | None, flag(FRAMES)] = None
    """Counts of a white reference: an image, a line or a spectrum; the cube is counts too."""
    dark_frame: Annotated[str | None, flag(FRAMES, "Counts without light, in the same forms.")] = None
    white_reflectance: Annotated[float | str | None, switch(FRAMES)] = None
    """Reflectance of the white: a number, a CSV, or a material such as Si (1)."""
    saturation: Annotated[float | None, flag(FRAMES)] = None
    """Counts from which a pixel is saturated (the largest of its type)."""


@dataclass(frozen=True)
class CubeFlags(CubeOnlyFlags):
    """Flags for reading a cube, None where not given; a recipe's [data] supplies some."""

    wavelength_unit: Annotated[str | None, flag(READING, "nm, um, A, eV, cm-1 or THz.")] = None
    signal: Annotated[str | None, flag(READING, "R, T or psi-delta, if the file does not name it.")] = None
    signal_unit: Annotated[str | None, flag(READING)] = None
    """fraction, percent, absorbance, or the stored number that stands for 1."""
    angle: Annotated[float | None, flag(READING, "Angle of incidence in degrees (the recipe's).")] = None
    polarisation: Annotated[str | None, flag(READING, "s, p or unpolarised.")] = None
    range: Annotated[str | tuple[float, float] | None, switch(READING, metavar="LO:HI", n_tokens=1)] = None
    """Wavelengths to use in nm."""
    noise: Annotated[
        float | str | None,
        switch(
            READING,
            'Standard deviation of every point (degrees for psi-delta), "2 %" of the signal, or the '
            "name of a variable.",
            metavar="SIGMA",
        ),
    ] = None

    def arguments(self, recipe: FilmRecipe | None = None) -> dict[str, Any]:
        """Arguments of `read_cube`, supplemented by the recipe's [data]. Raises UsageError."""
        options = {} if recipe is None else {name: getattr(recipe.tables.data, name) for name in OF_RECIPE}
        options |= vars(self) | {name: options[name] for name in options if getattr(self, name) is None}
        options = {name: value for name, value in options.items() if value is not None}
        if isinstance(self.range, str):
            options["range"] = length_range(self.range, "`range`")
        if self.signal is not None:
            options["signal"] = parse_signal(self.signal)
        if isinstance(self.white_reflectance, str):
            light = {name: options[name] for name in ("angle", "polarisation") if name in options}
            options["white_reflectance"] = _reflectance(self.white_reflectance, light)
        return options


def _reflectance(white: str, light: dict[str, Any]) -> Any:
    """The reflectance of a white reference: a number, the path of a CSV, or a function of the wavelength for
    a material or its file."""
    import numpy as np

    from pellicle.recipes.media import medium
    from pellicle.simulation.functions import reflectance

    with suppress(ValueError):
        return float(white)
    if Path(white).is_file() and not _has_an_index(white):
        return white
    material = medium(white, name="`white_reflectance`")
    return lambda nm: np.asarray(reflectance(nm, 0.0, 1.0, material, **light))


def _has_an_index(path: str) -> bool:
    """True of a table of n and k, which is no spectrum."""
    from pellicle.data.read_spectrum import read_spectrum
    from pellicle.recipes.media import medium

    with suppress(DataError):
        read_spectrum(path)
        return False
    with suppress(DataError):
        medium(path)
        return True
    return False
