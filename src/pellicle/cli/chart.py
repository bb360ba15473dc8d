"""`pellicle chart`: the colours of a film against its thickness and the angle of incidence."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.session import say, start
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.scene import Scene


def chart(
    recipe: Annotated[str, Parameter(help="A TOML file that describes the scene.")],
    *,
    out: Annotated[str, Parameter(help="The picture to write (PNG, PDF, SVG); none is overwritten.")],
    layer: Annotated[
        str | None, Parameter(help="The layer whose thickness varies (the one that is free).")
    ] = None,
    thickness: Annotated[str | None, Parameter(help="LO:HI in nm (the recipe's bounds).")] = None,
    angle: Annotated[str, Parameter(help="LO:HI in degrees.")] = "0:80",
    illuminant: Annotated[str, Parameter(help="E, A, D50, D55, D65 or D75.")] = "D65",
    observer: Annotated[str, Parameter(help="1931 (2 degrees) or 1964 (10 degrees).")] = "1931",
) -> int:
    """Draw the interference colours of a recipe's film.

    Example: pellicle chart film.toml --out colours.png --thickness 0:1000
    """
    from pellicle.io.recipe import read_recipe

    found = read_recipe(recipe)
    scene = found.scene()
    angles = _range("--angle", angle, 90.0)
    nm = _bounds(scene, layer) if thickness is None else _range("--thickness", thickness, inf)
    start()
    from pellicle.report import charts

    lost = charts.chart(
        scene, out, nm, angles, layer, observer=observer, illuminant=illuminant, title=Path(recipe).stem
    )
    say(f"{out}: {nm[0]:g} to {nm[1]:g} nm, {angles[0]:g} to {angles[1]:g} degrees")
    if lost > 0.005:
        say(f"{100 * lost:.0f} % of the colours lie outside sRGB and are shown by their nearest")
    return 0


def _range(flag: str, text: str, most: float) -> tuple[float, float]:
    from pellicle.io.span import span

    low, high = span(text, flag)
    if low < 0 or high > most:
        raise UsageError(f"{flag} must lie in 0 to {most:g}, got {text}")
    return low, high


def _bounds(scene: Scene, layer: str | None) -> tuple[float, float]:
    """The recipe's own bounds, or 0 to twice a thickness that is fixed."""
    from pellicle.appearance import varied
    from pellicle.free import Free

    chosen: Any = scene.layers[varied(scene, layer)]
    if isinstance(chosen.thickness, Free):
        return chosen.thickness.lower, chosen.thickness.upper
    return 0.0, max(2 * float(chosen.thickness), 1.0)
