"""`pellicle map`: thickness at every pixel of a picture, or along a strip of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

from cyclopts import Parameter

from pellicle.cli.batch import CONVERGED, UNCLEAR
from pellicle.cli.colours import SPACES
from pellicle.cli.flags import OUTPUT, CameraFlags, flag, switch
from pellicle.cli.session import check_folder, say, start
from pellicle.errors import UsageError

MOST_CONVERGED = 0.5
"""Share of the positions that must have one thickness for the exit code 0."""


def map(
    picture: Annotated[str, Parameter(help="PNG, TIFF or JPEG picture.")],
    *,
    recipe: Annotated[str, Parameter(help="TOML file that describes the film, with a free thickness.")],
    strip: Annotated[
        str | None, Parameter(help="X0,Y0,X1,Y1: ends of a line across the film, in pixels.")
    ] = None,
    region: Annotated[str | None, Parameter(help="X,Y,WIDTH,HEIGHT in pixels (the whole picture).")] = None,
    camera: Annotated[CameraFlags | None, Parameter(name="*")] = None,
    signal: Annotated[str | None, Parameter(help="srgb or rgb (the recipe's, or srgb).")] = None,
    layer: Annotated[
        str | None, Parameter(help="Layer whose thickness is sought (the one with a free thickness).")
    ] = None,
    noise: Annotated[
        float | None, Parameter(help="Standard deviation of a channel (the recipe's, or 1.5/255).")
    ] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for report, figure, table or arrays.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object.")] = False,
) -> int:
    """Compute the thickness of a film at every pixel of a picture, or along a strip across a gradient.

    Each position has its most probable thickness and its probability: one colour rarely decides. The exit
    code is 4 where fewer than half of the positions have one thickness.

    Example: pellicle map blade.png --recipe oxide.toml --strip 20,60,420,60 --out blade
    """
    from pellicle.recipes import read_recipe
    from pellicle.recipes.surface import SurfaceRecipe

    described = read_recipe(recipe)
    if isinstance(described, SurfaceRecipe):
        raise UsageError("a map needs the recipe of a film, and this one describes a surface")
    stated: dict[str, Any] = {
        name: value for name, value in vars(camera or CameraFlags()).items() if value is not None
    }
    seen = described.camera | stated
    if seen.pop("white_balance", "fixed") == "free" or seen.pop("chart", None) is not None:
        raise UsageError(
            "--chart and a free --white-balance are for regions only: a map takes --sensitivities, or sRGB"
        )
    transmitted = seen.pop("transmitted", False)
    data = described.tables.data
    of_colours = data.signal in SPACES
    space = signal or (data.signal if of_colours else "srgb")
    if space not in ("srgb", "rgb"):
        raise UsageError(f"a picture has the signal srgb or rgb, not {space}")
    noise = data.noise if noise is None and of_colours else noise
    if out is not None:
        check_folder(out)
    scene = described.scene()
    start()
    import equinox as eqx

    from pellicle import api
    from pellicle.reporting.json_record import one_line
    from pellicle.reporting.picture_map import report, to_json, write_map

    if transmitted:
        scene = eqx.tree_at(lambda s: s.light, scene, replace(scene.light, signal="T"))
    made = api.map(picture, scene, strip=strip, region=region, space=space, layer=layer, noise=noise, **seen)
    print(one_line(to_json(made)) if json else report(made), flush=True)
    if out is not None:
        say(f"{write_map(out, made)}: report, figure and tables written")
    return CONVERGED if made.converged >= MOST_CONVERGED else UNCLEAR
