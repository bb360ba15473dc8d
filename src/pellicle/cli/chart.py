"""`pellicle chart`: colours of a film against thickness and angle, or renderings of objects under it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from pellicle.cli.flags import Flags
from pellicle.cli.messages import say
from pellicle.cli.session import start
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.recipes.read import SurfaceRecipe
    from pellicle.scene.film import Scene

View = Literal["chart", "balls", "bubble", "methods"]
COUNT = 5
"""Thicknesses of a row of objects."""


@dataclass(frozen=True)
class SphereFlags(Flags):
    """Flags of the sphere of a surface."""

    light: float = 35.0
    """Surfaces: angle between the main lamp and the line of sight in degrees."""
    environment: Literal["studio", "lamp"] = "studio"
    """Surfaces: studio of four soft boxes and a horizon, or one lamp in the dark."""


def chart(
    recipe: Annotated[str, Parameter(help="TOML file that describes the scene or surface.")],
    *,
    out: Annotated[str, Parameter(help="Image to write (PNG, PDF, SVG); no file is overwritten.")],
    layer: Annotated[
        str | None, Parameter(help="Layer whose thickness varies (the one with a free thickness).")
    ] = None,
    thickness: Annotated[str | None, Parameter(help="LO:HI in nm (the recipe's bounds).")] = None,
    angle: Annotated[str, Parameter(help="LO:HI in degrees.")] = "0:80",
    illuminant: Annotated[str, Parameter(help="E, A, D50, D55, D65 or D75.")] = "D65",
    observer: Annotated[str, Parameter(help="1931 (2 degrees) or 1964 (10 degrees).")] = "1931",
    invert: Annotated[
        str | None,
        Parameter(help="CSV file to write: every thickness of each colour at the lowest angle, with ΔE."),
    ] = None,
    view: Annotated[
        View,
        Parameter(
            help="Films: chart of thickness and angle; balls of the substrate under five thicknesses, in"
            " reflection and seen through; bubble that drains, by its thickness at the top; or methods of"
            " computing the colour, side by side with ΔE2000 and time."
        ),
    ] = "chart",
    sphere: Annotated[SphereFlags, Parameter(name="*")] = SphereFlags(),
) -> int:
    """Draw the interference colours of a recipe's film, objects under it, or a sphere of a recipe's surface.

    With --invert, also write the inverse: each 8-bit colour of the film, all thicknesses that have it within
    the noise of a camera (1.5 of 255), their probability and ΔE.

    Example: pellicle chart film.toml --out colours.png --thickness 0:1000
    """
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    described = read_recipe(recipe)
    if isinstance(described, SurfaceRecipe):
        return _surface(described, out, sphere, layer is thickness is invert is None and view == "chart")
    scene = described.scene()
    angles = _range("--angle", angle, 90.0)
    nm = _bounds(scene, layer) if thickness is None else _range("--thickness", thickness, inf)
    eye: dict[str, Any] = {"observer": observer, "illuminant": illuminant}
    if view != "chart":
        if invert is not None:
            raise UsageError("--invert belongs to a chart: leave out --view")
        return _objects(scene, view, out, nm, layer, Path(recipe).stem, eye)
    _chart(scene, Path(recipe), out, (nm, angles), invert, {"layer": layer, **eye})
    return 0


def _chart(
    scene: Scene,
    recipe: Path,
    out: str,
    ranges: tuple[tuple[float, float], tuple[float, float]],
    invert: str | None,
    how: dict[str, Any],
) -> None:
    """Draw the colours over ranges of thickness and angle, and write their inverse into the file `invert`."""
    start()
    from pellicle.reporting import colour_figures

    inverse, (nm, angles) = None, ranges
    if invert is not None:
        inverse = colour_figures.invert_chart(scene, invert, nm, angles[0], **how, source=recipe.name)
    outside = colour_figures.chart(scene, out, nm, angles, **how, title=recipe.stem, inverse=inverse)
    say(f"{out}: {nm[0]:g} to {nm[1]:g} nm, {angles[0]:g} to {angles[1]:g} degrees")
    if outside > 0.005:
        say(f"{100 * outside:.0f} % of the colours are outside sRGB and are shown by the nearest ones")
    if inverse is not None:
        ambiguous = 100 * inverse.ambiguous
        say(
            f"{invert}: thicknesses of {len(inverse.source)} colours at {angles[0]:g} degrees;"
            f" {ambiguous:.0f} % of the colours have more than one"
        )


def _objects(
    scene: Scene,
    view: View,
    out: str,
    nm: tuple[float, float],
    layer: str | None,
    title: str,
    eye: dict[str, Any],
) -> int:
    import numpy as np

    if view == "bubble" and nm[0] <= 0:
        raise UsageError("--thickness of a bubble must be above 0 at its top: give --thickness LO:HI")
    if view == "methods" and (layer is not None or eye != {"observer": "1931", "illuminant": "D65"}):
        raise UsageError("methods are compared on one layer under D65: leave out the other flags")
    start()
    from pellicle.reporting import renderings

    if view == "methods":
        for method in renderings.draw_methods(scene, out, nm, title):
            say(
                f"{method.name}: ΔE2000 {method.delta_e.mean():.2g} in the mean,"
                f" {method.delta_e.max():.2g} at most, {method.seconds * 1e9:.0f} ns a colour"
            )
    else:
        thicknesses = [float(f"{x:.4g}") for x in np.linspace(*nm, COUNT)]
        if view == "bubble":
            thicknesses = [float(f"{x:.3g}") for x in np.geomspace(nm[1], nm[0], COUNT)]
        renderings.objects(scene, out, view, thicknesses, layer, title, **eye)
    say(f"{out}: {view}, {nm[0]:g} to {nm[1]:g} nm")
    return 0


def _surface(recipe: SurfaceRecipe, out: str, flags: SphereFlags, none_of_films: bool) -> int:
    if not none_of_films:
        raise UsageError(
            "--layer, --thickness, --invert and --view are for films; a surface has its own thickness"
        )
    if not 0 <= flags.light <= 180:
        raise UsageError(f"--light must lie in 0 to 180 degrees, got {flags.light:g}")
    surface = recipe.scene()
    start()
    from pellicle.reporting.renderings import sphere

    sphere(surface, out, flags.light, Path(recipe.path).stem, environment=flags.environment)
    say(f"{out}: a sphere of {surface.model}, the main lamp {flags.light:g} degrees from the line of sight")
    return 0


def _range(flag: str, text: str, upper: float) -> tuple[float, float]:
    from pellicle.data.options import parse_range

    low, high = parse_range(text, flag)
    if low < 0 or high > upper:
        raise UsageError(f"{flag} must lie in 0 to {upper:g}, got {text}")
    return low, high


def _bounds(scene: Scene, layer: str | None) -> tuple[float, float]:
    """The recipe's bounds, or 0 to twice a fixed thickness."""
    from pellicle.scene.free import Free
    from pellicle.simulation.colours import varied_layer

    chosen: Any = scene.layers[varied_layer(scene, layer)]
    if isinstance(chosen.thickness, Free):
        return chosen.thickness.lower, chosen.thickness.upper
    return 0.0, max(2 * float(chosen.thickness), 1.0)
