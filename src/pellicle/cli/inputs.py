"""Data files of a command, each with the scene or surface that is fitted to it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from glob import glob
from logging import getLogger
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pellicle.cli.flags import FileFlags, FitFlags, SceneFlags, light, named
from pellicle.cli.messages import say
from pellicle.cli.reading import (
    check_camera,
    check_words,
    is_of_colours,
    of_kind,
    read,
    read_films,
    refuse_camera,
)
from pellicle.data.options import BRDF, FileOptions, FitOptions
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.data.colours import Colours
    from pellicle.data.spectrum import Spectrum
    from pellicle.recipes.read import FilmRecipe, SurfaceRecipe
    from pellicle.scene.film import Scene
    from pellicle.scene.surface import Surface

log = getLogger(__name__)

LEAST_SQUARES = "least-squares"
_NO_DATA = {".toml", ".md", ".pdf", ".svg", ".html", ".json", ".ipynb", ".py", ".docx", ".log"}
"""Suffixes of files beside data in a folder, which are left out."""


class Input(NamedTuple):
    """A data file, the function that reads it, and the scene or surface that is fitted to it.

    Several spectra of one film in one file are fitted together; films of a file of colours one by one.
    `own_scale` is true where the recipe gives this file a scale or an offset of its own. `file` is the path
    without the `name` of one of several spectra or films in it; empty for a sweep, which no recipe can name.
    """

    path: str
    read: Callable[[], list[Spectrum] | list[Colours] | list[BrdfSamples]]
    scene: Scene | Surface
    own_scale: bool = False
    file: str = ""
    name: str = ""


@dataclass(frozen=True)
class Inputs:
    """Data files, fitted together (`joint`) or one by one, and the options of their fits.

    `repeats` is true where the files are repeated measurements of one spot. `described` is what the scene was
    built from, for the record: the recipe, or the flags. `written` are the options of a recipe that repeats
    the fits; `base` is its scene and `tables` are those of its `[[data.file]]`, where the recipe has them;
    `samples` returns the text of a recipe of several samples with these options in a folder.
    """

    files: list[Input]
    joint: bool
    fitting: FitOptions = field(default_factory=FitOptions)
    residual: str | None = None
    repeats: bool = False
    described: dict[str, Any] | None = None
    written: dict[str, Any] = field(default_factory=dict)
    base: Scene | None = None
    tables: list[dict[str, Any]] = field(default_factory=list)
    samples: Callable[[dict[str, Any], Path], str] | None = None

    @property
    def loss(self) -> str:
        """Loss of the fits."""
        return self.fitting.loss or LEAST_SQUARES

    @property
    def tolerance(self) -> float:
        """Largest error of the effects that the fits leave out."""
        return self.fitting.tolerance or 0.0

    @property
    def groups(self) -> list[list[Input]]:
        """Files of each fit."""
        return [self.files] if self.joint else [[file] for file in self.files]

    def recipe(self, files: list[Input], folder: Path) -> str:
        """Text of a recipe in `folder` that repeats the fit of a group. Raises UsageError where none can."""
        from pellicle.recipes.write import recipe_text

        if self.samples is not None:
            return self.samples(self.fitting.given(), folder)
        if not all(file.file for file in files):
            raise UsageError("a recipe cannot name one of several sweeps")
        paths = list(dict.fromkeys(file.file for file in files))
        options = self.written | ({"joint": True} if self.joint else {})
        if isinstance(noise := options.get("noise"), str) and "%" not in noise:
            sigma = getattr(files[0].read()[0], "sigma", None)
            if sigma is not None and (sigma == float(noise)).all():  # not in the unit of a file in percent
                options["noise"] = float(noise)
        if not self.joint and files[0].name:
            options["spectrum"] = files[0].name
        if self.base is None:
            return recipe_text(files[0].scene, folder, files=paths, reading=options)
        tables = [table for table in self.tables if table["path"] in paths]
        return recipe_text(self.base, folder, reading=options, tables=tables)


def inputs(
    files: list[str],
    recipe: str | None,
    scene_flags: SceneFlags | None = None,
    reading_flags: FileFlags | None = None,
    fit_flags: FitFlags | None = None,
    joint: bool = False,
    repeats: bool | None = None,
) -> Inputs:
    """Combine files, recipe and flags; with `repeats` None that of the recipe is ignored.

    Raises UsageError or DataError where something is missing or wrong.
    """
    for file in files:
        if file.lower().endswith(".toml"):
            raise UsageError(f"{file}: is a recipe, and data were expected: write --recipe {file}")
    files = [path for file in files for path in _matching(file)]
    scene_flags = scene_flags or SceneFlags()
    reading = FileOptions() if reading_flags is None else reading_flags.options()
    fitting = FitOptions() if fit_flags is None else fit_flags.options()
    if recipe is None:
        result = _by_flags(files, scene_flags, reading)
        described: dict[str, Any] = {"flags": {n: x for n, x in vars(scene_flags).items() if x is not None}}
    else:
        from pellicle.recipes.read import SurfaceRecipe, read_recipe

        table = read_recipe(recipe)
        if scene_flags.given():
            flags = ", ".join(scene_flags.given())
            raise UsageError(f"{flags} and --recipe exclude each other: describe the scene in the recipe")
        if isinstance(table, SurfaceRecipe):
            result = _by_surface_recipe(files, table, reading)
        else:
            result = _by_film_recipe(files, table, reading)
        described = {"recipe": recipe}
    described |= {"reading": how} if (how := reading.given() | fitting.given()) else {}
    options = FitOptions(**result.fitting.given() | fitting.given())
    written = result.written | options.given()
    joint = joint or result.joint
    result = replace(result, joint=joint, fitting=options, described=described, written=written)
    return result if repeats is None or not (repeats or result.repeats) else _as_repeats(result)


def _matching(file: str) -> list[str]:
    """The files of a folder, or of a pattern such as wafer/*.csv, which shells of Windows leave as it is, in
    natural order: 2 before 10. Any other path is itself."""
    path = Path(file)
    if path.is_dir():
        inside = [each for each in path.iterdir() if each.is_file() and not each.name.startswith((".", "~"))]
        found = [str(each) for each in inside if each.suffix.lower() not in _NO_DATA]
        if len(found) < len(inside):
            say(f"{file}: {len(found)} files of data; {len(inside) - len(found)} others are left out")
    elif path.exists() or not any(mark in file for mark in "*?["):
        return [file]
    else:
        found = glob(file, recursive=True)
    if not found:
        raise DataError(
            f"{file}: no file of data is there; name files, as in wafer/*.csv, or a folder of them"
        )
    numbered = partial(re.split, r"(\d+)")
    return sorted(found, key=lambda name: [int(x) if x.isdigit() else x for x in numbered(name)])


def _as_repeats(files: Inputs) -> Inputs:
    """Inputs of repeated measurements, each sweep of a file by itself."""
    if files.joint:
        raise UsageError(
            "repeats are fitted one by one, and a joint fit takes all files together: choose one"
        )
    sweeps = [sweep for file in files.files for sweep in _sweeps(file)]
    if len(sweeps) < 2:
        raise UsageError("repeats are two files or more, or several sweeps in one; leave --repeats out")
    return replace(files, files=sweeps, repeats=True)


def _sweeps(file: Input) -> list[Input]:
    """One input for each sweep of a file; the file itself where it has one, or cannot be read."""
    try:
        [one] = file.read()
        count = len(getattr(one, "sweeps", ()))
    except ValueError:  # more than one, or an error that is reported when it is fitted
        return [file]
    sweeps = [file._replace(read=partial(_sweep, file.read, i), file="") for i in range(count)]
    return sweeps or [file]


def _sweep(read_file: Callable[[], Any], number: int) -> list[Spectrum]:
    [one] = read_file()
    note, sweep = f"sweep {number + 1} of {len(one.sweeps)}", one.sweeps[number]
    return [replace(sweep, notes=(*sweep.notes, note))]


def _by_flags(files: list[str], scene_flags: SceneFlags, reading: FileOptions) -> Inputs:
    from pellicle.scene.free import check_free_count, free_leaves

    _check_film(reading)
    if not files:
        raise UsageError(
            "no data: name the file, as in pellicle fit oxide.csv --layer SiO2 --substrate Si, or give a"
            " --recipe that does; pellicle demo is an example, --help lists every flag"
        )
    scene = scene_flags.scene(reading)
    if not scene_flags.thickness:
        say("thickness: 1 to 5000 nm, since no --thickness was given")
    check_free_count(len(free_leaves(scene)))
    check_camera(reading, [(file, reading) for file in files])
    inputs = [one for file in files for one in _film_inputs(file, scene, reading)]
    return Inputs(inputs, False, written=_without_light(reading.given()))


def _by_film_recipe(files: list[str], recipe: FilmRecipe, reading: FileOptions) -> Inputs:
    import equinox as eqx

    _check_film(reading)
    if recipe.each and files:
        own = "[[sample]]" if recipe.tables.sample else "[[data.file]]"
        raise UsageError(f"{recipe.path}: {own} and files on the command line exclude each other")
    files = _files(files, recipe)
    recipes = recipe.each or [recipe] * len(files)
    options = [FileOptions.of(one.reading | reading.given()) for one in recipes]
    check_camera(reading, zip(files, options, strict=True))
    inputs = []
    for file, how, one in zip(files, options, recipes, strict=True):
        scene = one.scene(fitted=True)
        scene = eqx.tree_at(lambda s: s.light, scene, light(how, scene.light.azimuth))
        own_scale = any(x.rescales for x in (*one.tables.data.file, one.sample) if x is not None)
        inputs += _film_inputs(file, scene, how, own_scale)
    data = recipe.tables.data
    if recipe.tables.sample:
        from pellicle.recipes.write import samples_text

        written = partial(samples_text, recipe, reading.given())
        return Inputs(inputs, True, FitOptions.of(data.given()), samples=written)
    result = Inputs(inputs, data.joint, FitOptions.of(data.given()), repeats=data.repeats)
    if not recipe.each:
        return replace(result, written=_without_light(recipe.reading | reading.given()))
    tables = [
        table.model_dump(exclude_unset=True)
        | recipe.with_paths(table)
        | {"path": file, "camera": recipe.with_paths(table.camera)}
        | reading.given()
        for file, table in zip(files, data.file, strict=True)
    ]
    return replace(result, written=_without_light(recipe.reading), base=recipe.scene(), tables=tables)


def _without_light(options: dict[str, Any]) -> dict[str, Any]:
    """The options that the light of a scene does not state."""
    return {name: x for name, x in options.items() if name not in ("angle", "polarisation")}


def _by_surface_recipe(files: list[str], recipe: SurfaceRecipe, reading: FileOptions) -> Inputs:
    if refused := [name for name in reading.given() if name not in of_kind(BRDF)]:
        flags = ", ".join(named(refused))
        raise UsageError(f"{flags} cannot be used on a BRDF; the recipe describes the surface")
    if reading.signal not in (None, "brdf"):
        raise UsageError(f"{recipe.path}: describes a surface, whose signal is brdf, not {reading.signal}")
    if reading.noise is not None:
        from pellicle.signals.limits import noise_level

        noise_level(reading.noise, "--noise")
    recipe = recipe.with_data(**{name: x for name, x in reading.given().items() if name != "signal"})
    surface = recipe.scene(fitted=True)
    paths = _files(files, recipe)
    inputs = [Input(path, partial(_samples, recipe, surface, path), surface, file=path) for path in paths]
    data = recipe.tables.data
    written = data.model_dump(exclude_none=True, exclude={"signal", "files"})
    return Inputs(inputs, False, FitOptions.of(data.given()), residual=data.residual, written=written)


def _files(files: list[str], recipe: FilmRecipe | SurfaceRecipe) -> list[str]:
    if not (files or recipe.files):
        raise UsageError(
            f"{recipe.path}: names no data files: give them on the command line or in [data] files"
        )
    return files or recipe.files


def _film_inputs(path: str, scene: Scene, reading: FileOptions, own_scale: bool = False) -> list[Input]:
    """One input for a file of a film; one for each film of a file of colours, and with --spectrum all for
    each of several spectra."""
    from pellicle.data.read_spectrum import ALL

    of_colours = is_of_colours(path, reading)
    if not of_colours:
        refuse_camera(path, reading)
    read_file = partial(read_films, path, reading) if of_colours else partial(read, path, reading, scene)
    whole = Input(path, read_file, scene, own_scale, path)
    if not of_colours and reading.spectrum != ALL:
        return [whole]
    try:
        parts = read_file()
    except ValueError:
        return [whole]  # the error is reported when it is fitted
    if len(parts) == 1:
        return [whole._replace(read=partial(list, parts))]
    return [whole._replace(path=one.source, read=partial(list, [one]), name=one.name) for one in parts]


def _samples(recipe: SurfaceRecipe, surface: Surface, path: str) -> list[BrdfSamples]:
    samples = recipe.read(path)
    channels = ", ".join(samples.channels)
    log.info("surface: %s, by %d samples of %s", surface.model, len(samples), channels)
    for number in surface.free_numbers():
        log.info("free: %s between %g and %g", number.name, number.free.lower, number.free.upper)
    return [samples]


def _check_film(reading: FileOptions) -> None:
    """Raise UsageError for options that are wrong for every file of a film."""
    if reading.signal == "brdf":
        raise UsageError("--signal brdf needs a --recipe that describes the surface under [scene.surface]")
    from pellicle.signals.limits import check_noise

    check_words(reading)
    check_noise(reading.noise)
