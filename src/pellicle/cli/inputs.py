"""Data files of a command, each with the scene or surface that is fitted to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from logging import getLogger
from typing import TYPE_CHECKING, Any, NamedTuple

from pellicle.cli.colours import check_camera, check_words, is_of_colours, read_films, refuse_camera
from pellicle.cli.flags import ReadingFlags, SceneFlags, given
from pellicle.cli.options import light, merged, read, scene_from_flags, sigma, wavelength_range
from pellicle.cli.session import say
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.data.colours import Colours
    from pellicle.data.spectrum import Spectrum
    from pellicle.recipes.film import FilmRecipe
    from pellicle.recipes.surface import SurfaceRecipe
    from pellicle.scene.film import Scene
    from pellicle.scene.surface import Surface

log = getLogger(__name__)

LEAST_SQUARES = "least-squares"
_SIGNALS = ("R", "T", "psi-delta", "mueller", "generalised-psi-delta", "srgb", "rgb", "xyz", "lab")
_FOR_SURFACES = ("columns", "noise", "signal", "loss")
"""Reading flags that BRDF samples can be given."""


class Input(NamedTuple):
    """A data file, the function that reads it, and the scene or surface that is fitted to it.

    Several spectra of one film in one file are fitted together; films of a file of colours one by one.
    `own_scale` is true where the recipe gives this file a scale or an offset of its own.
    """

    path: str
    read: Callable[[], list[Spectrum] | list[Colours] | list[BrdfSamples]]
    scene: Scene | Surface
    own_scale: bool = False


class Inputs(NamedTuple):
    """Data files, fitted together (`joint`) or one by one, and the options of their fits.

    `repeats` is true where the files are repeated measurements of one spot. `described` is what the scene was
    built from, for the record: the recipe, or the flags.
    """

    files: list[Input]
    joint: bool
    loss: str = LEAST_SQUARES
    residual: str | None = None
    repeats: bool = False
    described: dict[str, Any] | None = None

    @property
    def groups(self) -> list[list[Input]]:
        """Files of each fit."""
        return [self.files] if self.joint else [[file] for file in self.files]


def inputs(
    files: list[str],
    recipe: str | None,
    scene_flags: SceneFlags,
    reading: ReadingFlags,
    joint: bool,
    repeats: bool | None = None,
) -> Inputs:
    """Combine files, recipe and flags; with `repeats` None that of the recipe is ignored.

    Raises UsageError or DataError where something is missing or wrong.
    """
    if recipe is None:
        result = _by_flags(files, scene_flags, reading)
    else:
        from pellicle.recipes import read_recipe
        from pellicle.recipes.surface import SurfaceRecipe

        described = read_recipe(recipe)
        if scene_flags.given():
            flags = ", ".join(scene_flags.given())
            raise UsageError(f"{flags} and --recipe exclude each other: describe the scene in the recipe")
        if isinstance(described, SurfaceRecipe):
            result = _by_surface_recipe(files, described, reading)
        else:
            result = _by_recipe(files, described, reading)
    flags, how = (
        {name: value for name, value in vars(given).items() if value is not None}
        for given in (scene_flags, reading)
    )
    described_by = {"flags": flags} if recipe is None else {"recipe": recipe}
    described_by |= {"reading": how} if how else {}
    result = result._replace(joint=joint or result.joint, described=described_by)
    return result if repeats is None else _as_repeats(result, repeats or result.repeats)


def _as_repeats(files: Inputs, repeats: bool) -> Inputs:
    """Inputs of repeated measurements, each sweep of a file by itself; unchanged where they are none."""
    if not repeats:
        return files
    if files.joint:
        raise UsageError(
            "repeats are fitted one by one, and a joint fit takes all files together: choose one"
        )
    each = [sweep for file in files.files for sweep in _sweeps(file)]
    if len(each) < 2:
        raise UsageError("repeats are two files or more, or several sweeps in one; leave --repeats out")
    return files._replace(files=each, repeats=True)


def _sweeps(file: Input) -> list[Input]:
    """One input for each sweep of a file; the file itself where it has one, or cannot be read."""
    try:
        [one] = file.read()
        count = len(getattr(one, "sweeps", ()))
    except ValueError:  # more than one, or an error that is reported when it is fitted
        return [file]
    return [file._replace(read=partial(_sweep, file.read, i)) for i in range(count)] or [file]


def _sweep(read_file: Callable[[], Any], number: int) -> list[Spectrum]:
    [one] = read_file()
    note = f"sweep {number + 1} of {len(one.sweeps)}"
    return [replace(one.sweeps[number], notes=(*one.sweeps[number].notes, note))]


def _by_flags(files: list[str], scene_flags: SceneFlags, reading: ReadingFlags) -> Inputs:
    if reading.signal == "brdf":
        raise UsageError("--signal brdf needs a --recipe that describes the surface under [scene.surface]")
    _check_reading(reading, _SIGNALS)
    if not files:
        raise UsageError(
            "no data: name the file, as in pellicle fit oxide.csv --layer SiO2 --substrate Si, or give a"
            " --recipe that does; pellicle demo is an example, --help lists every flag"
        )
    reading = replace(reading, range=wavelength_range(reading.range))
    scene, assumed = scene_from_flags(scene_flags, reading)
    say(*assumed)
    _check_free(scene)
    check_camera(reading, [(file, reading) for file in files])
    inputs = [one for file in files for one in _film_inputs(file, scene, reading)]
    return Inputs(inputs, False, reading.loss or LEAST_SQUARES)


def _by_recipe(files: list[str], recipe: FilmRecipe, reading: ReadingFlags) -> Inputs:
    import equinox as eqx

    _check_reading(reading, _SIGNALS)
    reading = replace(reading, range=wavelength_range(reading.range))
    if recipe.each and files:
        raise UsageError(f"{recipe.path}: [[data.file]] and files on the command line exclude each other")
    files = _files(files, recipe)
    recipes = recipe.each or [recipe] * len(files)
    each = [(file, merged(reading, own)) for file, own in zip(files, recipes, strict=True)]
    check_camera(reading, each)
    inputs = []
    for (file, flags), own in zip(each, recipes, strict=True):
        scene = own.scene()
        scene = eqx.tree_at(lambda s: s.light, scene, light(flags, scene.light.azimuth))
        _check_free(scene, recipe.path)
        own_scale = any(table.rescales for table in own.tables.data.file)
        inputs += _film_inputs(file, scene, flags, own_scale)
    data = recipe.tables.data
    loss = reading.loss or data.loss or LEAST_SQUARES
    return Inputs(inputs, data.joint, loss, repeats=data.repeats)


def _by_surface_recipe(files: list[str], recipe: SurfaceRecipe, reading: ReadingFlags) -> Inputs:
    if refused := [flag for flag in reading.given() if flag not in given(_FOR_SURFACES)]:
        raise UsageError(f"{', '.join(refused)} cannot be used on a BRDF; the recipe describes the surface")
    if reading.signal not in (None, "brdf"):
        raise UsageError(f"{recipe.path}: describes a surface, whose signal is brdf, not {reading.signal}")
    _check_reading(reading, ("brdf",))
    flags = {name: getattr(reading, name) for name in ("columns", "noise")}
    recipe = recipe.with_data(**{name: value for name, value in flags.items() if value is not None})
    surface = recipe.scene()
    _check_free(surface, recipe.path)
    paths = _files(files, recipe)
    inputs = [Input(path, partial(_samples, recipe, surface, path), surface) for path in paths]
    return Inputs(inputs, False, reading.loss or LEAST_SQUARES, recipe.tables.data.residual)


def _files(files: list[str], recipe: FilmRecipe | SurfaceRecipe) -> list[str]:
    if not (files or recipe.files):
        raise UsageError(
            f"{recipe.path}: names no data files: give them on the command line or in [data] files"
        )
    return files or recipe.files


def _film_inputs(path: str, scene: Scene, reading: ReadingFlags, own_scale: bool = False) -> list[Input]:
    """One input for a file of a film; one for each film of a file of colours, and with --spectrum all for
    each of several spectra."""
    from pellicle.data.file_spectra import ALL
    from pellicle.scene.instrument import Drift

    if is_of_colours(path, reading):
        try:
            films = read_films(path, reading)
        except ValueError:
            return [Input(path, partial(read_films, path, reading), scene, own_scale)]
        labels = [film.source if len(films) > 1 else path for film in films]
        each = zip(labels, films, strict=True)
        return [Input(label, partial(list, [film]), scene, own_scale) for label, film in each]
    refuse_camera(path, reading)
    read_file = partial(read, path, reading, free_scale=isinstance(scene.instrument.scale, Drift))
    if reading.spectrum == ALL:
        try:
            found = read_file()
        except ValueError:
            found = []  # reported when it is fitted
        if len(found) > 1:
            return [Input(f"{path} [{one.name}]", partial(list, [one]), scene, own_scale) for one in found]
    return [Input(path, read_file, scene, own_scale)]


def _samples(recipe: SurfaceRecipe, surface: Surface, path: str) -> list[BrdfSamples]:
    samples = recipe.read(path)
    channels = ", ".join(samples.channels)
    log.info("surface: %s, by %d samples of %s", surface.model, len(samples), channels)
    for number in surface.free_numbers():
        log.info("free: %s between %g and %g", number.name, number.free.lower, number.free.upper)
    return [samples]


def _check_free(scene: Scene | Surface, recipe: str = "") -> None:
    """Raise UsageError where nothing is free to fit, DataError where a recipe says so."""
    from pellicle.scene.free import check_free_count, free_leaves
    from pellicle.scene.surface import Surface

    free = scene.free_numbers() if isinstance(scene, Surface) else free_leaves(scene)
    try:
        check_free_count(len(free))
    except UsageError as error:
        if recipe:
            raise DataError(f"{recipe}: {error}") from None
        raise


def _check_reading(reading: ReadingFlags, signals: tuple[str, ...]) -> None:
    if reading.signal not in (None, *signals):
        names = f"{', '.join(signals[:-1])} or {signals[-1]}"
        raise UsageError(f"--signal must be {names}, not {reading.signal!r}")
    stated = reading.angle if isinstance(reading.angle, list) else [reading.angle]
    if wrong := [angle for angle in stated if angle is not None and not 0 <= angle <= 90]:
        raise UsageError(f"--angle must lie in 0 to 90 degrees, got {wrong[0]:g}")
    if reading.polarisation not in (None, "s", "p", "unpolarised"):
        raise UsageError(f"--polarisation must be s, p or unpolarised, not {reading.polarisation!r}")
    check_words(reading)
    if reading.noise is not None:
        from pellicle.data.noise_level import noise_level

        if signals == ("brdf",):
            noise_level(reading.noise, "--noise")
        else:
            sigma(reading.noise)
    if reading.loss is not None:
        from pellicle.fitting.robust_losses import check_loss

        check_loss(reading.loss, "--loss")
    if reading.dark is not None and reading.reference is None and reading.reference_material is None:
        raise UsageError("--dark needs --reference: the counts of a sample of known reflectance")
    from pellicle.data.tabular.units import BITS, SIGNAL_UNITS, WAVELENGTH_UNITS, colour_unit, wavelength_unit

    for flag, value, known, find in (
        ("--wavelength-unit", reading.wavelength_unit, WAVELENGTH_UNITS, wavelength_unit),
        ("--signal-unit", reading.signal_unit, (*SIGNAL_UNITS, *BITS), colour_unit),
    ):
        if value is not None and find(value) is None:
            raise UsageError(f"{flag} must be one of {', '.join(known)}, not {value!r}")
