"""`pellicle plan`: which effects a recipe's scene calls for, and what each of them is worth."""

from __future__ import annotations

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
    json: Annotated[bool, Parameter(help="One JSON object on stdout instead of the table.")] = False,
) -> int:
    """Say which effects are simulated and why, and what leaving each out would change and save.

    Example: pellicle plan film.toml --tolerance 1e-3
    """
    from pellicle.io.recipe import read_recipe

    if not tolerance > 0:
        raise UsageError(f"--tolerance must be positive, got {tolerance:g}")
    found = read_recipe(recipe)
    scene = found.scene()
    start()
    from pellicle import costs, thrift
    from pellicle.cli.wavelengths import scene_at
    from pellicle.report import plans

    scene = scene_at(found, scene)
    chosen, calibration = thrift.plan(scene, tolerance), costs.calibrated(cache_folder())
    savings = costs.savings(scene, calibration)
    whole, planned = (calibration.seconds(costs.work(p, scene)) for p in (thrift.reference(scene), chosen))
    if json:
        print(plans.record(chosen, savings))
        return 0
    print(plans.table(chosen, savings, whole, planned), end="")
    if chosen.error_bound > tolerance:
        say(f"no plan is within {tolerance:g}: the averages alone are off by up to {chosen.error_bound:.1g}")
    return 0
