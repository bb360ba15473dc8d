"""`pellicle plan` and `pellicle cost`: effects that a scene needs, and error and time of every method."""

from dataclasses import dataclass
from math import inf
from typing import Annotated, Any

from cyclopts import Parameter

from pellicle.cli.flags import Flags
from pellicle.cli.messages import Progress, say, show
from pellicle.cli.reading import directions, measured_scene, recipe_angles
from pellicle.cli.session import check_folder, start
from pellicle.data.options import SPACES
from pellicle.errors import UsageError

USUAL_EYE = (("observer", "1931"), ("illuminant", "D65"))
"""Keys of [camera] under which the methods for colours are compared."""


@dataclass(frozen=True)
class CostFlags(Flags):
    """Flags of the methods that are compared."""

    reference: str = "float64"
    """Reference of the errors: float64, or mpmath with 50 digits."""
    tolerance: float | None = None
    """Error that is small enough: in R, T, degrees or, of colours, ΔE2000."""
    datasets: int = 20
    """Number of simulated spectra that every solver fits; 0 for no solvers."""
    time_limit: float = 120.0
    """Seconds after which no further simulated spectrum is fitted."""

    def check(self) -> None:
        """Raise UsageError for an impossible number."""
        if self.tolerance is not None and not 0 < self.tolerance < inf:
            raise UsageError(
                f"--tolerance must be above zero, got {self.tolerance:g}: give the largest error"
            )
        if self.datasets < 0:
            raise UsageError(f"--datasets must not be negative, got {self.datasets}")
        if not self.time_limit > 0:
            raise UsageError(f"--time-limit must be above zero, got {self.time_limit:g} s")

    def refuse_reference(self, what: str) -> None:
        """Raise UsageError for a reference that is for spectra of films only."""
        if self.reference != "float64":
            raise UsageError(f"--reference is for {what} measured against steps of 1 nm in float64")


def cost(
    recipe: Annotated[str, Parameter(help="TOML file that describes the scene or surface.")],
    *,
    methods: Annotated[CostFlags, Parameter(name="*")] = CostFlags(),
    out: Annotated[str | None, Parameter(help="Folder for report, figure and tables.")] = None,
    json: Annotated[bool, Parameter(help="Print one JSON object.", negative="")] = False,
) -> int:
    """Measure error and time of every method of simulating a recipe's scene, and of fitting it.

    Example: pellicle cost film.toml --tolerance 0.001 --out cost
    """
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    methods.check()
    described = read_recipe(recipe)
    options: dict[str, Any]
    if isinstance(described, SurfaceRecipe):
        methods.refuse_reference("films: a surface is")
        scene, options = described.scene(), {"directions": directions(described)}
    elif described.tables.data.signal in SPACES:
        methods.refuse_reference("spectra: colours are")
        space, angle = described.tables.data.signal, recipe_angles(described)
        scene, options = described.scene(), {"space": space, "angle": angle}
        if any(item not in USUAL_EYE for item in described.camera.items()):
            say("methods for colours are compared with the observer 1931 under D65, not the recipe's camera")
    else:
        scene, nm = measured_scene(described)
        noise = described.tables.data.noise
        options = vars(methods) | {"wavelength": nm, "noise": noise}
    if out is not None:
        check_folder(out)
    start(keep=False)
    from pellicle.api import plans
    from pellicle.reporting.cost import text, to_json, write_cost

    with Progress(recipe) as progress:
        result = plans.cost(scene, **{"tolerance": methods.tolerance, **options}, progress=progress)
    show(to_json(result, recipe) if json else text(result, recipe), out is not None)
    if out is not None:
        say(f"{write_cost(out, result, recipe)}: report, figure and tables written")
    return 130 if result.interrupted else 0


def plan(
    recipe: Annotated[str, Parameter(help="TOML file that describes the scene or surface.")],
    *,
    tolerance: Annotated[
        float, Parameter(help="Largest error of the signal: a fraction, or degrees for psi-delta.")
    ] = 1e-4,
    json: Annotated[bool, Parameter(help="Print one JSON object.", negative="")] = False,
) -> int:
    """List the effects to simulate, with reasons, and the error and time of leaving each one out.

    Example: pellicle plan film.toml --tolerance 1e-3
    """
    from pellicle.effects import film_plan, surface_plan
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    if not 0 < tolerance < inf:
        raise UsageError(f"--tolerance must be above zero, got {tolerance:g}: give the largest error")
    described = read_recipe(recipe)
    start()
    from pellicle.fitting.film.messages import log_scene
    from pellicle.reporting import plans
    from pellicle.scene.film import with_wavelength
    from pellicle.scene.surface import surface_view

    if isinstance(described, SurfaceRecipe):
        view = surface_view(described.scene(), directions(described))
        chosen = surface_plan.plan(view, tolerance)
        planned = {"": (chosen, surface_plan.savings(view, chosen))}
    else:
        planned = {}
        for one in described.samples or [described]:
            scene = with_wavelength(*measured_scene(one))
            log_scene(scene)
            chosen = film_plan.plan(scene, tolerance)
            name = "" if one.sample is None else f"{one.sample.name} ({one.files[0]})"
            planned[name] = chosen, film_plan.savings(scene, chosen)
    if json:
        show(plans.to_json(planned))
        return 0
    show(plans.report_with_savings(planned), end="")
    for name, (chosen, _) in planned.items():
        if chosen.error_bound > tolerance:
            of, error = f"{name}: " if name else "", f"{chosen.error_bound:.1g}"
            say(f"{of}no plan is within {tolerance:g}: averages alone have errors up to {error}")
    return 0
