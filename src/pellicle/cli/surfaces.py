"""`pellicle simulate`, `plan` and `cost` of a surface, seen along the directions of the recipe's data."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from pellicle.cli.session import Progress, cache_folder, say, start

if TYPE_CHECKING:
    from pellicle.io.samples import BrdfSamples
    from pellicle.io.surface_recipe import SurfaceRecipe
    from pellicle.surfaces.sampling import Directions


def simulate_surface(recipe: str, out: str, noise: float | None, seed: int, tolerance: float) -> int:
    """Write the recipe's BRDF as CSV. Returns the exit code."""
    from pellicle import __version__
    from pellicle.fitting.spoken import of_plan
    from pellicle.io.brdf_writers import write_brdf_samples
    from pellicle.io.surface_recipe import read_surface_recipe
    from pellicle.surfaces.sampling import synthesise

    found = read_surface_recipe(recipe)
    looked = directions(found)
    noise = (found.data.noise or 0.0) if noise is None else noise
    start()
    samples, plan = synthesise(found.surface, looked, noise, seed, tolerance)
    of_plan(plan)
    numbers = found.surface.start()
    units = {about.key: about.unit for about in found.surface.brdf.parameters}
    truth = (f"{key} = {_listed(x)} {units.get(key, 'nm')}".strip() for key, x in numbers.items())
    said = [
        "SYNTHETIC: simulated, not measured",
        f"recipe {Path(recipe).name}, seed {seed}, noise {noise:g}, pellicle {__version__}",
        f"truth: model {found.surface.model}, {', '.join(truth)}",
    ]
    write_brdf_samples(out, samples, said=said)
    say(f"{out}: {len(samples)} samples of {', '.join(samples.channels)}", *samples.notes)
    return 0


def directions(recipe: SurfaceRecipe) -> Directions | BrdfSamples:
    """Where the recipe's first file was measured, or, as is said, directions spread over the lobes."""
    from pellicle.surfaces.sampling import default_directions

    if recipe.files:
        say(f"directions: those of {recipe.files[0]}")
        return recipe.read(recipe.files[0])
    found = default_directions()
    say(f"directions: {len(found.theta_i)} spread over the lobe and around it (the recipe names no files)")
    return found


def _listed(number) -> str:
    return " ".join(f"{x:.10g}" for x in number.reshape(-1))


def plan_surface(recipe: str, tolerance: float, as_json: bool) -> int:
    """Print the plan of the recipe's surface. Returns the exit code."""
    from pellicle.io.surface_recipe import read_surface_recipe

    found = read_surface_recipe(recipe)
    looked = directions(found)
    start()
    from pellicle import costs
    from pellicle.report import plans
    from pellicle.surfaces import thrift
    from pellicle.surfaces.effects import exact
    from pellicle.surfaces.lit import lit

    seen = lit(found.surface, looked)
    chosen, calibration = thrift.plan(seen, tolerance), costs.calibrated(cache_folder())
    savings = thrift.savings(seen, calibration)
    whole, planned = (calibration.seconds(thrift.work(p, seen)) for p in (exact(seen), chosen))
    if as_json:
        print(json.dumps(plans.record(chosen, savings), allow_nan=False), flush=True)
    else:
        print(plans.table(chosen, savings, whole, planned), end="", flush=True)
    return 0


def cost_surface(recipe: str, tolerance: float | None, out: str | None, as_json: bool) -> int:
    """Print what accuracy costs for the recipe's surface. Returns the exit code."""
    from pellicle.io.atomic import new_folder
    from pellicle.io.surface_recipe import read_surface_recipe

    found = read_surface_recipe(recipe)
    looked = directions(found)
    if out is not None and Path(out).exists():
        new_folder(out)  # refuses a stranger's folder before the work, not after
    start(keep=False)
    from pellicle.io.costs import surface_to_json, write_surface_cost
    from pellicle.ladder.surface import cost
    from pellicle.report.cost import surface_text
    from pellicle.surfaces.lit import lit

    progress = Progress(recipe)
    try:
        result = cost(lit(found.surface, looked), tolerance=tolerance, progress=progress)
    finally:
        progress.clear()
    record = surface_to_json(result, recipe)
    print(json.dumps(record, allow_nan=False) if as_json else surface_text(result, recipe), flush=True)
    if out is not None:
        say(f"{write_surface_cost(out, result, recipe)}: report, figure and tables written")
    return 130 if result.interrupted else 0
