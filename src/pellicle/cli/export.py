"""`pellicle export`: a film as a material of a renderer."""

from __future__ import annotations

from dataclasses import fields
from json import loads
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.flags import SceneFlags
from pellicle.cli.messages import say, show
from pellicle.cli.session import start
from pellicle.data.options import FileOptions
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.scene.film import Scene
    from pellicle.scene.surface import Surface


def export(
    film: Annotated[
        str,
        Parameter(
            help="TOML file that describes the scene or surface, the result.json or folder of a fit, or the "
            "folder of a map."
        ),
    ],
    *,
    to: Annotated[str, Parameter(help="blender, gltf, materialx, mitsuba, openpbr or usd.")],
    out: Annotated[str, Parameter(help="File to write; no file is overwritten.")],
    numbers: Annotated[
        str, Parameter(help="Numbers that are drawn: effective (solved for the exact colours) or physical.")
    ] = "effective",
    thickness_map: Annotated[
        str | None,
        Parameter(help="Thickness over the object in nm: a .npy file or a grey PNG (that of a map)."),
    ] = None,
    roughness_map: Annotated[
        str | None,
        Parameter(help="GGX α over the object, 0 to 1: a .npy file or a grey PNG, whose white is 1."),
    ] = None,
    layer: Annotated[
        str | None, Parameter(help="Layer whose thickness it is (the one with a free thickness).")
    ] = None,
    recipe: Annotated[
        str | None, Parameter(help="Recipe of a fit or map, where its result.json does not lead to it.")
    ] = None,
    json: Annotated[bool, Parameter(help="Print one JSON object.", negative="")] = False,
) -> int:
    """Write a film as a material of a renderer, with the error of the renderer's formula.

    The folder of a map becomes a material with its thickness as a texture.

    Example: pellicle export film.toml --to gltf --out film.glb

    Example: pellicle export wafer --to materialx --out wafer.mtlx
    """
    described, textures = _described(film, recipe), {"roughness_map": roughness_map}
    start()
    textures["thickness_map"] = _map_of(film) if thickness_map is None else thickness_map
    from pellicle.api.simulations import export as export_scene
    from pellicle.reporting.renderings import export_text

    written = export_scene(described, to=to, path=out, numbers=numbers, layer=layer, **textures)
    show({"target": to} | written.material.record() if json else export_text(written))
    say(f"{', '.join(str(path) for path in written.files)} written")
    return 0


def _map_of(film: str) -> Any:
    """The map in a folder of `pellicle map`, of a cube or of a photograph; None for anything else."""
    from pellicle.cli.map import STORE

    folder = Path(film)
    if (folder / STORE).is_dir():
        from pellicle.mapping.map_result import Map

        return Map(folder / STORE)
    if (folder / "strip.csv").is_file():
        raise UsageError(f"{film}: is a map of a strip, and a texture has rows and columns: map a region")
    return folder / "thickness.npy" if (folder / "thickness.npy").is_file() else None


def _described(film: str, recipe: str | None) -> Scene | Surface:
    """The scene of a recipe, of a fit with its values, or of a map."""
    from pellicle.recipes.read import read_recipe

    if (Path(film) / "result.json").is_file():  # the folder of a fit
        film = str(Path(film) / "result.json")
    if Path(film).suffix.lower() != ".json":
        if recipe is not None:
            raise UsageError("--recipe goes with the result.json of a fit; give the recipe alone")
        return read_recipe(film).scene()
    try:
        record = loads(Path(film).read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{film}: cannot be read ({error.strerror}); check its path") from None
    except ValueError:
        raise DataError(f"{film}: is not JSON; give the result.json of a fit") from None
    from pellicle.reporting import map_text, photograph_map

    maps = map_text.SCHEMA, photograph_map.SCHEMA
    of_map = isinstance(record, dict) and record.get("schema") in maps
    if not of_map and not (isinstance(record, dict) and record.get("parameters")):
        raise DataError(f"{film}: has no fitted parameters; give the result.json of one fit")
    from pellicle.rendering.export import with_values

    values = {} if of_map else {name: each["value"] for name, each in record["parameters"].items()}
    source = record.get("scene") or {}
    try:
        if recipe is None and "flags" in source:
            known = {field.name for field in fields(SceneFlags)}
            flags = {name: value for name, value in source["flags"].items() if name in known}
            return with_values(SceneFlags(**flags).scene(FileOptions()), values)
        recipe = recipe or source.get("recipe")
        if recipe is None:
            raise UsageError(f"{film}: names no scene that was fitted: give its recipe as --recipe")
        if not Path(recipe).exists():
            raise UsageError(
                f"{film}: its recipe {recipe} is not there: run from the folder of the fit, or give --recipe"
            )
        scene = read_recipe(recipe).scene()
        return scene if of_map else with_values(scene, values)
    except UsageError:
        raise
    except DataError as error:
        raise DataError(f"{film}: {error}; give its recipe as --recipe") from None
