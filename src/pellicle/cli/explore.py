"""`pellicle explore`: a local page whose sliders move a scene."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.flags import OptionFlags, SceneFlags, flags_of
from pellicle.cli.messages import say
from pellicle.cli.session import start
from pellicle.data.options import SPACES, FileOptions
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.explorer.session import Session
    from pellicle.explorer.shown import RecipeFile
    from pellicle.recipes.read import FilmRecipe

DEFAULTS = {"layer": "SiO2", "substrate": "Si", "thickness": "0:1000"}
"""Film that is shown without a recipe and without flags."""


@flags_of(FileOptions, "signal", "angle", "polarisation")
class LightFlags(OptionFlags[FileOptions]):
    """Flags of the light of a film without data."""


_OF_DATA = (".csv", ".txt", ".dat", ".xlsx", ".dx", ".png")


def explore(
    recipe: Annotated[
        str | None, Parameter(help="TOML file that describes the scene or surface (SiO2 on Si).")
    ] = None,
    /,
    *,
    scene: Annotated[SceneFlags, Parameter(name="*")] = SceneFlags(),  # noqa: B008
    light: Annotated[LightFlags | None, Parameter(name="*")] = None,
    port: Annotated[int, Parameter(help="Port of this machine (0: a free one).")] = 0,
    no_browser: Annotated[
        bool, Parameter(help="Print the address of the page and do not open it.", negative="")
    ] = False,
) -> int:
    """Open a page on this machine whose sliders move a scene: spectrum, colour, sphere and plan.

    Data that are dropped on the page can be fitted. Ctrl-C ends it.

    Example: pellicle explore film.toml
    """
    light = light or LightFlags()
    given = [*scene.given(), *light.given()]
    if recipe is not None and given:
        raise UsageError(
            f"{', '.join(given)} and a recipe exclude each other: describe the scene in the recipe"
        )
    if recipe is not None and Path(recipe).suffix.lower() in _OF_DATA:
        raise UsageError(
            f"{recipe}: is data, and the explorer takes a recipe, or flags as --layer SiO2 --substrate Si:"
            " name the file in [data] files of the recipe, or drop it on the page"
        )
    start()
    from pellicle.explorer.server import serve

    session = _session(recipe, scene, light)

    def ready(address: str) -> None:
        print(address, flush=True)
        say("Ctrl-C ends the explorer")
        if not no_browser:
            import webbrowser

            webbrowser.open(address)

    try:
        serve(session, port, ready)
    except KeyboardInterrupt:
        say("")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # programs may be compiling in a thread, which Python cannot end


def _session(path: str | None, flags: SceneFlags, light: LightFlags) -> Session:
    """The session of a recipe, with the data of its first file, or of the flags."""
    from pellicle.cli.reading import wavelengths
    from pellicle.explorer.session import Session
    from pellicle.explorer.shown import RecipeFile
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    if path is None:
        film: Any = replace(flags, **{name: getattr(flags, name) or x for name, x in DEFAULTS.items()})
        session = Session(film.scene(light.options()), title=f"{film.layer} on {film.substrate}")
        if flags.thickness is None:
            say("thickness: 0 to 1000 nm, since no --thickness was given")
        return session
    recipe, title = read_recipe(path), Path(path).name
    if isinstance(recipe, SurfaceRecipe):
        surface, reading = recipe.scene(), recipe.tables.data.model_dump(exclude_none=True)
        reading = {name: x for name, x in reading.items() if name not in ("files", "signal")}
        bare = recipe.with_data(columns=None, noise=None)  # those that the page has fields for

        def samples(path: str) -> RecipeFile:
            return RecipeFile(
                path, lambda: surface, reading, lambda given: [bare.with_data(**given).read(path)]
            )

        files = [*map(samples, recipe.files)]
        about = {"spectra": _first(files), "reading": reading, "files": files}
        return Session(surface, Path(path).parent, title=title, **about)
    data = recipe.tables.data
    each = recipe.samples or [*[recipe] * len(data.files), *recipe.each]
    first = (each or [recipe])[0]
    scene, data = first.scene(), first.tables.data
    files = [] if data.signal in SPACES else [*map(_file, recipe.files, each)]
    given = None if data.wavelengths is None else wavelengths(first, scene)
    about = {"title": title, "spectra": _first(files), "reading": _reading(first), "files": files}
    return Session(scene, Path(path).parent, wavelength=given, **about)


def _first(files: list[RecipeFile]) -> Sequence[Any]:
    """The data of the first file; none, with a line on stderr, where it cannot be read."""
    try:
        return files[0].read(files[0].reading) if files else []
    except DataError as error:
        say(f"{error} (the explorer starts without data)")
        return []


def _reading(recipe: FilmRecipe) -> dict[str, Any]:
    """The options by which a recipe reads and fits its file, but for those of the light."""
    return {name: x for name, x in recipe.options.items() if name not in ("angle", "polarisation")}


def _file(path: str, recipe: FilmRecipe) -> RecipeFile:
    """One of the files of a recipe, by the recipe of this file."""
    from pellicle.api.data_files import read
    from pellicle.explorer.shown import RecipeFile

    stated = _reading(recipe)
    light = {name: x for name, x in recipe.reading.items() if name not in stated}

    def data(reading: Mapping[str, Any]) -> Sequence[Any]:
        return read(path, FileOptions.of({**light, **reading}), recipe.scene())

    return RecipeFile(path, recipe.scene, stated, data)
