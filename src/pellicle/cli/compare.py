"""`pellicle compare`: the same data by several recipes, and which of them the data call for."""

from __future__ import annotations

import json as json_module
from logging import getLogger
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.flags import OUTPUT, SCENE, ReadWords, SceneWords, flag, switch
from pellicle.cli.messages import as_flags, with_flags
from pellicle.cli.session import Progress, say, start
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.cli.batch import Look
    from pellicle.fitting.comparison import Comparison

log = getLogger(__name__)


def compare(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[
        list[str] | None,
        Parameter(group=SCENE, help="A recipe to compare; give it two times or more.", negative=""),
    ] = None,
    out: Annotated[str | None, flag(OUTPUT, "A folder for the comparison and every fit.")] = None,
    json: Annotated[bool, switch(OUTPUT, "One JSON object a line.")] = False,
) -> int:
    """Fit data by several recipes and say which of them the data call for (AIC, BIC).

    Example: pellicle compare oxide.csv --recipe smooth.toml --recipe rough.toml
    """
    recipes = list(recipe or [])
    if len(recipes) < 2:
        raise UsageError("a comparison needs two recipes or more: give --recipe A.toml --recipe B.toml")
    if len(set(recipes)) < len(recipes):
        raise UsageError("the same recipe is given twice: there is nothing to compare")
    each = [_groups(list(data), path) for path in recipes]
    paths = [[[look.path for look in looks] for looks in groups] for groups in each]
    if any(other != paths[0] for other in paths[1:]):
        raise UsageError("the recipes name different files: give the files on the command line")
    if out is not None and Path(out).exists():
        from pellicle.files import new_folder

        new_folder(out)  # refuses a stranger's folder before the work, not after
    start()
    names = _names(recipes)
    worst, many = 0, len(paths[0]) > 1
    for position, files in enumerate(paths[0]):
        looks = {name: groups[position] for name, groups in zip(names, each, strict=True)}
        folder = None if out is None else Path(out) / Path(files[0]).stem if many else Path(out)
        worst = max(worst, _one(", ".join(files), looks, folder, json))
    return worst


def _groups(data: list[str], recipe: str) -> list[list[Look]]:
    from pellicle.cli.inputs import groups
    from pellicle.recipes import read_recipe
    from pellicle.recipes.surface import SurfaceRecipe

    of_film = read_recipe(recipe)
    if isinstance(of_film, SurfaceRecipe):
        raise UsageError(f"{recipe}: describes a surface; a comparison is of films")
    found, _ = groups(data, of_film, SceneWords(), ReadWords(), False)
    if any(look.reading.loss not in (None, "least-squares") for looks in found for look in looks):
        raise DataError(f"{recipe}: a comparison needs least squares: leave the loss out")
    return found


def _names(recipes: list[str]) -> list[str]:
    """The recipes without their folders, where that tells them apart."""
    short = [Path(path).name for path in recipes]
    return short if len(set(short)) == len(short) else recipes


def _one(label: str, looks: dict[str, list[Look]], folder: Path | None, as_json: bool) -> int:
    from pellicle.fitting.comparison import compare as compared
    from pellicle.reporting.comparison import failure, report, to_json, write_comparison

    progress, first = Progress(label), next(iter(looks))
    try:
        found = compared({name: _fit(name, looks[name], progress, talk=name == first) for name in looks})
    except ValueError as error:
        progress.clear()
        message = as_flags(str(error))
        message = message if label in message else f"{label}: {message}"
        say(f"pellicle: {message}")
        if as_json:
            print(json_module.dumps(failure(label, message), allow_nan=False), flush=True)
        return 3
    progress.clear()
    print(json_module.dumps(to_json(found), allow_nan=False) if as_json else report(found), flush=True)
    if folder is not None:
        say(f"{write_comparison(folder, found)}: comparison and fits written")
    return _code(found)


def _fit(name: str, looks: list[Look], progress: Progress, talk: bool) -> Any:
    from pellicle.cli.batch import measurements
    from pellicle.fitting.spectra.fit import fit

    log.info("comparison: now %s", name)
    return with_flags(fit(*measurements(looks, joint=len(looks) > 1, talk=talk), progress=progress))


def _code(found: Comparison) -> int:
    return 0 if found.best.fit.status == "converged" else 4
