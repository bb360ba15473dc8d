"""`pellicle plan`: effects that a simulation of a recipe's scene needs, with their errors and times."""

from __future__ import annotations

from math import inf
from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.session import say, start
from pellicle.cli.wavelengths import directions, measured_scene
from pellicle.errors import UsageError


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
    from pellicle.recipes import read_recipe
    from pellicle.recipes.surface import SurfaceRecipe

    if not 0 < tolerance < inf:
        raise UsageError(f"--tolerance must be above zero, got {tolerance:g}: give the largest error")
    described = read_recipe(recipe)
    start()
    from pellicle.fitting.film.messages import log_scene
    from pellicle.reporting import plans
    from pellicle.reporting.json_record import one_line
    from pellicle.scene.film import with_wavelength
    from pellicle.scene.surface import surface_view

    if isinstance(described, SurfaceRecipe):
        view = surface_view(described.scene(), directions(described))
        chosen = surface_plan.plan(view, tolerance)
        savings = surface_plan.savings(view, chosen)
    else:
        scene = with_wavelength(*measured_scene(described))
        log_scene(scene)
        chosen = film_plan.plan(scene, tolerance)
        savings = film_plan.savings(scene, chosen)
    if json:
        print(one_line(plans.to_json(chosen, savings)), flush=True)
        return 0
    print(plans.report_with_savings(chosen, savings), end="", flush=True)
    if chosen.error_bound > tolerance:
        say(f"no plan is within {tolerance:g}: averages alone have errors up to {chosen.error_bound:.1g}")
    return 0
