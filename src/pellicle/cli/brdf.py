"""`pellicle fit` of BRDF samples: one file after the other, each with its verdict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.cli.session import Progress, say, start
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.cli.flags import ReadWords
    from pellicle.io.surface_recipe import SurfaceRecipe


def wanted(recipe: str | None, signal: str | None) -> bool:
    """Whether what is to be fitted is a BRDF. Raises UsageError for one without a recipe."""
    if recipe is None:
        if signal == "brdf":
            raise UsageError(
                "--signal brdf needs a --recipe that describes the surface under [scene.surface]"
            )
        return False
    from pellicle.io.recipe_kind import describes_surface

    return describes_surface(recipe)


def fit_surface(
    files: list[str], recipe: str, flags: list[str], reading: ReadWords, out: str | None, as_json: bool
) -> int:
    """Fit the recipe's surface to each file. Returns the exit code."""
    from pellicle.io.surface_recipe import read_surface_recipe

    others = {name: value for name, value in vars(reading).items() if value is not None}
    for allowed in ("columns", "noise", "signal", "reference_material"):
        others.pop(allowed, None)
    if flags or others:
        refused = [*flags, *(f"--{name.replace('_', '-')}" for name in others)]
        raise UsageError(f"{', '.join(refused)} cannot be used on a BRDF; the recipe describes the surface")
    if reading.signal not in (None, "brdf"):
        raise UsageError(f"{recipe}: describes a surface, whose signal is brdf and not {reading.signal}")
    found = read_surface_recipe(recipe)
    said = {
        name: getattr(reading, name) for name in ("columns", "noise") if getattr(reading, name) is not None
    }
    found = replace(found, data=found.data.model_copy(update=said))
    if not found.surface.leaves():
        raise DataError(
            f"{recipe}: nothing is free to fit: give bounds, as in thickness = {{ lower = 0, upper = 1000 }}"
        )
    files = files or found.files
    if not files:
        raise UsageError(f"{recipe}: names no data files: give them on the command line or in [data] files")
    start()
    return _each(found, files, out, as_json)


def _each(recipe: SurfaceRecipe, files: list[str], out: str | None, as_json: bool) -> int:
    from pellicle.io.atomic import new_folder
    from pellicle.io.results import several, write_summary

    folders: list[Path | None] = [None] * len(files)
    if out is not None:
        folders = [*several(Path(out), files)]
        if Path(out).exists():
            new_folder(Path(out))  # refuses a stranger's folder before the work, not after
    records: list[dict[str, Any]] = []
    worst = 0
    try:
        for path, folder in zip(files, folders, strict=True):
            record, code = _one(recipe, path, folder, as_json)
            records.append(record)
            worst = max(worst, code)
    except KeyboardInterrupt:
        say(f"interrupted after {len(records)} of {len(files)} files; what is done is kept")
        worst = 130
    if out is not None and len(files) > 1 and records:
        write_summary(Path(out) / "summary.csv", records)
    return worst


def _one(recipe: SurfaceRecipe, path: str, folder: Path | None, as_json: bool) -> tuple[dict[str, Any], int]:
    from pellicle.brdf_fitting.fit import fit_brdf
    from pellicle.io.brdf_results import brdf_to_json, write_brdf_fit
    from pellicle.io.results import failure, one_line
    from pellicle.report.brdf import brdf_report

    progress = Progress(path)
    try:
        samples = recipe.read(path)
        say(*(f"{path}: {note}" for note in samples.notes))
        fit = fit_brdf(samples, recipe.surface, residual=recipe.data.residual, progress=progress)
    except ValueError as error:
        progress.clear()
        message = str(error) if path in str(error) else f"{path}: {error}"
        say(f"pellicle: {message}")
        record = failure(path, message)
        if as_json:
            print(one_line(record), flush=True)
        return record, 3
    progress.clear()
    record = brdf_to_json(fit)
    print(one_line(record) if as_json else brdf_report(fit), flush=True)
    if folder is not None:
        write_brdf_fit(folder, fit)
        say(f"{folder}: report, figure and tables written")
    return record, 0 if fit.status == "converged" else 4
