"""`pellicle export`: a film as a material of a renderer."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.session import say, start


def export(
    recipe: Annotated[str, Parameter(help="TOML file that describes the scene.")],
    *,
    to: Annotated[str, Parameter(help="Format or renderer: gltf, blender.")],
    out: Annotated[str, Parameter(help="File to write; no file is overwritten.")],
    numbers: Annotated[
        str,
        Parameter(help="Numbers that are drawn: effective (solved for the exact colours) or physical."),
    ] = "effective",
    thickness_map: Annotated[
        str | None, Parameter(help="Thickness over the object in nm: a .npy file or a grey PNG.")
    ] = None,
    layer: Annotated[
        str | None, Parameter(help="Layer whose thickness it is (the one with a free thickness).")
    ] = None,
    json: Annotated[bool, Parameter(help="Print one JSON object.", negative="")] = False,
) -> int:
    """Write a film as a material of a renderer, with the error of the renderer's formula.

    Example: pellicle export film.toml --to gltf --out film.glb
    """
    from pellicle.recipes import read_recipe

    described = read_recipe(recipe)
    start()
    from pellicle import api
    from pellicle.reporting.export_text import text
    from pellicle.reporting.json_record import one_line

    written = api.export(
        described.scene(), to=to, path=out, numbers=numbers, thickness_map=thickness_map, layer=layer
    )
    print(
        one_line({"target": to} | written.material.record()) if json else text(written), end="\n", flush=True
    )
    say(f"{', '.join(str(path) for path in written.files)} written")
    return 0
