"""`pellicle simulate`: a synthetic spectrum from a recipe, with noise and the truth in its header."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.session import not_negative, say, start
from pellicle.errors import DataError

if TYPE_CHECKING:
    from pellicle.recipes.film import FilmRecipe


def simulate(
    recipe: Annotated[str, Parameter(help="A TOML file that describes the scene.")],
    *,
    out: Annotated[str, Parameter(help="The CSV file to write; an existing one is not overwritten.")],
    noise: Annotated[
        float | None, Parameter(help="Standard deviation of the noise (the recipe's, or 0).")
    ] = None,
    seed: Annotated[int, Parameter(help="Seed of the noise.")] = 0,
    tolerance: Annotated[
        float, Parameter(help="Leave out effects that change the signal by less than this; 0: none.")
    ] = 0.0,
) -> int:
    """Write the spectrum, or for a surface the samples of its BRDF, that a recipe's scene would give.

    Example: pellicle simulate film.toml --out film.csv --noise 0.002 --seed 1
    """
    from pellicle.cli.wavelengths import wavelengths
    from pellicle.files import write_text
    from pellicle.recipes import read_recipe
    from pellicle.recipes.surface import SurfaceRecipe

    not_negative("--noise", noise or 0.0)
    not_negative("--tolerance", tolerance)
    found = read_recipe(recipe)
    if isinstance(found, SurfaceRecipe):
        from pellicle.cli.surface_commands import simulate_surface

        return simulate_surface(found, out, noise, seed, tolerance)
    scene = found.scene()
    start()
    from pellicle.fitting.spectra import messages
    from pellicle.synthetic.spectra import synthesise, synthesise_angles

    messages.log_scene(scene)
    ellipsometric = scene.light.signal == "psi-delta"
    if ellipsometric and found.tables.data.angle is None:
        raise DataError(f"{found.path}: ellipsometry needs an angle of incidence: give [data] angle = 70")
    noise = (found.tables.data.noise or 0.0) if noise is None else noise
    wavelength = wavelengths(found, scene)
    result = (synthesise_angles if ellipsometric else synthesise)(scene, wavelength, noise, seed, tolerance)
    messages.log_plan(result.plan)
    write_text(out, _csv(found, scene, result, noise, seed))
    say(f"{out}: {len(wavelength)} points, {wavelength[0]:g} to {wavelength[-1]:g} nm")
    return 0


def _csv(recipe: FilmRecipe, scene: Any, result: Any, noise: float, seed: int) -> str:
    """The file's text: what it is, from which recipe and seed, the truth, then the numbers."""
    from pellicle.fitting.spectra.parameters import fixed_numbers, parameters

    light = scene.light
    truth = [(p.name, p.start, p.unit) for p in parameters(scene)] + fixed_numbers(scene)
    head = [
        "SYNTHETIC: simulated, not measured",
        f"recipe {Path(recipe.path).name}, seed {seed}, noise {noise:g}, pellicle {version('pellicle')}",
        f"signal {light.signal}, angle {_angle(light.angle)} degrees, {light.polarisation}",
        "truth: "
        + ", ".join(f"{name} = {value:.10g}{' ' + unit if unit else ''}" for name, value, unit in truth),
    ]
    columns, middle = f"wavelength_nm,{light.signal}", ""
    if light.signal == "psi-delta":
        columns, middle = "wavelength_nm,angle_deg,psi_deg,delta_deg", f"{_angle(light.angle)},"
    columns, end = (f"{columns},sigma", f",{noise:g}") if noise else (columns, "")
    values = [",".join(f"{v:.8f}" for v in row) for row in result.values.reshape(len(result.wavelength), -1)]
    rows = [f"{w:.10g},{middle}{v}{end}" for w, v in zip(result.wavelength, values, strict=True)]
    return "\n".join([*(f"# {line}" for line in head), columns, *rows, ""])


def _angle(angle: Any) -> str:
    return f"{getattr(angle, 'start', angle):g}"
