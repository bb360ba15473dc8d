"""`pellicle plan`: which effects a recipe's scene calls for, and what each of them is worth."""

from __future__ import annotations

import json as json_module
from math import inf
from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.session import cache_folder, say, start
from pellicle.errors import UsageError


def plan(
    recipe: Annotated[str, Parameter(help="A TOML file that describes the scene.")],
    *,
    tolerance: Annotated[
        float, Parameter(help="How far off the signal may be: a fraction, or degrees for psi-delta.")
    ] = 1e-4,
    json: Annotated[bool, Parameter(help="One JSON object on stdout.", negative="")] = False,
) -> int:
    """Say which effects are simulated and why, and what leaving each out would change and save.

    Example: pellicle plan film.toml --tolerance 1e-3
    """
    from pellicle.cli.wavelengths import seen
    from pellicle.recipes import read_recipe
    from pellicle.recipes.surface import SurfaceRecipe
    from pellicle.scene.film import with_wavelength

    if not 0 < tolerance < inf:
        raise UsageError(f"--tolerance must be above zero, got {tolerance:g}: what error is small enough?")
    found = read_recipe(recipe)
    if isinstance(found, SurfaceRecipe):
        from pellicle.cli.surface_commands import plan_surface

        return plan_surface(found, tolerance, json)
    scene = with_wavelength(*seen(found))
    start()
    from pellicle.fitting.spectra import messages
    from pellicle.planning import cost_model, film
    from pellicle.reporting import plans

    messages.log_scene(scene)
    chosen, calibration = film.plan(scene, tolerance), cost_model.calibrated(cache_folder())
    savings = film.savings(scene, calibration)
    whole, planned = (calibration.seconds(film.work(p, scene)) for p in (film.full_plan(scene), chosen))
    if json:
        print(json_module.dumps(plans.to_json(chosen, savings), allow_nan=False), flush=True)
        return 0
    print(plans.report_with_savings(chosen, savings, whole, planned), end="", flush=True)
    if chosen.error_bound > tolerance:
        say(f"no plan is within {tolerance:g}: the averages alone are off by up to {chosen.error_bound:.1g}")
    return 0
