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

COUNT = 5
"""Thicknesses of a row of objects."""


_EYE = {"observer": "1931", "illuminant": "D65"}


@dataclass(frozen=True)
class ChartFlags(Flags):
    """Flags of what is drawn of a film, and of the sphere of a surface."""

    layer: str | None = None
    """Layer whose thickness varies (the one with a free thickness)."""
    thickness: str | None = None
    """LO:HI in nm (the recipe's bounds)."""
    angle: str = "0:80"
    """LO:HI in degrees."""
    illuminant: str | None = None
    """E, A, D50, D55, D65 or D75 (that of the recipe, or D65)."""
    observer: str | None = None
    """1931 (2 degrees) or 1964 (10 degrees) (that of the recipe, or 1931)."""
    invert: str | None = None
    """CSV file to write: every thickness of each colour at the lowest angle, with ΔE."""
    view: Annotated[
        Literal["chart", "balls", "bubble", "methods"],
        Parameter(
            help="Films: chart of thickness and angle; balls of the substrate under five thicknesses, in"
            " reflection and seen through; bubble that drains, by its thickness at the top; or methods of"
            " computing the colour, side by side with ΔE2000 and time."
        ),
    ] = "chart"
    light: float = 35.0
    """Surfaces: angle between the main lamp and the line of sight in degrees."""
    environment: Literal["studio", "lamp"] = "studio"
    """Surfaces: studio of four soft boxes and a horizon, or one lamp in the dark."""

    def eye(self, camera: dict[str, Any]) -> dict[str, Any]:
        """Observer and illuminant, where they are not given those of a recipe's camera."""
        stated = {name: x for name in _EYE if (x := getattr(self, name)) is not None}
        if "illuminant" not in stated and "lamp" in camera:
            say(f"drawn under {_EYE['illuminant']}, not under the lamp {camera['lamp']} of the recipe")
        return _EYE | {name: x for name, x in camera.items() if name in _EYE} | stated


def chart(
    recipe: Annotated[str, Parameter(help="TOML file that describes the scene or surface.")],
    *,
    out: Annotated[str, Parameter(help="Image to write (PNG, PDF, SVG); no file is overwritten.")],
    how: Annotated[ChartFlags, Parameter(name="*")] = ChartFlags(),
) -> int:
    """Draw the interference colours of a recipe's film, objects under it, or a sphere of a recipe's surface.

    With --invert, also write the inverse: each 8-bit colour of the film, all thicknesses that have it within
    the noise of a camera (1.5 of 255), their probability and ΔE.

    Example: pellicle chart film.toml --out colours.png --thickness 0:1000
    """
    from pellicle.fitting.film.parameters import varied_and_kept
    from pellicle.recipes.read import SurfaceRecipe, read_recipe
    from pellicle.scene.free import Free
    from pellicle.simulation.colours import varied_layer

    described = read_recipe(recipe)
    if isinstance(described, SurfaceRecipe):
        return _surface(described, out, how)
    scene = described.scene()
    angles = _range("--angle", how.angle, 90.0)
    if how.thickness is None:  # the recipe's bounds, or 0 to twice a fixed thickness
        chosen: Any = scene.layers[varied_layer(scene, how.layer)]
        depth, free = chosen.thickness, isinstance(chosen.thickness, Free)
        nm = (depth.lower, depth.upper) if free else (0.0, max(2 * float(depth), 1.0))
    else:
        nm = _range("--thickness", how.thickness, inf)
    if how.view != "chart":
        return _objects(scene, Path(recipe).stem, out, nm, how, described.camera)
    start()
    from pellicle.files import check_new
    from pellicle.reporting import colour_figures
    from pellicle.reporting.matplotlib_figure import figure_path

    figure_path(out)
    inverse, options = None, {"layer": how.layer, **how.eye(described.camera)}
    if how.invert is not None:
        check_new(Path(how.invert), name="invert")
        about = options | {"source": Path(recipe).name}
        inverse = colour_figures.invert_chart(scene, how.invert, nm, angles[0], **about)
    options |= {"title": Path(recipe).stem, "inverse": inverse}
    outside = colour_figures.chart(scene, out, nm, angles, **options)
    varied, kept = varied_and_kept(scene, varied_layer(scene, how.layer))
    name = "" if varied == "thickness" else f"{varied} from "
    say(f"{out}: {name}{nm[0]:g} to {nm[1]:g} nm, {angles[0]:g} to {angles[1]:g} degrees")
    if kept:
        say(f"{out}: kept are {', '.join(kept)}")
    if outside > 0.005:
        say(f"{100 * outside:.0f} % of the colours are outside sRGB and are shown by the nearest ones")
    if inverse is not None:
        say(
            f"{how.invert}: thicknesses of {len(inverse.source)} colours at {angles[0]:g} degrees;"
            f" {100 * inverse.ambiguous:.0f} % of the colours have more than one"
        )
    return 0


def _objects(
    scene: Scene, title: str, out: str, nm: tuple[float, float], how: ChartFlags, camera: dict[str, Any]
) -> int:
    """Draw balls, a bubble or methods, with thicknesses in a range (nm)."""
    import numpy as np

    view, layer = how.view, how.layer
    if how.invert is not None:
        raise UsageError("--invert belongs to a chart: leave out --view")
    if view == "bubble" and nm[0] <= 0:
        raise UsageError("--thickness of a bubble must be above 0 at its top: give --thickness LO:HI")
    if view == "methods" and (layer is not None or not how.observer is how.illuminant is None):
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
        renderings.objects(scene, out, view, thicknesses, title, layer=layer, **how.eye(camera))
    say(f"{out}: {view}, {nm[0]:g} to {nm[1]:g} nm")
    return 0


def _surface(recipe: SurfaceRecipe, out: str, flags: ChartFlags) -> int:
    if not (flags.layer is flags.thickness is flags.invert is None and flags.view == "chart"):
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
    from pellicle.data.options import length_range

    low, high = length_range(text, flag)
    if low < 0 or high > upper:
        raise UsageError(f"{flag} must lie in 0 to {upper:g}, got {text}")
    return low, high
