"""`pellicle cost`: for a recipe, what each way to the answer is off by, and how long it takes."""

from __future__ import annotations

import json as json_module
from math import inf
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.session import Progress, say, start
from pellicle.errors import UsageError


def cost(
    recipe: Annotated[str, Parameter(help="A TOML file that describes the scene.")],
    *,
    reference: Annotated[
        str, Parameter(help="What errors are measured against: float64, or mpmath with 50 digits.")
    ] = "float64",
    tolerance: Annotated[
        float | None,
        Parameter(help="The error that is small enough, in R, T, degrees or, of a surface, ΔE2000."),
    ] = None,
    datasets: Annotated[
        int, Parameter(help="Simulated spectra that every solver fits; 0 leaves the solvers out.")
    ] = 20,
    out: Annotated[str | None, Parameter(help="A folder for report, figure and tables.")] = None,
    json: Annotated[bool, Parameter(help="One JSON object on stdout.", negative="")] = False,
) -> int:
    """Show what accuracy costs in time: every way to compute a recipe's scene, and to fit it.

    Example: pellicle cost film.toml --tolerance 0.001 --out cost
    """
    from pellicle.cli.wavelengths import seen
    from pellicle.files import new_folder
    from pellicle.recipes import read_recipe
    from pellicle.recipes.surface import SurfaceRecipe

    if tolerance is not None and not 0 < tolerance < inf:
        raise UsageError(f"--tolerance must be above zero, got {tolerance:g}: what error is small enough?")
    if datasets < 0:
        raise UsageError(f"--datasets must not be negative, got {datasets}")
    found = read_recipe(recipe)
    if isinstance(found, SurfaceRecipe):
        if reference != "float64":
            raise UsageError(
                "--reference is for films: a surface is measured against steps of 1 nm in float64"
            )
        from pellicle.cli.surface_commands import cost_surface

        return cost_surface(found, tolerance, out, json)
    scene, wavelength = seen(found)
    if out is not None and Path(out).exists():
        new_folder(out)  # refuses a stranger's folder before the work, not after
    start(keep=False)
    from pellicle.accuracy.cost import cost as measure
    from pellicle.reporting.cost_files import to_json, write_cost
    from pellicle.reporting.cost_text import text

    progress = Progress(found.path)
    try:
        result = measure(
            scene,
            wavelength,
            reference=reference,
            tolerance=tolerance,
            noise=found.tables.data.noise,
            datasets=datasets,
            progress=progress,
        )
    finally:
        progress.clear()
    record = to_json(result, found.path)
    print(json_module.dumps(record, allow_nan=False) if json else text(result, found.path), flush=True)
    if out is not None:
        say(f"{write_cost(out, result, found.path)}: report, figure and tables written")
    return 130 if result.interrupted else 0
