"""Files of spectra and colours for the commands, and the wavelengths at which a recipe is simulated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pellicle.cli.flags import light, named
from pellicle.cli.messages import say
from pellicle.data.options import COLOURS, SPACES, CameraOptions, FileOptions, SpectrumOptions
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    import numpy as np

    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.data.colours import Colours
    from pellicle.data.spectrum import Spectrum
    from pellicle.recipes.read import FilmRecipe, SurfaceRecipe
    from pellicle.scene.film import Reference, Scene
    from pellicle.simulation.brdf import Directions


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


def recipe_angles(recipe: FilmRecipe) -> np.ndarray:
    """Angles of incidence (colours,) of a recipe: its list, those of its first file, or its one angle."""
    import numpy as np

    options = FileOptions(**recipe.first.reading)
    if recipe.files and not isinstance(options.angle, list):
        stated = read_films(recipe.files[0], options)[0].angle
        if stated is not None:
            say(f"angles: those of {recipe.files[0]} (the recipe gives none)")
            return stated
    angle: Any = light(options).angle
    return np.atleast_1d(np.asarray(getattr(angle, "start", angle), float))


MOST = 1_000_000
"""Most wavelengths of a simulation: more result from a mistaken step."""


def measured_scene(recipe: FilmRecipe) -> tuple[Scene, np.ndarray]:
    """The scene in the light of the recipe and its wavelengths: the recipe's, or those of its first file."""
    data = recipe.tables.data
    if recipe.first.tables.data.signal in SPACES:
        return _in_colours(recipe)
    if recipe.files and data.wavelengths is None:
        scene, nm = _as_measured(recipe)
    else:
        scene = recipe.scene()
        scene, nm = each_setting(scene, wavelengths(recipe, scene))
    if scene.light.ellipsometric and scene.light.largest_angle == 0.0:
        raise DataError(f"{recipe.path}: ellipsometry needs an angle of incidence: give [data] angle = 70")
    return scene, nm


def refuse_wavelengths(recipe: FilmRecipe) -> None:
    """Raise DataError where a recipe of colours has wavelengths."""
    if recipe.tables.data.wavelengths is not None:
        raise DataError(
            f"{recipe.path}: [data] wavelengths: colours take those of their sensor; leave them out"
        )


def _in_colours(recipe: FilmRecipe) -> tuple[Scene, np.ndarray]:
    """The scene at each angle of its colours, and the wavelengths of the sensor for each."""
    import equinox as eqx
    import numpy as np

    refuse_wavelengths(recipe)
    scene, angles = recipe.first.scene(), recipe_angles(recipe)
    nm = recipe.first.sight().sensor.wavelength
    say(f"wavelengths: {nm[0]:g} to {nm[-1]:g} nm every 1 nm, those of the sensor")
    angle: Any = scene.light.angle if len(angles) == 1 else np.repeat(angles, len(nm))
    light = replace(scene.light, wavelength=None, angle=angle)
    return eqx.tree_at(lambda s: s.light, scene, light), np.tile(nm, len(angles))


def _as_measured(recipe: FilmRecipe) -> tuple[Scene, np.ndarray]:
    """The scene in the light of the recipe's first file, at the first of its angles and azimuths."""
    import equinox as eqx
    import numpy as np

    from pellicle.scene.film import Light

    path = recipe.files[0]
    scene, options = recipe.first.scene(), FileOptions(**recipe.first.reading)
    spectrum = read(path, options, scene)[0]
    say(f"wavelengths: those of {path} (the recipe gives none)")
    stated, first = light(options), spectrum.settings[0]
    angle = stated.angle if spectrum.angle is None else first.angle
    azimuth = scene.light.azimuth if first.azimuth is None else first.azimuth or None
    polarised = spectrum.polarisation if spectrum.polarisation != "unpolarised" else stated.polarisation
    seen = Light(None, angle, spectrum.signal, polarised, azimuth, spectrum.transmission)
    return eqx.tree_at(lambda s: s.light, scene, seen), np.sort(spectrum.wavelength[first.rows])


def each_setting(scene: Scene, nm: np.ndarray) -> tuple[Scene, np.ndarray]:
    """The scene and the wavelengths at each angle and azimuth that a recipe lists, one after the other."""
    import numpy as np

    from pellicle.scene.film import with_wavelength

    angles, azimuths = scene.light.angle, scene.light.azimuth
    if not np.ndim(angles) and not np.ndim(azimuths):
        return scene, nm
    several, turns, repeated = np.size(angles), np.size(azimuths), {}
    if np.ndim(angles):
        repeated["angle"] = np.repeat(angles, turns * len(nm))
    if np.ndim(azimuths):
        repeated["azimuth"] = np.tile(np.repeat(azimuths, len(nm)), several)
    return with_wavelength(scene, scene.light.wavelength, **repeated), np.tile(nm, several * turns)


def wavelengths(recipe: FilmRecipe, scene: Scene) -> np.ndarray:
    """The recipe's wavelengths, or the visible ones that every material has data for."""
    import numpy as np

    from pellicle.simulation.spectra import VISIBLE, default_wavelengths

    grid = recipe.tables.data.wavelengths
    if grid is None:
        nm = default_wavelengths(scene)
        if len(nm) < 2:
            raise DataError(
                f"{recipe.path}: the materials share no wavelengths in {VISIBLE[0]:g} to {VISIBLE[1]:g} nm:"
                " give [data] wavelengths = { start, stop, step }"
            )
        say(f"wavelengths: {nm[0]:g} to {nm[-1]:g} nm every {VISIBLE[2]:g} nm (the recipe gives none)")
        return nm
    stated = f"{recipe.path}: [data] wavelengths"
    if isinstance(grid, list):
        nm = np.array(grid)
    elif (grid.stop - grid.start) / grid.step > MOST:
        raise DataError(f"{stated} are more than {MOST:,} points: give a larger step")
    else:
        nm = np.arange(grid.start, grid.stop + grid.step / 2, grid.step)
    if not len(nm) or not np.all(np.diff(nm) > 0) or nm[0] <= 0:
        raise DataError(f"{stated} must be rising positive numbers")
    return nm


def directions(recipe: SurfaceRecipe) -> Directions | BrdfSamples:
    """Directions of the recipe's first file, or default ones spread over the lobe and around it."""
    from pellicle.simulation.brdf import default_directions

    if recipe.files:
        say(f"directions: those of {recipe.files[0]}")
        return recipe.read(recipe.files[0])
    pairs = default_directions()
    say(f"directions: {len(pairs.theta_i)} spread over the lobe and around it (the recipe names no files)")
    return pairs
