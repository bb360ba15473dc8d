"""Flags that describe how a cube of spectra is read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from pellicle.cli.flags import READING, Flags, flag
from pellicle.data.options import parse_range

if TYPE_CHECKING:
    from pellicle.recipes.film import FilmRecipe

FRAMES = Group("Camera frames", sort_key=6)

OF_RECIPE = ("signal", "polarisation", "noise", "range", "wavelength_unit", "signal_unit")
"""Keys of a recipe's [data] that supply flags which are not given."""


@dataclass(frozen=True)
class CubeOnlyFlags(Flags):
    """Flags that only a cube has, None where not given."""

    variable: Annotated[
        str | None, flag(READING, "Name of the variable to read, where a cube has several.")
    ] = None
    wavelengths: Annotated[
        str | None,
        flag(
            READING,
            "Wavelengths of a cube's bands, where its file has none: START:STOP:STEP, numbers with commas, "
            "or a file with one a line.",
        ),
    ] = None
    without_bands: Annotated[
        str | None, flag(READING, "Dead bands to leave out in nm: LO:HI or single ones, as in 755:775,820.")
    ] = None
    mask: Annotated[
        str | None,
        flag(READING, "Pixels to use: PNG, TIFF or .npy that is not zero there, or the name of a variable."),
    ] = None
    white_frame: Annotated[
        str | None,
        flag(FRAMES, "Counts of a white reference: an image, a line or a spectrum; the cube is counts too."),
    ] = None
    dark_frame: Annotated[str | None, flag(FRAMES, "Counts without light, in the same forms.")] = None
    white_reflectance: Annotated[
        float | str | None,
        Parameter(
            group=FRAMES,
            help="Reflectance of the white: a number, a CSV, or a material such as Si (1).",
            negative="",
        ),
    ] = None
    saturation: Annotated[
        float | None, flag(FRAMES, "Counts from which a pixel is saturated (the largest of its type).")
    ] = None


@dataclass(frozen=True)
class CubeFlags(CubeOnlyFlags):
    """Flags for reading a cube, None where not given; a recipe's [data] supplies some."""

    wavelength_unit: Annotated[str | None, flag(READING, "nm, um, A, eV, cm-1 or THz.")] = None
    signal: Annotated[str | None, flag(READING, "R, T or psi-delta, if the file does not name it.")] = None
    signal_unit: Annotated[
        str | None, flag(READING, "fraction, percent, absorbance, or the stored number that stands for 1.")
    ] = None
    angle: Annotated[float | None, flag(READING, "Angle of incidence in degrees (the recipe's).")] = None
    polarisation: Annotated[str | None, flag(READING, "s, p or unpolarised.")] = None
    range: Annotated[
        str | tuple[float, float] | None,
        Parameter(group=READING, help="Wavelengths to use in nm.", metavar="LO:HI", negative="", n_tokens=1),
    ] = None
    noise: Annotated[
        float | str | None,
        Parameter(
            group=READING,
            help='Standard deviation of every point (degrees for psi-delta), "2 %" of the signal, or the '
            "name of a variable.",
            metavar="SIGMA",
            negative="",
        ),
    ] = None


def merged(flags: CubeFlags, recipe: FilmRecipe) -> CubeFlags:
    """The flags, supplemented by the recipe's [data]."""
    absent = [name for name in OF_RECIPE if getattr(flags, name) is None]
    return replace(flags, **{name: getattr(recipe.tables.data, name, None) for name in absent})


def reading(flags: CubeFlags) -> dict[str, Any]:
    """Arguments of `read_cube` that are given. Raises UsageError."""
    options = {name: value for name, value in vars(flags).items() if value is not None}
    if isinstance(flags.range, str):
        options["range"] = parse_range(flags.range, "`range`")
    if isinstance(flags.white_reflectance, str):
        options["white_reflectance"] = _reflectance(flags.white_reflectance, flags)
    return options


def _reflectance(white: str, flags: CubeFlags) -> Any:
    """The reflectance of a white reference: a number, the path of a CSV, or a function of the wavelength."""
    from pathlib import Path

    import numpy as np

    try:
        return float(white)
    except ValueError:
        if Path(white).is_file():
            return white

    from pellicle.recipes.media_words import medium
    from pellicle.simulation.functions import reflectance

    material = medium(white, name="`white_reflectance`")
    light: dict[str, Any] = {
        "angle": flags.angle or 0.0,
        "polarisation": flags.polarisation or "unpolarised",
    }
    return lambda nm: np.asarray(reflectance(nm, 0.0, 1.0, material, **light))
