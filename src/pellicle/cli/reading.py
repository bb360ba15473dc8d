"""Files of spectra and colours for the commands: which kind a file is, and its reading by the options."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pellicle.cli.flags import light, named
from pellicle.cli.session import say
from pellicle.data.options import COLOURS, SPACES, CameraOptions, FileOptions, SpectrumOptions
from pellicle.errors import UsageError

if TYPE_CHECKING:
    import numpy as np

    from pellicle.data.colours import Colours
    from pellicle.data.spectrum import Spectrum
    from pellicle.recipes.film import FilmRecipe
    from pellicle.scene.film import Reference, Scene

_PIXELS = ("region", "points")


def of_kind(kind: str) -> set[str]:
    """Names of the reading options that apply to a kind of data."""
    return {name for name, (_, option) in FileOptions.declared().items() if kind in option.kinds}


def read(path: str, options: FileOptions, scene: Scene | None = None) -> list[Spectrum]:
    """Read the spectra of a file that are meant; where the scale of the `scene` is free any level is
    acceptable, and its reference is that of counts.

    Raises DataError or UsageError.
    """
    from pellicle.data.read_spectrum import read_spectra
    from pellicle.scene.instrument import Drift

    stack = None if scene is None else scene.reference
    of_counts = options.reference is not None or options.reference_material is not None
    if of_counts or (stack is not None and options.signal == "R"):
        return [_from_counts(path, options, stack)]
    free_scale = scene is not None and isinstance(scene.instrument.scale, Drift)
    if options.dark is not None:
        raise UsageError("--dark needs --reference: the counts of a sample of known reflectance")
    stated = {name: x for name, x in options.given().items() if name in SpectrumOptions.declared()}
    stated["noise"] = sigma(options.noise)
    return read_spectra(path, calibrated=False if free_scale else None, **stated)


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


def _from_counts(path: str, options: FileOptions, stack: Reference | None) -> Spectrum:
    """Reflectance from raw counts of a sample and of a reference: a polished surface, or a `stack`.

    Without a file of the reference, its counts and those without light lie beside those of the sample.
    """
    from pellicle.data.read_counts import read_counts, read_counts_beside, reflectance_from_counts

    if options.signal not in (None, "R"):
        raise UsageError("--reference turns counts into reflectance: leave --signal out, or give R")
    if not isinstance(options.angle, float | int | None):
        raise UsageError("--reference needs a known angle of incidence: give one number")
    table: dict[str, Any] = {"columns": options.columns, "wavelength_unit": options.wavelength_unit}
    sample = read_counts(path, range=options.range, **table)
    if options.reference is not None:
        reference = read_counts(options.reference, **table)
    else:
        reference = read_counts_beside(path, "reference counts", **table)
    if reference is None:
        raise UsageError(f"{path}: has no column of reference counts; give their file with --reference")
    if options.dark is not None:
        dark = read_counts(options.dark, **table)
    else:
        dark = read_counts_beside(path, "dark counts", **table)
    known = _reference_reflectance(sample.wavelength, options, stack)
    return reflectance_from_counts(sample, reference, known, dark, noise=sigma(options.noise))


def _reference_reflectance(
    wavelength: np.ndarray, options: FileOptions, stack: Reference | None
) -> np.ndarray:
    from pellicle.recipes.media_words import medium
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
    light = Light(None, options.angle or 0.0, "R", options.polarisation or "unpolarised")
    return simulate_spectrum(
        Scene(stack.layers or Layer(1.0, 0.0), stack.substrate, light=light), wavelength
    ).values


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
    each = list(files)
    if not wrong or not each or any(is_of_colours(path, reading) for path, reading in each):
        return
    try:
        for path, _ in each:
            image_format(path)
    except ValueError:
        return
    raise UsageError(f"{each[0][0]}: {', '.join(named(wrong))}: of colours, and it has none; leave it out")


def refuse_camera(path: str, reading: FileOptions) -> None:
    """Raise UsageError where flags of colours are given and the file has a spectrum."""
    from pellicle.data.photographs import image_format

    wrong = [name for name in _PIXELS if getattr(reading, name) is not None]
    if wrong:
        image_format(path)  # reports a file that does not exist
        raise UsageError(
            f"{path}: {', '.join(named(wrong))}: only photographs have pixels, with --signal srgb"
        )


def read_films(path: str, reading: FileOptions, angle: float | list[float] | None = None) -> list[Colours]:
    """Read the colours of every film of a file, or of the one that --spectrum names.

    `angle` is that of all colours, where the flags do not list one for each; None leaves it to the file or
    the scene.

    **Raises:** DataError or UsageError.
    """
    from pellicle.data.file_spectra import ALL
    from pellicle.data.read_colours import read_colours_by_film

    if wrong := [name for name in reading.given() if name not in of_kind(COLOURS)]:
        raise UsageError(
            f"{path}: {', '.join(named(wrong))}: of spectra, and these are colours; leave it out"
        )
    of_camera = {*CameraOptions.declared(), *_PIXELS} - {"transmitted"}
    options: dict[str, Any] = {name: x for name, x in reading.given().items() if name in of_camera}
    films = read_colours_by_film(
        path,
        space=reading.signal,
        signal="T" if reading.transmitted else "R",
        angle=reading.angle if isinstance(reading.angle, list) else angle,
        polarisation=reading.polarisation or "unpolarised",
        noise=sigma(reading.noise),
        signal_unit=reading.signal_unit,
        columns=reading.columns,
        **options,
    )
    if reading.spectrum in (None, ALL):
        return films
    chosen = [film for film in films if film.name == reading.spectrum]
    if not chosen:
        known = ", ".join(repr(film.name) for film in films)
        raise UsageError(f"{path}: has no film {reading.spectrum!r}; its films are {known}")
    return chosen


def recipe_angles(recipe: FilmRecipe) -> np.ndarray:
    """Angles of incidence (colours,) of a recipe: its list, those of its first file, or its one angle."""
    import numpy as np

    options = FileOptions(**(recipe.each[0] if recipe.each else recipe).reading)
    if recipe.files and not isinstance(options.angle, list):
        stated = read_films(recipe.files[0], options)[0].angle
        if stated is not None:
            say(f"angles: those of {recipe.files[0]} (the recipe gives none)")
            return stated
    angle: Any = light(options).angle
    return np.atleast_1d(np.asarray(getattr(angle, "start", angle), float))
