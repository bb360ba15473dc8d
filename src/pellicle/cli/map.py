"""`pellicle map`: thickness at every pixel of a cube of spectra or of a photograph, with its progress."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from pellicle.cli.flags import OUTPUT, CameraFlags, CubeFlags, Flags, flag, switch
from pellicle.cli.messages import PixelProgress, as_flags, say, show
from pellicle.cli.session import GOOD, INTERRUPTED, UNCLEAR, check_folder, start
from pellicle.data.options import SPACES, named
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.mapping.map_result import Map
    from pellicle.recipes.read import FilmRecipe
    from pellicle.reporting.map_summary import MapSummary
    from pellicle.scene.film import Scene


RUN = Group("Run", sort_key=2)
MOST_DECIDED = 0.5
"""Share of the pixels with data that must have one answer for the exit code 0."""
STORE, NETCDF, RATES = "map.zarr", "map.nc", "rate.nc"


@dataclass(frozen=True)
class StoreFlags(Flags):
    """Flags of the fits of many spectra in a store, None where not given."""

    workers: Annotated[int | None, flag(RUN)] = None
    """Processes on this machine, one thread each (its cores, if that saves time)."""
    lamp_curve: Annotated[
        str | None,
        flag(
            RUN,
            "Divide all spectra by one lamp curve: joint, fitted with the films, or X,Y,WIDTH,HEIGHT "
            "of an image, a region of known reflectance.",
        ),
    ] = None
    resume: Annotated[bool | None, flag(OUTPUT)] = None
    """Go on with what an earlier run left in --out (the default)."""
    overwrite: Annotated[bool | None, switch(OUTPUT, "Replace what an earlier run left in --out.")] = None

    def check(self, out: str | None) -> None:
        """Raise UsageError for flags that do not go together."""
        if self.workers is not None and self.workers < 1:
            raise UsageError(f"--workers must be at least 1, got {self.workers}")
        if out is None and (idle := [name for name in self.given() if name in ("--resume", "--overwrite")]):
            raise UsageError(f"{idle[0]} needs --out, the folder of the result")


@dataclass(frozen=True)
class RunFlags(StoreFlags):
    """Flags of the computation of a map, None where not given."""

    scheduler: Annotated[str | None, flag(RUN)] = None
    """Address of a dask scheduler, tcp://HOST:8786, whose workers fit the pixels."""
    neighbours: Annotated[bool | None, switch(RUN)] = None
    """Decide ambiguous pixels by the order of their neighbours."""
    lamp_reference: Annotated[str | None, flag(RUN)] = None
    """Recipe of the region of --lamp-curve (the bare substrate)."""
    preview: Annotated[bool | None, switch(RUN)] = None
    """Fit a few thousand pixels only, into the folder OUT-preview."""


def map_cube(
    path: str, described: FilmRecipe, run: RunFlags, cube: CubeFlags, out: str | None, json: bool
) -> int:
    """Map a cube, print the report, write the folder, and return the exit code."""
    run.check(out)
    if run.workers is not None and run.scheduler is not None:
        raise UsageError("--workers are processes of this machine, and --scheduler has its own: give one")
    folder = None if out is None else Path(f"{out.rstrip('/')}-preview" if run.preview else out)
    if folder is not None:
        check_folder(str(folder))
    scene = described.scene(fitted=True)
    options = {name: value for name, value in vars(run).items() if value is not None}
    options["workers"] = 1 if run.preview and run.workers is None else run.workers
    if run.lamp_reference is not None:
        what = "--lamp-reference needs the recipe of a film, and this one is of a surface"
        options["lamp_reference"] = film_recipe(run.lamp_reference, what).scene()
    start()
    from pellicle.reporting.map_summary import summarise
    from pellicle.reporting.map_text import cube_json, cube_report

    options["recipe"] = Path(described.path).read_text(encoding="utf-8")
    options |= cube.arguments(described)
    made = fitted("map", path, scene, folder, options)
    if made is None:
        return INTERRUPTED
    if made.run is not None and made.run.earlier:
        say(f"{made.run.earlier} pixels are from an earlier run in {folder}; --overwrite fits them again")
    summary, told = summarise(made), {"scene": {"recipe": described.path}}
    told = {**cube_json(made, summary), **told} if json else as_flags(cube_report(made, summary))
    show(told, folder is not None)
    if folder is not None:
        flags = vars(run) | vars(cube)
        repeated = again("map", path, described.path, flags, options, str(out))
        _write(folder, made, summary, repeated, described.path)
    return GOOD if made.decided >= MOST_DECIDED else UNCLEAR


def film_recipe(path: str, otherwise: str) -> FilmRecipe:
    """Read the recipe of a film. Raises UsageError, `otherwise`, for that of a surface."""
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    described = read_recipe(path)
    if isinstance(described, SurfaceRecipe):
        raise UsageError(f"{path}: {otherwise}")
    return described


def fitted(verb: str, source: Any, scene: Scene, folder: Path | None, options: dict[str, Any]) -> Any:
    """The result of a `verb` of `pellicle.api.maps` in its folder; None where it was interrupted, which is
    stated."""
    from pellicle.api import maps

    progress = PixelProgress(source if isinstance(source, str) else verb)
    try:
        with progress, _started(folder, progress):
            store = None if folder is None else folder / STORE
            return getattr(maps, verb)(source, scene, out=store, progress=progress, **options)
    except KeyboardInterrupt:
        kept = f"; they are kept in {folder}, and the same command goes on from there" if folder else ""
        say(f"interrupted after {progress.done} of {progress.total} pixels{kept}")
        return None


@contextmanager
def _started(folder: Path | None, progress: PixelProgress) -> Iterator[None]:
    """Make the folder of a map, marked as ours, so that a run that is killed can go on in it; a cube that
    cannot be read leaves none."""
    import shutil

    from pellicle.files import MARKER, new_folder, write_text
    from pellicle.reporting.json_record import indented, versions
    from pellicle.reporting.map_text import SCHEMA

    if folder is None:
        yield
        return
    remains = {folder, *folder.iterdir()} if folder.exists() else set()
    new_folder(folder)
    if not (folder / MARKER).exists():
        begun = {"schema": SCHEMA, "status": "running", "versions": versions()}
        write_text(folder / MARKER, indented(begun))
    try:
        yield
    except ValueError:
        if not progress.done:
            if folder / STORE not in remains:
                shutil.rmtree(folder / STORE, ignore_errors=True)
            if folder / MARKER not in remains:
                (folder / MARKER).unlink(missing_ok=True)
            if folder not in remains and not any(folder.iterdir()):
                folder.rmdir()
        raise


def again(
    verb: str, data: str | list[str], recipe: str, flags: dict[str, Any], options: dict[str, Any], out: str
) -> list[tuple[str, str]]:
    """Command and program that repeat a map or a series, without flags that do not change its numbers."""
    from pellicle.reporting.page.repetition import map_program

    words = ["pellicle", verb, *([data] if isinstance(data, str) else data), "--recipe", recipe]
    for name, value in {**flags, "resume": None, "overwrite": None, "out": out}.items():
        if value is not None and value is not False:
            text = ":".join(f"{end:g}" for end in value) if isinstance(value, tuple) else str(value)
            words += named([name]) if value is True else [*named([name]), text]
    written = {}
    if flags.get("lamp_reference"):
        written["lamp_reference"] = f"pl.read_recipe({flags['lamp_reference']!r}).scene()"
    if callable(options.get("white_reflectance")):
        light = "".join(f", {x}={options[x]!r}" for x in ("angle", "polarisation") if x in options)
        white = f"pl.reflectance(nm, 0.0, 1.0, {flags['white_reflectance']!r}{light})"
        written["white_reflectance"] = f"lambda nm: {white}"
    program = map_program(verb, data, recipe, options, written)
    return [("Command", shlex.join(words)), ("Python", program)]


def _write(
    folder: Path, made: Map, summary: MapSummary, repeated: list[tuple[str, str]], recipe: str
) -> None:
    from pellicle.files import replacing
    from pellicle.mapping.growth import TIME
    from pellicle.reporting.map_figures import write_cube_map
    from pellicle.reporting.map_sites import SITES

    made.to_netcdf(folder / NETCDF, overwrite=True)
    write_cube_map(folder, made, repeated, recipe, summary)
    names = [STORE, NETCDF, *([SITES] if (folder / SITES).exists() else [])]
    if TIME in made.dims:
        try:
            rates = made.growth()
        except UsageError as error:
            say(f"no rates of change: {error}")
        else:
            names.append(RATES)
            with replacing(folder / RATES, overwrite=True) as draft:
                rates.to_netcdf(draft, engine="h5netcdf")
    say(f"{folder}: {', '.join(names)}, report and figures written")


PHOTOGRAPHS = Group("Photographs", sort_key=5)
MOST_CONVERGED = 0.5
"""Share of the positions that must have one thickness for the exit code 0."""
_OF_BOTH = ("--signal", "--noise", "--neighbours")


def map(
    data: Annotated[
        str, Parameter(help="Cube: zarr, NetCDF, ENVI, TIFF stack, .npy, folder of spectra; or a photograph.")
    ],
    *,
    recipe: Annotated[str, Parameter(help="TOML file that describes the film, with a free thickness.")],
    run: Annotated[RunFlags | None, Parameter(name="*")] = None,
    cube: Annotated[CubeFlags | None, Parameter(name="*")] = None,
    strip: Annotated[
        str | None, flag(PHOTOGRAPHS, "X0,Y0,X1,Y1: ends of a line across the film, in pixels.")
    ] = None,
    region: Annotated[
        str | None, flag(PHOTOGRAPHS, "X,Y,WIDTH,HEIGHT in pixels (the whole photograph).")
    ] = None,
    layer: Annotated[
        str | None, flag(PHOTOGRAPHS, "Layer whose thickness is sought (the one with a free thickness).")
    ] = None,
    camera: Annotated[CameraFlags | None, Parameter(name="*")] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for the map, report and figures.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object.")] = False,
) -> int:
    """Fit a film at every pixel of a cube of spectra, or find its thickness from the colours of a photograph.

    A cube is fitted pixel by pixel, as pellicle fit does. Results are written to --out while they are
    computed, and the same command goes on where a killed one was. Each position of a photograph has its most
    probable thickness and its probability: one colour rarely decides. The exit code is 4 where fewer than
    half of the pixels have one thickness.

    Example: pellicle map wafer.nc --recipe oxide.toml --out wafer

    Example: pellicle map blade.png --recipe oxide.toml --strip 20,60,420,60 --out blade
    """
    from pellicle.data.read_cube import is_photograph

    described = film_recipe(recipe, "describes a surface, and a map needs the recipe of a film")
    run, cube, camera = run or RunFlags(), cube or CubeFlags(), camera or CameraFlags()
    photograph = {"strip": strip, "region": region, "layer": layer}
    of_photograph = [*named(n for n, value in photograph.items() if value is not None), *camera.given()]
    of_cube = [name for name in (*run.given(), *cube.given()) if name not in _OF_BOTH]
    if is_photograph(Path(data)):
        refuse(data, "photograph", "cubes", of_cube)
        seen = photograph | {"signal": cube.signal, "noise": cube.noise, "neighbours": bool(run.neighbours)}
        return _map_photograph(data, described, camera, seen, out, json)
    if Path(data).exists():
        refuse(data, "cube", "photographs", of_photograph)
    return map_cube(data, described, run, cube, out, json)


def refuse(data: str, kind: str, others: str, flags: list[str]) -> None:
    """Raise UsageError for flags of other data."""
    if flags:
        verb = "is" if len(flags) == 1 else "are"
        raise UsageError(
            f"{data}: is a {kind}, and {', '.join(flags)} {verb} for {others}; leave out what does not apply"
        )


def _map_photograph(
    photograph: str,
    described: FilmRecipe,
    camera: CameraFlags,
    flags: dict[str, Any],
    out: str | None,
    json: bool,
) -> int:
    """Map a photograph by `flags` strip, region, layer, signal and noise; print and write the result."""
    stated: dict[str, Any] = camera.options().given()
    seen = described.camera | stated
    if seen.pop("white_balance", "fixed") == "free" or seen.pop("chart", None) is not None:
        raise UsageError(
            "--chart and a free --white-balance are for regions only: a map takes --sensitivities, or sRGB"
        )
    transmitted = seen.pop("transmitted", False)
    data = described.tables.data
    of_colours = data.signal in SPACES
    space = flags.pop("signal") or (data.signal if of_colours else "srgb")
    if space not in ("srgb", "rgb"):
        raise UsageError(f"a photograph has the signal srgb or rgb, not {space}")
    noise = flags.pop("noise")
    noise = data.noise if noise is None and of_colours else noise
    if isinstance(noise, str):
        raise UsageError(f"--noise of a photograph must be a number, not {noise}")
    if out is not None:
        check_folder(out)
    scene = described.scene()
    start()
    import equinox as eqx

    from pellicle.api import maps
    from pellicle.reporting.photograph_map import report, to_json, write_map

    if transmitted:
        scene = eqx.tree_at(lambda s: s.light, scene, replace(scene.light, signal="T"))
    made: Any = maps.map(photograph, scene, space=space, noise=noise, **flags, **seen)
    told = {**to_json(made), "scene": {"recipe": described.path}} if json else report(made)
    show(told, out is not None)
    if out is not None:
        say(f"{write_map(out, made, described.path)}: report, figure and tables written")
    return GOOD if made.converged >= MOST_CONVERGED else UNCLEAR
