"""`pellicle fit` of BRDF samples: one file after the other, each with its verdict."""

from __future__ import annotations

from dataclasses import replace
from logging import getLogger
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.cli.batch import TOO_SHORT
from pellicle.cli.messages import as_flags, with_flags
from pellicle.cli.session import Progress, say, start
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.cli.batch import Sampler
    from pellicle.cli.flags import ReadWords, SceneWords
    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.fitting.result import Fit
    from pellicle.recipes.surface import SurfaceRecipe
    from pellicle.sampling.result import Posterior
    from pellicle.scene.surface import Surface

log = getLogger(__name__)


def of_films(words: SceneWords, joint: bool, tolerance: float) -> list[str]:
    """The flags given that only films have."""
    others = {"--joint": joint, "--tolerance": tolerance}
    return [*words.given(), *(name for name, value in others.items() if value)]


def fit_surface(
    files: list[str],
    recipe: SurfaceRecipe,
    flags: list[str],
    reading: ReadWords,
    out: str | None,
    as_json: bool,
    sampler: Sampler | None = None,
) -> int:
    """Fit the recipe's surface to each file, and with a sampler its posterior too. Returns the exit code."""
    others = {name: value for name, value in vars(reading).items() if value is not None}
    for allowed in ("columns", "noise", "signal", "reference_material"):
        others.pop(allowed, None)
    if flags or others:
        refused = [*flags, *(f"--{name.replace('_', '-')}" for name in others)]
        raise UsageError(f"{', '.join(refused)} cannot be used on a BRDF; the recipe describes the surface")
    if reading.signal not in (None, "brdf"):
        raise UsageError(f"{recipe.path}: describes a surface, whose signal is brdf and not {reading.signal}")
    said = {
        name: getattr(reading, name) for name in ("columns", "noise") if getattr(reading, name) is not None
    }
    recipe = recipe.with_data(**said)
    if not recipe.scene().free_numbers():
        raise DataError(
            f"{recipe.path}: nothing is free to fit: give bounds, as in"
            " thickness = { lower = 0, upper = 1000 }"
        )
    files = files or recipe.files
    if not files:
        raise UsageError(
            f"{recipe.path}: names no data files: give them on the command line or in [data] files"
        )
    start()
    return _each(recipe, files, out, as_json, sampler)


def _each(
    recipe: SurfaceRecipe, files: list[str], out: str | None, as_json: bool, sampler: Sampler | None
) -> int:
    from pellicle.files import new_folder
    from pellicle.reporting.folders import folder_per_file, write_summary

    folders: list[Path | None] = [None] * len(files)
    if out is not None:
        folders = [*folder_per_file(Path(out), files)]
        if Path(out).exists():
            new_folder(Path(out))  # refuses a stranger's folder before the work, not after
    records: list[dict[str, Any]] = []
    worst = 0
    try:
        for path, folder in zip(files, folders, strict=True):
            record, code = _one(recipe, path, folder, as_json, sampler)
            records.append(record)
            worst = max(worst, code)
    except KeyboardInterrupt:
        say(f"interrupted after {len(records)} of {len(files)} files; what is done is kept")
        worst = 130
    if out is not None and len(files) > 1 and records:
        write_summary(Path(out) / "summary.csv", records)
    return worst


def _one(
    recipe: SurfaceRecipe, path: str, folder: Path | None, as_json: bool, sampler: Sampler | None
) -> tuple[dict[str, Any], int]:
    from pellicle.reporting.fit_text import report
    from pellicle.reporting.folders import write_fit
    from pellicle.reporting.json_record import failure, one_line, to_json

    progress = Progress(path)
    try:
        samples, surface = recipe.read(path), recipe.scene()
        say(*(f"{path}: {note}" for note in samples.notes))
        log.info(
            "surface: %s, by %d samples of %s",
            surface.model,
            len(samples),
            ", ".join(samples.channels),
        )
        for leaf in surface.free_numbers():
            log.info("free: %s between %g and %g", leaf.name, leaf.free.lower, leaf.free.upper)
        fit, posterior = _found(recipe, surface, samples, folder, sampler, progress)
    except ValueError as error:
        progress.clear()
        message = as_flags(str(error))
        message = message if path in message else f"{path}: {message}"
        say(f"pellicle: {message}")
        failed = failure(path, message)
        if as_json:
            print(one_line(failed), flush=True)
        return failed, 3
    progress.clear()
    fit = with_flags(fit)
    posterior = None if posterior is None else replace(posterior, fit=fit)
    found = to_json(fit, posterior)
    print(one_line(found) if as_json else report(fit, posterior), flush=True)
    if folder is not None:
        write_fit(folder, fit, posterior)
        say(f"{folder}: report, figure and tables written")
    if posterior is not None and not posterior.trusted:
        return found, TOO_SHORT
    return found, 0 if fit.status == "converged" else 4


def _found(
    recipe: SurfaceRecipe,
    surface: Surface,
    samples: BrdfSamples,
    folder: Path | None,
    sampler: Sampler | None,
    progress: Progress,
) -> tuple[Fit, Posterior | None]:
    compared = {"residual": recipe.tables.data.residual, "progress": progress}
    if sampler is None:
        from pellicle.fitting.brdf.fit import fit

        return fit(samples, surface, **compared), None
    from pellicle.sampling.sample import sample

    posterior = sample(samples, surface, **sampler.settings(folder), **compared)
    return posterior.fit, posterior
