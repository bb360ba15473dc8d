"""`pellicle compare`: fits of the same data by several recipes, ranked by AIC and BIC."""

from logging import getLogger
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.batch import CONVERGED, FAILED, UNCLEAR, error_message, measurement
from pellicle.cli.flags import OUTPUT, SCENE, flag, switch
from pellicle.cli.inputs import LEAST_SQUARES, Input, Inputs, inputs
from pellicle.cli.progress import Progress
from pellicle.cli.session import check_folder, say, show, start, with_flags
from pellicle.errors import DataError, UsageError

log = getLogger(__name__)


def compare(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[
        list[str] | None, Parameter(group=SCENE, help="Recipe to compare; give two or more.", negative="")
    ] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for the comparison and every fit.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object a line.")] = False,
) -> int:
    """Fit data by several recipes and rank these by information criteria (AIC, BIC).

    Example: pellicle compare oxide.csv --recipe smooth.toml --recipe rough.toml
    """
    recipes = list(recipe or [])
    if len(recipes) < 2:
        raise UsageError("a comparison needs two recipes or more: give --recipe A.toml --recipe B.toml")
    if len(set(recipes)) < len(recipes):
        raise UsageError("the same recipe is given twice: there is nothing to compare")
    short = [Path(path).name for path in recipes]
    names = short if len(set(short)) == len(short) else recipes
    candidates = {name: _inputs(list(data), path) for name, path in zip(names, recipes, strict=True)}
    groups = [[[file.path for file in files] for files in each.groups] for each in candidates.values()]
    if any(other != groups[0] for other in groups[1:]):
        raise UsageError("the recipes name different files: give the files on the command line")
    if out is not None:
        check_folder(out)
    start()
    worst, several = CONVERGED, len(groups[0]) > 1
    for position, paths in enumerate(groups[0]):
        folder = None if out is None else Path(out) / Path(paths[0]).stem if several else Path(out)
        worst = max(worst, _compare(candidates, position, paths, folder, json))
    return worst


def _inputs(data: list[str], recipe: str) -> Inputs:
    candidate = inputs(data, recipe)
    if candidate.loss != LEAST_SQUARES:
        raise DataError(f"{recipe}: a comparison needs least squares: leave the loss out")
    return candidate


def _compare(
    candidates: dict[str, Inputs], position: int, paths: list[str], folder: Path | None, as_json: bool
) -> int:
    """Compare the fits of one group of files, print and write the result, and return its exit code."""
    from pellicle.api.fits import fit
    from pellicle.fitting.comparison import compare as compare_fits
    from pellicle.reporting.comparison import failure, report, to_json, write_comparison
    from pellicle.reporting.json_record import one_line

    label = ", ".join(paths)
    fits = {}
    try:
        for name, candidate in candidates.items():
            log.info("comparison: now %s", name)
            files: list[Input] = candidate.groups[position]
            data, scene = measurement(files, len(files) > 1, notes=not fits)
            with Progress(f"{label}, {name}") as progress:
                fits[name] = with_flags(fit(data, scene, residual=candidate.residual, progress=progress))
        comparison = compare_fits(fits)
    except ValueError as error:
        message = error_message(error, [label])
        say(f"pellicle: {message}")
        if as_json:
            print(one_line(failure(label, message)), flush=True)
        return FAILED
    show(one_line(to_json(comparison)) if as_json else report(comparison), folder is not None)
    if folder is not None:
        try:
            write_comparison(folder, comparison)
        except ValueError as error:  # the result is printed, and the other files go on
            say(f"pellicle: {error}")
            return FAILED
        say(f"{folder}: comparison and fits written")
    return CONVERGED if comparison.best.fit.status == "converged" else UNCLEAR
