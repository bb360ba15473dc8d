"""Files of spectra and colours, read by the options of a command or of a recipe."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pellicle.data.options import COLOURS, SPACES, CameraOptions, FileOptions, SpectrumOptions, named
from pellicle.errors import UsageError

if TYPE_CHECKING:
    import numpy as np

    from pellicle.data.colours import Colours
    from pellicle.data.spectrum import Spectrum
    from pellicle.scene.film import Reference, Scene

_PIXELS = ("region", "points")


def of_kind(kind: str) -> set[str]:
    """Names of the reading options that apply to a kind of data."""
    return {name for name, (_, option) in FileOptions.declared().items() if kind in option.kinds}


def read(path: str, options: FileOptions, scene: Scene | None = None) -> list[Spectrum]:
    """Read the spectra of a file that are meant; where the scale of the `scene` is free any level is
    acceptable, and its reference is that of counts or of relative reflectances.

    Points where media of the scene have no data are left out, if half of them remain. Raises DataError or
    UsageError.
    """
    spectra = _read(path, options, scene)
    if scene is None:
        return spectra
    from pellicle.scene.common_range import covered

    return [covered(x, scene) for x in spectra]


def _read(path: str, options: FileOptions, scene: Scene | None) -> list[Spectrum]:
    from pellicle.data.read_counts import has_counts
    from pellicle.data.read_spectrum import read_spectra
    from pellicle.scene.instrument import Drift

    stack = scene.reference if scene is not None and options.signal == "R" else None
    of_counts = options.reference is not None or options.reference_material is not None
    if of_counts or (stack is not None and has_counts(path, options.columns)):
        return [_from_counts(path, options, stack)]
    free_scale = scene is not None and isinstance(scene.instrument.scale, Drift)
    if options.dark is not None:
        raise UsageError("--dark needs --reference: the counts of a sample of known reflectance")
    stated = {name: x for name, x in options.given().items() if name in SpectrumOptions.declared()}
    stated["noise"] = options.noise
    if stack is None:
        return read_spectra(path, calibrated=False if free_scale else None, **stated)
    return [_from_ratio(x, options, stack) for x in read_spectra(path, calibrated=False, **stated)]


def sigma(noise: float | str | None, kind: str) -> float | None:
    """The standard deviation of a `kind` of data. Raises UsageError where it is a share of the signal."""
    from pellicle.signals.limits import noise_of

    return None if noise is None else noise_of(kind, noise)


def _from_counts(path: str, options: FileOptions, stack: Reference | None) -> Spectrum:
    """Reflectance from raw counts of a sample and of a reference: a polished surface, or a `stack`.

    Without a file of the reference, its counts and those without light lie beside those of the sample.
    """
    from pellicle.data.read_counts import (
        read_counts,
        read_counts_beside,
        reflectance_from_counts,
        without_dark_edges,
    )

    if options.signal not in (None, "R"):
        raise UsageError("--reference turns counts into reflectance: leave --signal out, or give R")
    if not isinstance(options.angle, float | int | None):
        raise UsageError("--reference needs a known angle of incidence: give one number")
    table: dict[str, Any] = {"columns": options.columns, "wavelength_unit": options.wavelength_unit}
    sample = read_counts(path, range=options.range, **table)
    reference, dark = (
        read_counts_beside(path, f"{name} counts", **table) if file is None else read_counts(file, **table)
        for name, file in (("reference", options.reference), ("dark", options.dark))
    )
    if reference is None:
        raise UsageError(f"{path}: has no column of reference counts; give their file with --reference")
    if options.range is None:
        sample = without_dark_edges(sample, reference, dark)
    known = _reference_reflectance(sample, options, stack)
    return reflectance_from_counts(sample, reference, known, dark, noise=sigma(options.noise, "counts"))


def _from_ratio(ratio: Spectrum, options: FileOptions, stack: Reference) -> Spectrum:
    """Reflectance from one that is relative to the reflectance of a `stack`."""
    from pellicle.data.read_counts import reflectance_from_ratio

    if ratio.angle is not None or not isinstance(options.angle, float | int | None):
        raise UsageError(
            f"{ratio.path}: reflectances relative to [reference] need one known angle of incidence"
        )
    return reflectance_from_ratio(ratio, _reference_reflectance(ratio, options, stack))


def _reference_reflectance(sample: Spectrum, options: FileOptions, stack: Reference | None) -> np.ndarray:
    from pellicle.recipes.media import medium
    from pellicle.scene.film import Light, Reference, Scene
    from pellicle.scene.layers import Layer
    from pellicle.simulation.spectra import simulate_spectrum

    if stack is None:
        stack = Reference(medium(options.reference_material or "Si", name="`reference_material`"))
    elif options.reference_material is not None:
        raise UsageError(
            "the reference is described twice, by [reference] of the recipe and by --reference-material:"
            " leave one out"
        )
    polarisation = options.polarisation or sample.polarisation
    light = Light(None, options.angle or 0.0, "R", polarisation)
    known = Scene(stack.layers or Layer(1.0, 0.0), stack.substrate, light=light)
    return simulate_spectrum(known, sample.wavelength).values


def is_of_colours(path: str, reading: FileOptions) -> bool:
    """True for a file of colours or a photograph: by the signal, or by the file's content without one."""
    from pellicle.data.colour_rows import is_colour_table
    from pellicle.data.photographs import image_format

    if reading.signal is not None:
        return reading.signal in SPACES
    try:
        return image_format(path) is not None or is_colour_table(path)
    except ValueError:
        return False  # the reader of spectra reports it


def check_words(reading: FileOptions) -> None:
    """Raise UsageError for options that are wrong for every file."""
    from pellicle.data.photographs import parse_regions, whole_numbers

    for name in ("region", "white"):
        if (value := getattr(reading, name)) is not None:
            parse_regions(value, name)
    if reading.points is not None:
        whole_numbers(reading.points, 2, "points", "x,y")
    if reading.dark is not None and reading.reference is None and reading.reference_material is None:
        raise UsageError("--dark needs --reference: the counts of a sample of known reflectance")


def check_camera(given_flags: FileOptions, files: Iterable[tuple[str, FileOptions]]) -> None:
    """Raise UsageError where flags of a camera are given, and none of the files has colours.

    `files` are paths, each with all flags of its reading; one that cannot be read is left to its reader.
    """
    from pellicle.data.photographs import image_format

    wrong = [name for name in given_flags.given() if name in CameraOptions.declared()]
    listed = list(files)
    if not wrong or not listed or any(is_of_colours(path, reading) for path, reading in listed):
        return
    try:
        for path, _ in listed:
            image_format(path)
    except ValueError:
        return
    raise UsageError(f"{listed[0][0]}: {', '.join(named(wrong))}: of colours, and it has none; leave it out")


def refuse_camera(path: str, reading: FileOptions) -> None:
    """Raise UsageError where flags of colours are given and the file has a spectrum."""
    from pellicle.data.photographs import refuse_foreign_image

    wrong = [name for name in _PIXELS if getattr(reading, name) is not None]
    if wrong:
        refuse_foreign_image(path)  # reports a file that does not exist, too
        raise UsageError(
            f"{path}: {', '.join(named(wrong))}: only photographs have pixels, with --signal srgb"
        )


def read_films(path: str, reading: FileOptions, angle: float | list[float] | None = None) -> list[Colours]:
    """Read the colours of every film of a file, or of the one that --spectrum names.

    `angle` is that of all colours, where the flags do not list one for each; None leaves it to the file or
    the scene.

    **Raises:** DataError or UsageError.
    """
    from pellicle.data.read_colours import read_colours_by_film
    from pellicle.data.read_spectrum import ALL

    if wrong := [name for name in reading.given() if name not in of_kind(COLOURS)]:
        raise UsageError(
            f"{path}: {', '.join(named(wrong))}: of spectra, and these are colours; leave it out"
        )
    as_stated = {*CameraOptions.declared(), *_PIXELS, "signal_unit", "columns"} - {"transmitted"}
    options: dict[str, Any] = {name: x for name, x in reading.given().items() if name in as_stated}
    films = read_colours_by_film(
        path,
        space=reading.signal,
        signal="T" if reading.transmitted else "R",
        angle=reading.angle if isinstance(reading.angle, list) else angle,
        polarisation=reading.polarisation or "unpolarised",
        noise=sigma(reading.noise, "colours"),
        **options,
    )
    if reading.spectrum in (None, ALL):
        return films
    chosen = [film for film in films if film.name == reading.spectrum]
    if not chosen:
        known = ", ".join(repr(film.name) for film in films)
        raise UsageError(f"{path}: has no film {reading.spectrum!r}; its films are {known}")
    return chosen
