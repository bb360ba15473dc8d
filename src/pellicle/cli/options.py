"""Flags to a scene, and to the reading of a data file."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any

from pellicle.cli.flags import ReadingFlags, SceneFlags
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.data.spectrum import Spectrum
    from pellicle.recipes.film import FilmRecipe
    from pellicle.scene.film import Light, Scene

DEFAULT_THICKNESS = "1:5000"


def scene_from_flags(flags: SceneFlags, reading: ReadingFlags) -> tuple[Scene, list[str]]:
    """Build the scene that the flags describe; returns it and the assumptions made. Raises UsageError."""
    from pellicle.recipes import media_words as w
    from pellicle.scene.film import Scene
    from pellicle.scene.free import Free
    from pellicle.scene.instrument import Instrument
    from pellicle.scene.layers import SCATTERING_BACKS, Layer, Substrate, Uncertainty

    if flags.layer is None or flags.substrate is None:
        missing = "--layer" if flags.layer is None else "--substrate"
        raise UsageError(
            f"{missing} is missing: give layer and substrate, as in "
            "--layer SiO2 --substrate Si, or give a --recipe"
        )
    if flags.uncertainty not in (None, "usual", "none"):
        raise UsageError(f"--uncertainty must be usual or none, not {flags.uncertainty!r}")
    if flags.plate_mm is not None and flags.back is None:
        raise UsageError("--plate-mm needs --back: which medium lies behind the plate, as in --back air")
    if flags.plate_mm is not None and not 0 < flags.plate_mm < inf:
        raise UsageError(f"--plate-mm must be a finite number above zero, got {flags.plate_mm:g}")
    free = [item.strip() for item in (flags.free or "").split(",") if item.strip()]
    assumed = [] if flags.thickness else ["thickness: 1 to 5000 nm, since no --thickness was given"]
    layer = Layer(w.medium(flags.layer, free), w.thickness(flags.thickness or DEFAULT_THICKNESS))
    part = flags.back_collected
    collected = None if part is None else w.free_or_number(part, "`back_collected`", Free(0.0, 1.0))
    if flags.back in SCATTERING_BACKS:
        stated = collected, flags.back_reflections
        back, collected = w.scattering_back(flags.back, light(reading).signal, stated)
    else:
        back = None if flags.back is None else w.medium(flags.back, name="`back`")
    bandwidth, slit = flags.bandwidth, Free(0.0, 20.0, start=2.0, limits=(0.0, 50.0))
    scene = Scene(
        layer,
        Substrate(
            w.medium(flags.substrate, name="`substrate`"),
            back,
            flags.plate_mm or 1.0,
            back_collected=collected,
            back_reflections=flags.back_reflections,
        ),
        ambient=w.medium(flags.ambient or "air", name="`ambient`"),
        light=light(reading),
        instrument=Instrument(
            w.drift(flags.scale or "1", "`scale`"),
            w.drift(flags.offset or "0", "`offset`"),
            None if bandwidth is None else w.free_or_number(bandwidth, "`bandwidth`", slit),
        ),
        uncertainty=Uncertainty() if flags.uncertainty != "none" else Uncertainty.none(),
    )
    return scene, assumed


def light(reading: ReadingFlags, azimuth: Any = None) -> Light:
    """Signal, angle and polarisation of a scene, where the file does not give them.

    `azimuth` of the sample in degrees is that of a recipe: films that have one cannot be described by flags.
    """
    from pellicle.recipes.film import incidence, light_signal
    from pellicle.scene.film import Light

    signal = light_signal(reading.signal, reading.transmitted)
    return Light(None, incidence(reading.angle), signal, reading.polarisation or "unpolarised", azimuth)


def merged(reading: ReadingFlags, recipe: FilmRecipe) -> ReadingFlags:
    """The flags, supplemented by the recipe's [data] and [camera]."""
    data, camera = recipe.tables.data, recipe.camera
    absent = [name for name, value in vars(reading).items() if value is None]
    return replace(reading, **{name: camera.get(name, getattr(data, name, None)) for name in absent})


def read(path: str, flags: ReadingFlags, *, free_scale: bool) -> list[Spectrum]:
    """Read the spectra of a file that are meant; with a `free_scale` any level is acceptable.

    Raises DataError or UsageError.
    """
    from pellicle.data.read_spectrum import read_spectra

    if flags.reference is not None or flags.reference_material is not None:
        return [_from_counts(path, flags)]
    if flags.dark is not None:
        raise UsageError("--dark needs --reference: the counts of a sample of known reflectance")
    return read_spectra(
        path,
        spectrum=flags.spectrum,
        signal=flags.signal,
        columns=flags.columns,
        wavelength_unit=flags.wavelength_unit,
        signal_unit=flags.signal_unit,
        range=wavelength_range(flags.range),
        noise=sigma(flags.noise),
        polarisation=flags.polarisation,
        calibrated=False if free_scale else None,
        folded=flags.folded,
        analyser=flags.analyser,
        spot=flags.spot,
        elements=_names(flags.elements),
    )


def _names(value: str | list[str] | None) -> list[str] | None:
    """Names of a flag, separated by commas, or of a recipe."""
    return [name.strip() for name in value.split(",")] if isinstance(value, str) else value


def sigma(noise: float | str | None) -> float | None:
    """The standard deviation of a spectrum. Raises UsageError where the noise is a share of the signal."""
    from pellicle.data.noise_level import noise_level

    if noise is None:
        return None
    level = noise_level(noise)
    if level.relative:
        raise UsageError(
            f"`noise` {level} is a share of the signal, which only BRDF samples can have: give the standard "
            "deviation of a spectrum as a number, or a sigma column in its file"
        )
    return level.value


def wavelength_range(value: str | tuple[float, float] | None) -> tuple[float, float] | None:
    """Convert `LO:HI` (nm) of a flag, or the bounds of a recipe. Raises UsageError."""
    if not isinstance(value, str):
        return value
    from pellicle.recipes.number_words import parse_range

    return parse_range(value, "`range`")


def _from_counts(path: str, flags: ReadingFlags) -> Spectrum:
    """Reflectance from raw counts of a sample and of a bare reference (a polished surface).

    Without a file of the reference, its counts and those without light lie beside those of the sample.
    """
    import numpy as np

    from pellicle.data.read_counts import read_counts, read_counts_beside, reflectance_from_counts
    from pellicle.recipes.media_words import medium
    from pellicle.simulation.functions import reflectance

    if flags.signal not in (None, "R"):
        raise UsageError("--reference turns counts into reflectance: leave --signal out, or give R")
    if not isinstance(flags.angle, float | int | None):
        raise UsageError("--reference needs a known angle of incidence: give one number")
    options: dict[str, Any] = {"columns": flags.columns, "wavelength_unit": flags.wavelength_unit}
    sample = read_counts(path, range=wavelength_range(flags.range), **options)
    if flags.reference is not None:
        reference = read_counts(flags.reference, **options)
    else:
        reference = read_counts_beside(path, "reference counts", **options)
    if reference is None:
        raise UsageError(f"{path}: has no column of reference counts; give their file with --reference")
    if flags.dark is not None:
        dark = read_counts(flags.dark, **options)
    else:
        dark = read_counts_beside(path, "dark counts", **options)
    known = reflectance(
        sample.wavelength,
        0.0,
        1.0,
        medium(flags.reference_material or "Si", name="`reference_material`"),
        angle=flags.angle or 0.0,
        polarisation=flags.polarisation or "unpolarised",
    )
    return reflectance_from_counts(sample, reference, np.asarray(known), dark, noise=sigma(flags.noise))
