"""`pellicle plan-measurement`: the measurement that decides between recipes, or determines a film best."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.messages import Progress, say, show
from pellicle.cli.session import start
from pellicle.data.options import SPACES
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    import numpy as np

    from pellicle.fitting.result import Fit
    from pellicle.scene.film import Scene


def plan_measurement(
    *recipe: Annotated[str, Parameter(help="Recipe of the film, or recipes of rivals.")],
    signals: Annotated[
        str | None, Parameter(help="Signals that can be measured, such as R,psi-delta (R,T,psi-delta).")
    ] = None,
    angles: Annotated[
        str | None, Parameter(help="Angles of incidence that can be measured, in degrees: 0,60,70.")
    ] = None,
    polarisations: Annotated[
        str | None, Parameter(help="Polarisations of R at oblique incidence (unpolarised,s,p).")
    ] = None,
    noise: Annotated[
        float | None, Parameter(help="Standard deviation of a point of R and T (0.002).", metavar="SIGMA")
    ] = None,
    noise_degrees: Annotated[
        float | None, Parameter(help="Standard deviation of psi and delta (0.03).", metavar="DEGREES")
    ] = None,
    json: Annotated[bool, Parameter(help="Print one JSON object.", negative="")] = False,
) -> int:
    """Find the measurement that decides between rival recipes, or that determines one film best.

    A recipe that names data files is fitted to them first; of another one the values count.

    Example: pellicle plan-measurement nitride.toml oxide.toml --signals R,psi-delta
    """
    if not recipe:
        raise UsageError("no recipe is given: give that of a film, or two or more of rivals")
    if len(set(recipe)) < len(recipe):
        raise UsageError("the same recipe is given twice: there is nothing to decide")
    for name, level in (("noise", noise), ("noise_degrees", noise_degrees)):
        if level is not None and not 0 < level < inf:
            raise UsageError(f"`{name}` must be above zero, got {level:g}")
    words = {
        name: None if text is None else [word.strip() for word in text.split(",")]
        for name, text in (("signals", signals), ("polarisations", polarisations))
    }
    chosen = None if angles is None else _degrees(angles)
    short = [Path(path).name for path in recipe]
    names = short if len(set(short)) == len(short) else recipe
    start()
    from pellicle.api.plans import plan_measurement as planned
    from pellicle.reporting.measurement_plan import report, to_json

    described = [_described(path) for path in recipe]
    scenes = {name: scene for name, (scene, _) in zip(names, described, strict=True)}
    about: dict[str, Any] = {"angles": chosen, "noise": noise, "noise_degrees": noise_degrees, **words}
    with Progress("measurements") as progress:
        # those of the first recipe, where every material has data
        result = planned(scenes, described[0][1], **about, progress=progress)
    show(to_json(result) if json else report(result))
    return 0


def _degrees(text: str) -> list[float]:
    """Angles of a list. Raises UsageError."""
    try:
        angles = [float(word) for word in text.split(",")]
    except ValueError:
        angles = [inf]
    if not all(0 <= angle < 90 for angle in angles):
        raise UsageError(f"--angles {text}: expected degrees from 0 to below 90, as in --angles 0,60,70")
    return angles


def _described(path: str) -> tuple[Scene | Fit, np.ndarray]:
    """The scene of a recipe, or the fit of the files that it names, and the wavelengths (nm)."""
    import numpy as np

    from pellicle.api.fits import fit
    from pellicle.api.recipe_fits import measurement
    from pellicle.cli.inputs import inputs
    from pellicle.cli.reading import scene_and_wavelengths
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    recipe = read_recipe(path)
    if isinstance(recipe, SurfaceRecipe) or recipe.tables.data.signal in SPACES or recipe.samples:
        raise DataError(f"{path}: measurements are planned for the spectra of one film: give its recipe")
    if not recipe.files:
        return scene_and_wavelengths(recipe)
    files = inputs([], path).groups[0]
    data, scene = measurement(files, len(files) > 1, say)
    with Progress(path) as progress:
        result = fit(data, scene, progress=progress)
    say(f"{path}: fitted to {', '.join(file.path for file in files)}: {result.status}")
    return result, np.unique(result.parts[0].spectrum.wavelength)
