"""`pellicle fit`, `pellicle sample` and `pellicle compare`: fits, their posteriors, and their comparison."""

from functools import partial
from logging import getLogger
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from pellicle.api.recipe_fits import LEAST_SQUARES, Inputs, measurement
from pellicle.cli.batch import Batch, written
from pellicle.cli.flags import (
    OUTPUT,
    SAMPLER,
    SCENE,
    BatchFlags,
    FileFlags,
    FitFlags,
    SamplerFlags,
    SceneFlags,
    flag,
    switch,
)
from pellicle.cli.inputs import inputs
from pellicle.cli.messages import Progress, say, show, with_flags
from pellicle.cli.session import GOOD, UNCLEAR, check_folder, error_message, reported, start
from pellicle.errors import DataError, UsageError

log = getLogger(__name__)


def fit(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "TOML file that describes the scene or surface.")] = None,
    scene: Annotated[SceneFlags | None, Parameter(name="*")] = None,
    reading: Annotated[FileFlags | None, Parameter(name="*")] = None,
    fitting: Annotated[FitFlags | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "Fit all files together: they are of one sample.")] = False,
    repeats: Annotated[
        bool, switch(SCENE, "Compare all files: they are repeated measurements of one spot.")
    ] = False,
    posterior: Annotated[bool, switch(SAMPLER, "Sample the posterior too, as pellicle sample does.")] = False,
    results: Annotated[BatchFlags | None, Parameter(name="*")] = None,
) -> int:
    """Fit a layer to measured reflectance, transmittance, ellipsometry, colours or BRDF samples.

    Example: pellicle fit oxide.csv --layer SiO2 --substrate Si --thickness 10:3000
    """
    results = (results or BatchFlags()).checked()
    files = inputs(list(data), recipe, scene, reading, fitting, joint, repeats)
    start()
    return Batch(files, SamplerFlags() if posterior else None, **vars(results)).run()


def sample(
    *data: Annotated[str, Parameter(help="Files to fit and sample, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "TOML file that describes the scene or surface.")] = None,
    scene: Annotated[SceneFlags | None, Parameter(name="*")] = None,
    reading: Annotated[FileFlags | None, Parameter(name="*")] = None,
    fitting: Annotated[FitFlags | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "One posterior for all files: they are of one sample.")] = False,
    chain: Annotated[SamplerFlags | None, Parameter(name="*")] = None,
    results: Annotated[BatchFlags | None, Parameter(name="*")] = None,
) -> int:
    """Fit, then sample the posterior of every free parameter, starting from every minimum that matters.

    Example: pellicle sample oxide.csv --layer SiO2 --substrate Si --free n --out results/oxide
    """
    results = (results or BatchFlags()).checked()
    sampler = (chain or SamplerFlags()).checked()
    files = inputs(list(data), recipe, scene, reading, fitting, joint, False)
    start()
    return Batch(files, sampler, **vars(results)).run()


def compare(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[
        list[str] | None, Parameter(group=SCENE, help="Recipe to compare; give two or more.", negative="")
    ] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for the comparison and every fit.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object a line.")] = False,
) -> int:
    """Fit data by several recipes and rank these by their evidence (ln Z), with AIC and BIC beside it.

    Example: pellicle compare oxide.csv --recipe smooth.toml --recipe rough.toml
    """
    recipes = list(recipe or [])
    if len(recipes) < 2:
        raise UsageError("a comparison needs two recipes or more: give --recipe A.toml --recipe B.toml")
    if len(set(recipes)) < len(recipes):
        raise UsageError("the same recipe is given twice: there is nothing to compare")
    short = [Path(path).name for path in recipes]
    names = short if len(set(short)) == len(short) else recipes
    candidates = {name: inputs(list(data), path) for name, path in zip(names, recipes, strict=True)}
    for candidate, path in zip(candidates.values(), recipes, strict=True):
        if candidate.loss != LEAST_SQUARES:
            raise DataError(f"{path}: a comparison needs least squares: leave the loss out")
    groups = [[[file.path for file in files] for files in each.groups] for each in candidates.values()]
    if any(other != groups[0] for other in groups[1:]):
        raise UsageError("the recipes name different files: give the files on the command line")
    if out is not None:
        check_folder(out)
    start()
    from pellicle.reporting.folders import folder_per_file
    from pellicle.reporting.page.repetition import comparison_again

    worst = GOOD
    first = [paths[0] for paths in groups[0]]
    folders = [None] * len(first) if out is None else folder_per_file(out, first)
    for position, (paths, folder) in enumerate(zip(groups[0], folders, strict=True)):
        again = comparison_again(dict(zip(names, recipes, strict=True)), data, position)
        worst = max(worst, _compare(candidates, position, paths, folder, json, again))
    return worst


def _compare(
    candidates: dict[str, Inputs],
    position: int,
    paths: list[str],
    folder: Path | None,
    as_json: bool,
    again: list[tuple[str, str]],
) -> int:
    """Compare the fits of one group of files, print and write the result with what repeats it, and return its
    exit code."""
    from pellicle.api.fits import covered_by, fitted
    from pellicle.fitting.comparison import best_explained, check_same
    from pellicle.reporting.comparison import failure, report, to_json, write_comparison

    label, first = ", ".join(paths), next(iter(candidates))

    def fitted_by(name: str, explained: bool) -> Any:
        log.info("comparison: now %s", name)
        with Progress(f"{label}, {name}") as progress:
            options = {"residual": candidates[name].residual, "progress": progress, "explained": explained}
            return with_flags(fitted(*problems[name], **options))

    try:
        groups = {name: each.groups[position] for name, each in candidates.items()}
        problems = {
            name: measurement(files, len(files) > 1, say if name == first else None)
            for name, files in groups.items()
        }
        seen = [scene for _, scene in problems.values()]
        cut = {name: covered_by(data, *seen) for name, (data, _) in problems.items()}
        say(*(f"{label}: {sentence}" for sentence in cut[first][1]))
        problems = {name: (cut[name][0], scene) for name, (_, scene) in problems.items()}
        check_same({n: data if isinstance(data, list) else [data] for n, (data, _) in problems.items()})
        comparison = best_explained(candidates, fitted_by)
    except ValueError as error:
        message = error_message(error, [label])
        return reported(message, failure(label, message) if as_json else None)
    show(to_json(comparison) if as_json else report(comparison), folder is not None)
    code = GOOD if comparison.best.fit.status == "converged" else UNCLEAR
    if folder is None:
        return code
    write = partial(write_comparison, folder, comparison, again)
    return max(code, written(write, f"{folder}: comparison and fits written"))
