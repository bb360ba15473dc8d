"""`pellicle simulate`, `plan` and `cost` of a surface, seen along the directions of the recipe's data."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from pellicle.cli.session import Progress, cache_folder, say, start

if TYPE_CHECKING:
    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.recipes.surface import SurfaceRecipe
    from pellicle.synthetic.brdf import Directions


def simulate_surface(
    recipe: SurfaceRecipe, out: str, noise: float | None, seed: int, tolerance: float
) -> int:
    """Write the recipe's BRDF as CSV. Returns the exit code."""
    from pellicle.data.write_brdf import write_brdf_samples
    from pellicle.fitting.spectra.messages import log_plan
    from pellicle.synthetic.brdf import synthesise

    surface, looked = recipe.scene(), directions(recipe)
    noise = (recipe.tables.data.noise or 0.0) if noise is None else noise
    start()
    samples, plan = synthesise(surface, looked, noise, seed, tolerance)
    log_plan(plan)
    numbers = surface.start_numbers()
    units = {about.key: about.unit for about in surface.brdf.parameters}
    truth = (f"{key} = {_listed(x)} {units.get(key, 'nm')}".strip() for key, x in numbers.items())
    said = [
        "SYNTHETIC: simulated, not measured",
        f"recipe {Path(recipe.path).name}, seed {seed}, noise {noise:g}, pellicle {version('pellicle')}",
        f"truth: model {surface.model}, {', '.join(truth)}",
    ]
    write_brdf_samples(out, samples, said=said)
    say(f"{out}: {len(samples)} samples of {', '.join(samples.channels)}", *samples.notes)
    return 0


def directions(recipe: SurfaceRecipe) -> Directions | BrdfSamples:
    """Where the recipe's first file was measured, or, as is said, directions spread over the lobes."""
    from pellicle.synthetic.brdf import default_directions

    if recipe.files:
        say(f"directions: those of {recipe.files[0]}")
        return recipe.read(recipe.files[0])
    found = default_directions()
    say(f"directions: {len(found.theta_i)} spread over the lobe and around it (the recipe names no files)")
    return found


def _listed(number) -> str:
    return " ".join(f"{x:.10g}" for x in number.reshape(-1))


def plan_surface(recipe: SurfaceRecipe, tolerance: float, as_json: bool) -> int:
    """Print the plan of the recipe's surface. Returns the exit code."""

    surface, looked = recipe.scene(), directions(recipe)
    start()
    from pellicle.effects.surface import exact
    from pellicle.planning import cost_model
    from pellicle.planning import surface as planning
    from pellicle.reporting import plans
    from pellicle.scene.surface import surface_view

    seen = surface_view(surface, looked)
    chosen, calibration = planning.plan(seen, tolerance), cost_model.calibrated(cache_folder())
    savings = planning.savings(seen, calibration)
    whole, planned = (calibration.seconds(planning.work(p, seen)) for p in (exact(seen), chosen))
    if as_json:
        print(json.dumps(plans.to_json(chosen, savings), allow_nan=False), flush=True)
    else:
        print(plans.report_with_savings(chosen, savings, whole, planned), end="", flush=True)
    return 0


def cost_surface(recipe: SurfaceRecipe, tolerance: float | None, out: str | None, as_json: bool) -> int:
    """Print what accuracy costs for the recipe's surface. Returns the exit code."""
    from pellicle.files import new_folder

    surface, looked = recipe.scene(), directions(recipe)
    if out is not None and Path(out).exists():
        new_folder(out)  # refuses a stranger's folder before the work, not after
    start(keep=False)
    from pellicle.accuracy.surface import cost
    from pellicle.reporting.cost_files import to_json, write_cost
    from pellicle.reporting.cost_text import text
    from pellicle.scene.surface import surface_view

    progress = Progress(recipe.path)
    try:
        result = cost(surface_view(surface, looked), tolerance=tolerance, progress=progress)
    finally:
        progress.clear()
    record = to_json(result, recipe.path)
    print(json.dumps(record, allow_nan=False) if as_json else text(result, recipe.path), flush=True)
    if out is not None:
        say(f"{write_cost(out, result, recipe.path)}: report, figure and tables written")
    return 130 if result.interrupted else 0
