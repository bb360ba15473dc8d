"""Fits that a recipe describes: its data files, each with the scene or surface that is fitted to it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from logging import getLogger
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pellicle.api.data_files import (
    check_camera,
    check_words,
    is_of_colours,
    of_kind,
    read,
    read_films,
    refuse_camera,
)
from pellicle.data.options import BRDF, FileOptions, FitOptions, named
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.data.colours import Colours
    from pellicle.data.spectrum import Spectrum
    from pellicle.recipes.read import FilmRecipe, SurfaceRecipe
    from pellicle.scene.film import Scene
    from pellicle.scene.surface import Surface

log = getLogger(__name__)

LEAST_SQUARES = "least-squares"


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


def _by_film_recipe(files: list[str], recipe: FilmRecipe, reading: FileOptions) -> Inputs:
    import equinox as eqx

    from pellicle.recipes.read import light

    check_film(reading)
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
        scene = eqx.tree_at(lambda s: s.light, scene, light(how, how.transmitted, scene.light.azimuth))
        own_scale = any(x.rescales for x in (*one.tables.data.file, one.sample) if x is not None)
        inputs += film_inputs(file, scene, how, own_scale)
    data = recipe.tables.data
    if recipe.tables.sample:
        from pellicle.recipes.write import samples_text

        written = partial(samples_text, recipe, reading.given())
        return Inputs(inputs, True, FitOptions.of(data.given()), samples=written)
    result = Inputs(inputs, data.joint, FitOptions.of(data.given()), repeats=data.repeats)
    if not recipe.each:
        return replace(result, written=without_light(recipe.reading | reading.given()))
    tables = [
        table.model_dump(exclude_unset=True)
        | recipe.with_paths(table)
        | {"path": file, "camera": recipe.with_paths(table.camera)}
        | reading.given()
        for file, table in zip(files, data.file, strict=True)
    ]
    return replace(result, written=without_light(recipe.reading), base=recipe.scene(), tables=tables)


def without_light(options: dict[str, Any]) -> dict[str, Any]:
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


def film_inputs(path: str, scene: Scene, reading: FileOptions, own_scale: bool = False) -> list[Input]:
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


def check_film(reading: FileOptions) -> None:
    """Raise UsageError for options that are wrong for every file of a film."""
    if reading.signal == "brdf":
        raise UsageError("--signal brdf needs a --recipe that describes the surface under [scene.surface]")
    from pellicle.signals.limits import check_noise

    check_words(reading)
    check_noise(reading.noise)


def measurement(
    files: list[Input], joint: bool, say: Callable[[str], object] | None = None
) -> tuple[Spectrum | BrdfSamples | list[Any], Scene | Surface | list[Scene]]:
    """Read files: data and scene as `pellicle.fit` takes them, lists in a joint fit.

    `say` is called with each note of the readers.
    """
    from pellicle.data.spectrum import Spectrum
    from pellicle.fitting.film.problem import without_scale
    from pellicle.scene.film import Scene
    from pellicle.scene.surface import Surface

    data, scenes = [], []
    for file in files:
        spectra = file.read()
        for values in spectra:
            if say is not None:
                for note in values.notes:
                    say(f"{file.path}: {note}")
            shared = len(files) + len(spectra) > 2 and not file.own_scale
            scene = file.scene
            if shared and isinstance(values, Spectrum) and isinstance(scene, Scene):
                scene = without_scale(scene, values)
            data.append(values)
            scenes.append(scene)
    if not joint and len(data) == 1:
        return data[0], scenes[0]
    return data, scenes[0] if isinstance(scenes[0], Surface) else scenes


def read_problems(
    recipe: str | os.PathLike[str], files: Sequence[str | os.PathLike[str]] = ()
) -> list[tuple[Any, Any, dict[str, Any]]]:
    """Read the data files of a recipe, or other `files`: data, scene and options of each of its fits.

    `pellicle.fit` takes them as `pellicle fit --recipe` does: all files are one fit where the recipe is joint
    or has samples, else each file is one.

    **Arguments:** `recipe`, the path of a recipe; `files`, data files in place of those that it names.

    **Returns:** a list with data, scene and options for each fit. The options are those that the recipe
    gives: `tolerance`, a robust `loss`, which `pellicle.sample` does not take, and `residual` of a BRDF.

    **Raises:** DataError or UsageError as `pellicle.read_recipe` and the readers of files do.

    ```python
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> path = pl.write_spectrum(folder / "film.csv", pl.simulate(pl.Scene(pl.Layer("SiO2", 500.0), "Si")))
    >>> film = pl.Scene(pl.Layer("SiO2", pl.Free(10, 3000)), "Si")
    >>> pl.write_recipe(film, folder / "recipe.toml", files=[folder / "film.csv"])
    >>> [(data, scene, options)] = pl.read_problems(folder / "recipe.toml")
    >>> len(data), scene.layers[0].thickness.upper, options
    (201, 3000.0, {})

    ```
    """
    made = of_recipe([os.fspath(file) for file in files], os.fspath(recipe), FileOptions())
    given = {"loss": made.loss, "tolerance": made.tolerance, "residual": made.residual}
    options = {name: x for name, x in given.items() if x not in (None, 0.0, LEAST_SQUARES)}
    return [(*measurement(files, made.joint), options) for files in made.groups]


def of_recipe(files: list[str], recipe: str, reading: FileOptions) -> Inputs:
    """Data files of a recipe, or other `files`, read by its options and those of `reading`.

    Raises UsageError or DataError where something is missing or wrong.
    """
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    table = read_recipe(recipe)
    if isinstance(table, SurfaceRecipe):
        return _by_surface_recipe(files, table, reading)
    return _by_film_recipe(files, table, reading)
