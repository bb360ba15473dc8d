"""Flags that describe a scene and the reading of files, shared by the commands that fit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Group, Parameter, Token

SCENE = Group("Scene", sort_key=1)
INSTRUMENT = Group("Instrument", sort_key=2)
READING = Group("Reading", sort_key=3)
SAMPLER = Group("Sampler", sort_key=4)
OUTPUT = Group("Output", sort_key=5)
COLOURS = Group("Colours", sort_key=6)


def flag(group: Group, help: str) -> Parameter:
    """A flag with a value."""
    return Parameter(group=group, help=help)


def switch(group: Group, help: str) -> Parameter:
    """A flag without a value, and without a --no- form."""
    return Parameter(group=group, help=help, negative="")


def one_or_several_angles(_: Any, tokens: Sequence[Token]) -> float | list[float]:
    """Convert a number, or several with commas between them."""
    try:
        angles = [float(word) for word in tokens[0].value.split(",")]
    except ValueError:
        raise ValueError(f"expected degrees such as 70, or 0,30,60, got {tokens[0].value!r}") from None
    return angles[0] if len(angles) == 1 else angles


def given(names: Iterable[str]) -> list[str]:
    """The flags of arguments: `plate_mm` is --plate-mm."""
    return [f"--{name.replace('_', '-')}" for name in names]


class Flags:
    """Base of the groups of flags."""

    def given(self) -> list[str]:
        """The flags that the user gave."""
        return given(name for name, value in vars(self).items() if value is not None)


@dataclass(frozen=True)
class SceneFlags(Flags):
    """Flags that describe a scene, None where not given."""

    layer: Annotated[
        str | None,
        flag(
            SCENE,
            "Layer: a material (SiO2), an index (1.46, 2.9+0.1j), a file of n and k, or a dispersion model: "
            "constant, cauchy, cauchy-urbach, sellmeier, lorentz, drude, gaussian, tauc-lorentz, "
            "cody-lorentz, spline or spline-kk, with free parameters; cauchy(1.46,3000) fixes them. Recipes "
            "can also mix and add models.",
        ),
    ] = None
    substrate: Annotated[str | None, flag(SCENE, "Substrate: the same forms as --layer.")] = None
    ambient: Annotated[str | None, flag(SCENE, "Medium in front of the layer (air).")] = None
    thickness: Annotated[str | None, flag(SCENE, "Bounds LO:HI in nm (1:5000), or one number to fix it.")] = (
        None
    )
    free: Annotated[
        str | None,
        flag(
            SCENE,
            "Parameters of the layer to free: n,k or A=1.4:1.6. To the index of a material or a model, n and "
            "k are added (n=-0.1:0.1); of a number they are the index (n=1.3:1.7).",
        ),
    ] = None
    back: Annotated[
        str | None, flag(SCENE, "Medium behind a substrate that is a plate; or rough, or taped.")
    ] = None
    plate_mm: Annotated[float | None, flag(SCENE, "Thickness of the plate in mm (1).")] = None
    back_collected: Annotated[
        str | None,
        flag(SCENE, "Share of the light from the back face that is collected, 0 to 1, free, or LO:HI (1)."),
    ] = None
    back_reflections: Annotated[
        int | None, flag(SCENE, "Most reflections at the back face of light that is collected (any number).")
    ] = None
    scale: Annotated[str | None, flag(INSTRUMENT, "free, slow or a number (1).")] = None
    offset: Annotated[str | None, flag(INSTRUMENT, "free, slow or a number (0).")] = None
    bandwidth: Annotated[
        str | None, flag(INSTRUMENT, "Full width at half maximum in nm, free, or LO:HI.")
    ] = None
    uncertainty: Annotated[
        str | None,
        flag(INSTRUMENT, "usual: errors include those of ordinary instruments and samples; or none."),
    ] = None


@dataclass(frozen=True)
class CameraFlags(Flags):
    """Flags of what sees colours; a recipe's [camera] supplies what is None."""

    observer: Annotated[str | None, flag(COLOURS, "1931 (2 degrees) or 1964 (10 degrees).")] = None
    illuminant: Annotated[str | None, flag(COLOURS, "E, A, D50, D55, D65 or D75 (D65).")] = None
    lamp: Annotated[str | None, flag(COLOURS, "CSV of the lamp's spectrum, for --illuminant.")] = None
    sensitivities: Annotated[
        str | None, flag(COLOURS, "CSV of a camera's three sensitivities (signal rgb).")
    ] = None
    chart: Annotated[
        str | None, flag(COLOURS, "CSV of a photographed chart: R, G, B and reference X, Y, Z (signal rgb).")
    ] = None
    gamma: Annotated[float | None, flag(COLOURS, "Coding of the signal rgb: linear^(1/GAMMA) (1).")] = None
    white_balance: Annotated[
        str | None, flag(COLOURS, "fixed, or free for an unknown factor of each channel.")
    ] = None
    white: Annotated[
        str | None, flag(COLOURS, "X,Y,WIDTH,HEIGHT of a white in the photograph, in pixels.")
    ] = None
    transmitted: Annotated[
        bool | None, Parameter(group=COLOURS, help="The light has passed the film.", negative="")
    ] = None


@dataclass(frozen=True)
class ReadingFlags(CameraFlags):
    """Flags for reading files; a recipe's [data] and [camera] supply what is None."""

    spectrum: Annotated[
        str | None, flag(READING, "Name of one of several spectra or films in a file, or all.")
    ] = None
    signal: Annotated[
        str | None,
        flag(
            READING,
            "R, T, psi-delta, mueller, generalised-psi-delta, srgb, rgb, xyz or lab (that of the file).",
        ),
    ] = None
    region: Annotated[
        str | None,
        flag(COLOURS, "X,Y,WIDTH,HEIGHT of a film in a photograph, in pixels; ';' between several."),
    ] = None
    points: Annotated[str | None, flag(COLOURS, "X,Y of a film in a photograph; ';' between several.")] = None
    angle: Annotated[
        float | list[float] | None,
        Parameter(
            group=READING,
            help="Angle of incidence in degrees (0); 0,30,60 where regions of a photograph show one film.",
            metavar="DEG",
            converter=one_or_several_angles,
            negative="",
            n_tokens=1,
        ),
    ] = None
    polarisation: Annotated[str | None, flag(READING, "s, p or unpolarised.")] = None
    range: Annotated[
        str | tuple[float, float] | None,
        Parameter(group=READING, help="Wavelengths to use in nm.", metavar="LO:HI", negative="", n_tokens=1),
    ] = None
    noise: Annotated[
        float | str | None,
        Parameter(
            group=READING,
            help='Standard deviation of every point (degrees for psi-delta), or "2 %" of the BRDF.',
            metavar="SIGMA",
            negative="",
        ),
    ] = None
    loss: Annotated[
        str | None, flag(READING, "least-squares, or huber or student-t to give outliers little weight.")
    ] = None
    columns: Annotated[
        str | list[str] | None,
        Parameter(
            group=READING, help="Names of the columns in order, _ to skip.", metavar="NAME,...", negative=""
        ),
    ] = None
    wavelength_unit: Annotated[str | None, flag(READING, "nm, um, A, eV, cm-1 or THz.")] = None
    signal_unit: Annotated[
        str | None, flag(READING, "fraction, percent or absorbance; 8-bit or 16-bit of colours.")
    ] = None
    reference: Annotated[
        str | None, flag(READING, "Raw counts of a bare reference; DATA are then raw counts too.")
    ] = None
    reference_material: Annotated[str | None, flag(READING, "Material of the reference (Si).")] = None
    dark: Annotated[str | None, flag(READING, "Raw counts without light.")] = None
    folded: Annotated[
        bool | None,
        Parameter(
            group=READING,
            help="Δ is known in 0 to 180 degrees only: cos Δ (by default where it has kinks there).",
        ),
    ] = None
    analyser: Annotated[
        float | None, flag(READING, "Analyser angle in degrees (for alpha and beta columns).")
    ] = None
    spot: Annotated[int | None, flag(READING, "Spot of an Accurion file, counted from 1.")] = None
    elements: Annotated[
        str | list[str] | None,
        Parameter(
            group=READING,
            help="Elements of a Mueller matrix, or ratios ane, aps, asp, to use (all).",
            metavar="m12,...",
            negative="",
            n_tokens=1,
        ),
    ] = None
