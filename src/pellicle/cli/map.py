"""`pellicle map`: thickness at every pixel of a cube of spectra or of a photograph."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from pellicle.cli.batch import CONVERGED, UNCLEAR
from pellicle.cli.cube_flags import CubeFlags
from pellicle.cli.flags import OUTPUT, CameraFlags, flag, named, switch
from pellicle.cli.map_cube import RunFlags, map_cube
from pellicle.cli.session import check_folder, say, show, start
from pellicle.data.options import SPACES
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.recipes.film import FilmRecipe

PHOTOGRAPHS = Group("Photographs", sort_key=5)
MOST_CONVERGED = 0.5
"""Share of the positions that must have one thickness for the exit code 0."""
_OF_BOTH = ("--signal", "--noise")


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
    from pellicle.data.cubes.detect import is_photograph
    from pellicle.recipes import read_recipe
    from pellicle.recipes.surface import SurfaceRecipe

    described = read_recipe(recipe)
    if isinstance(described, SurfaceRecipe):
        raise UsageError(f"{recipe}: describes a surface, and a map needs the recipe of a film")
    run, cube, camera = run or RunFlags(), cube or CubeFlags(), camera or CameraFlags()
    photograph = {"strip": strip, "region": region, "layer": layer}
    of_photograph = [*named(n for n, value in photograph.items() if value is not None), *camera.given()]
    of_cube = [*run.given(), *(name for name in cube.given() if name not in _OF_BOTH)]
    if is_photograph(Path(data)):
        _refuse(data, "photograph", "cubes", of_cube)
        seen = photograph | {"signal": cube.signal, "noise": cube.noise}
        return _map_photograph(data, described, camera, seen, out, json)
    if Path(data).exists():
        _refuse(data, "cube", "photographs", of_photograph)
    return map_cube(data, described, run, cube, out, json)


def _refuse(data: str, kind: str, others: str, flags: list[str]) -> None:
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
    from pellicle.reporting.json_record import one_line
    from pellicle.reporting.photograph_map import report, to_json, write_map

    if transmitted:
        scene = eqx.tree_at(lambda s: s.light, scene, replace(scene.light, signal="T"))
    made: Any = maps.map(photograph, scene, space=space, noise=noise, **flags, **seen)
    show(one_line(to_json(made)) if json else report(made), out is not None)
    if out is not None:
        say(f"{write_map(out, made)}: report, figure and tables written")
    return CONVERGED if made.converged >= MOST_CONVERGED else UNCLEAR
