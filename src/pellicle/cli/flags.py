"""The flags that describe a scene and say how files are read, shared by the commands that fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Group, Parameter

SCENE = Group("Scene", sort_key=1)
INSTRUMENT = Group("Instrument", sort_key=2)
READING = Group("Reading", sort_key=3)
SAMPLER = Group("Sampler", sort_key=4)
OUTPUT = Group("Output", sort_key=5)


def flag(group: Group, help: str) -> Parameter:
    """A flag that takes a value, and what `--help` says of it."""
    return Parameter(group=group, help=help)


def switch(group: Group, help: str) -> Parameter:
    """A flag without a value, and without a --no- twin."""
    return Parameter(group=group, help=help, negative="")


@dataclass(frozen=True)
class SceneWords:
    """The flags that describe a scene, None where not given."""

    layer: Annotated[
        str | None,
        flag(
            SCENE,
            "The layer: a material (SiO2), an index (1.46, 2.9+0.1j), an n,k CSV, or a model: constant, "
            "cauchy, cauchy-urbach, sellmeier, lorentz, drude, gaussian, tauc-lorentz, cody-lorentz, spline "
            "or spline-kk, its numbers free; cauchy(1.46,3000) fixes them. A recipe also mixes and adds "
            "models.",
        ),
    ] = None
    substrate: Annotated[str | None, flag(SCENE, "What it lies on; the same words.")] = None
    ambient: Annotated[str | None, flag(SCENE, "What it is seen from (air).")] = None
    thickness: Annotated[str | None, flag(SCENE, "LO:HI in nm (1:5000), or one number to fix it.")] = None
    free: Annotated[str | None, flag(SCENE, "Numbers of the layer to free: n,k or n=1.3:1.7.")] = None
    back: Annotated[str | None, flag(SCENE, "The substrate is a plate; the medium behind it.")] = None
    plate_mm: Annotated[float | None, flag(SCENE, "The plate's thickness in mm (1).")] = None
    scale: Annotated[str | None, flag(INSTRUMENT, "free, slow or a number (1).")] = None
    offset: Annotated[str | None, flag(INSTRUMENT, "free, slow or a number (0).")] = None
    bandwidth: Annotated[
        str | None, flag(INSTRUMENT, "Full width at half maximum in nm, free, or LO:HI.")
    ] = None

    def given(self) -> list[str]:
        """The flags that were used."""
        return [f"--{name.replace('_', '-')}" for name, value in vars(self).items() if value is not None]


@dataclass(frozen=True)
class ReadWords:
    """The flags that say how a file is read; a recipe's [data] fills what was not given."""

    signal: Annotated[str | None, flag(READING, "R, T or psi-delta, where the file does not say.")] = None
    angle: Annotated[float | None, flag(READING, "Angle of incidence in degrees (0).")] = None
    polarisation: Annotated[str | None, flag(READING, "s, p or unpolarised.")] = None
    range: Annotated[
        str | tuple[float, float] | None,
        Parameter(group=READING, help="Wavelengths to keep in nm.", metavar="LO:HI", negative="", n_tokens=1),
    ] = None
    noise: Annotated[
        float | None, flag(READING, "Standard deviation of every point; degrees for psi-delta.")
    ] = None
    loss: Annotated[
        str | None, flag(READING, "least-squares, or huber or student-t: outliers hardly count.")
    ] = None
    columns: Annotated[
        str | list[str] | None,
        Parameter(
            group=READING, help="Names of the columns in order, _ to skip.", metavar="NAME,...", negative=""
        ),
    ] = None
    wavelength_unit: Annotated[str | None, flag(READING, "nm, um, A, eV or cm-1.")] = None
    signal_unit: Annotated[str | None, flag(READING, "fraction or percent.")] = None
    reference: Annotated[
        str | None, flag(READING, "Raw counts of a bare reference: DATA are raw counts too.")
    ] = None
    reference_material: Annotated[str, flag(READING, "What the reference is.")] = "Si"
    dark: Annotated[str | None, flag(READING, "Raw counts without light.")] = None
    folded: Annotated[
        bool | None, Parameter(group=READING, help="Δ is known in 0 to 180 degrees only.", negative="")
    ] = None
    analyser: Annotated[
        float | None, flag(READING, "Of columns alpha and beta: the analyser's angle in degrees.")
    ] = None
    spot: Annotated[int | None, flag(READING, "Which spot of an Accurion file, from 1.")] = None
