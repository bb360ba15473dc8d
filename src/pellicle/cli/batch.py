"""Fits of data files, one by one or together: results on stdout, folders, exit code."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from io import StringIO
from json import loads
from logging import INFO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pellicle.cli.inputs import LEAST_SQUARES, Input, Inputs
from pellicle.cli.progress import LOG, Progress, TimeLeft, duration, log_to_stderr
from pellicle.cli.session import as_flags, check_folder, say, show, with_flags
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.data.spectrum import Spectrum
    from pellicle.fitting.repeated_measurements import Repeats
    from pellicle.fitting.result import Fit
    from pellicle.sampling.result import Posterior
    from pellicle.scene.film import Scene
    from pellicle.scene.surface import Surface

CONVERGED, FAILED, UNCLEAR, TOO_SHORT, INTERRUPTED = 0, 3, 4, 5, 130
"""Exit codes: one answer, an unreadable file, any other status, a chain without an interval, Ctrl-C."""


class Sampler(NamedTuple):
    """Settings of posterior sampling; None is the library's default."""

    walkers: int | None = None
    steps: int | None = None
    seed: int = 0

    def options(self, folder: Path | None) -> dict[str, Any]:
        """Arguments of `pellicle.sample`, with the chain kept in `folder`."""
        from pellicle.reporting.folders import chain_file

        chosen = {} if self.steps is None else {"steps": self.steps}
        chain = None if folder is None else chain_file(folder)
        return {"walkers": self.walkers, "seed": self.seed, "chain": chain, **chosen}


@dataclass
class Batch:
    """Fits of several files; with a `sampler` each is followed by its posterior.

    A file that fails does not stop the others. `records` are the JSON records of the results so far, and
    `fits` the fits of repeated measurements. Several files are fitted by as many processes as there are
    `jobs`.

    Results of several files that an earlier run left in the folder `out`, from the same data by the same
    scene, settings and version, are printed and not computed again, unless `refit` is true. `kept` counts
    them.
    """

    inputs: Inputs
    sampler: Sampler | None = None
    out: str | None = None
    json: bool = False
    jobs: int = 1
    refit: bool = False
    verbose: bool = field(default_factory=lambda: LOG.isEnabledFor(INFO))
    records: list[dict[str, Any]] = field(default_factory=list)
    fits: list[Fit] = field(default_factory=list)
    kept: int = 0

    def run(self) -> int:
        """Fit every group of files, print and write each result, and return the largest exit code."""
        from pellicle.reporting.folders import folder_per_file

        if self.sampler is not None and self.inputs.loss != LEAST_SQUARES:
            raise UsageError("a posterior needs least squares: leave the loss out, or the posterior")
        groups = self.inputs.groups
        folders: list[Path | None] = [None] * len(groups)
        if self.out is not None:
            check_folder(self.out)
            folders = [*folder_per_file(self.out, [files[0].path for files in groups])]
            self.refit |= len(groups) == 1 or self.inputs.repeats  # repeats compare fits, not records
        again = "" if self.out is None else ": the same command goes on from there"
        worst = CONVERGED
        try:
            for code in self._codes(groups, folders):
                worst = max(worst, code, self._summarise(len(groups)))
        except KeyboardInterrupt:
            say(
                f"interrupted after {len(self.records)} of {len(groups)} files; finished results are kept"
                f"{again}"
            )
            worst = INTERRUPTED
        except BrokenExecutor:
            say(
                f"pellicle: a worker process ended before its fit did, often for lack of memory:"
                f" {len(self.records)} of {len(groups)} files are done; fit the others with fewer --jobs"
            )
            worst = FAILED
        if self.kept:
            say(
                f"{self.kept} of {len(groups)} files were not fitted again: an earlier run has their results,"
                " of the same data, scene, settings and version; --refit fits them, too"
            )
        compared = self._compare() if self.inputs.repeats and worst != INTERRUPTED else None
        if self.out is not None and len(groups) > 1 and self.records:
            worst = max(worst, self._index(folders, compared))
        return worst

    def _summarise(self, files: int) -> int:
        """Write the table of all results so far, and return FAILED where it cannot be written."""
        from pellicle.reporting.folders import SUMMARY, write_summary

        if self.out is None or files == 1:
            return CONVERGED
        try:
            write_summary(Path(self.out) / SUMMARY, self.records)
        except ValueError as error:
            if len(self.records) == files:  # said once
                say(f"pellicle: {error}")
            return FAILED
        return CONVERGED

    def _index(self, folders: list[Path | None], repeats: Repeats | None) -> int:
        """Write the page of all results so far, and return FAILED where it cannot be written."""
        from pellicle.reporting.folders import write_index

        assert self.out is not None
        try:
            write_index(self.out, self.records, folders, repeats)
        except ValueError as error:
            say(f"pellicle: {error}")
            return FAILED
        return CONVERGED

    def _compare(self) -> Repeats | None:
        """Compare the scatter of repeated measurements with their errors, print and write the result.

        None where they cannot be compared.
        """
        from pellicle.fitting.repeated_measurements import repeats
        from pellicle.reporting.json_record import one_line
        from pellicle.reporting.repeats import failure, report, to_json, write_repeats

        try:
            compared = repeats(self.fits)
        except UsageError as error:
            say(f"pellicle: {error}")
            if self.json:
                print(one_line(failure([file.path for file in self.inputs.files], str(error))), flush=True)
            return None
        show(one_line(to_json(compared)) if self.json else report(compared), self.out is not None)
        if self.out is not None:
            write_repeats(self.out, compared)
        return compared

    def _codes(self, groups: list[list[Input]], folders: list[Path | None]) -> Iterator[int]:
        """Fit the groups one by one, or in worker processes, and yield their exit codes in order."""
        tasks = list(zip(groups, folders, strict=True))
        if self.jobs == 1 or len(tasks) == 1:
            left = TimeLeft()
            for number, task in enumerate(tasks):
                seconds = left("files", number - self.kept, len(tasks) - self.kept)
                position = f"file {number + 1} of {len(tasks)}" if len(tasks) > 1 else ""
                rest = duration(seconds)
                yield self._fit(*task, f"{position}, {rest} left" if rest else position)
            return
        from pellicle.cli.processes import in_order

        own = [
            replace(self, inputs=replace(self.inputs, files=files), records=[], fits=[]) for files in groups
        ]
        with Progress(f"{len(tasks)} files") as progress:
            progress("fit", 0, len(tasks))
            for done, result in enumerate(in_order(_captured, zip(own, folders, strict=True), self.jobs), 1):
                progress.clear()
                with suppress(BrokenPipeError):
                    print(result.err, end="", file=sys.stderr, flush=True)
                show(result.out, self.out is not None, end="")
                self.records.append(result.record)
                self.fits += result.fits
                self.kept += result.kept
                yield result.code
                progress("fit", done, len(tasks))

    def _fit(self, files: list[Input], folder: Path | None, position: str = "") -> int:
        """Fit one group of files, print and write the result, and return its exit code.

        `position` in the batch is a part of the progress line.
        """
        from pellicle.reporting.fit_text import report
        from pellicle.reporting.json_record import failure, one_line, to_json

        paths, identity = [file.path for file in files], ""
        place = f"{', '.join(paths)} ({position})" if position else ", ".join(paths)
        try:
            data, scene = measurement(files, self.inputs.joint)
            if folder is not None:
                settings = self.inputs.tolerance, self.inputs.loss, self.inputs.residual, self.sampler
                identity = fingerprint(data, scene, settings)
                if not self.refit and (kept := earlier(folder, identity)):
                    return self._repeat(kept, folder)
            with Progress(place) as progress:
                fit, posterior = self._result(data, scene, folder, progress)
        except ValueError as error:
            message = error_message(error, paths)
            say(f"pellicle: {message}")
            self.records.append(failure(paths if self.inputs.joint else paths[0], message))
            if self.json:
                print(one_line(self.records[-1]), flush=True)
            return FAILED  # also where the error is one of usage: the other files go on
        record = to_json(fit, posterior)
        self.records.append(record)
        if self.inputs.repeats:
            self.fits.append(fit)
        self._print(record, "" if self.json else report(fit, posterior))
        code = CONVERGED if fit.status == "converged" else UNCLEAR
        if posterior is not None and not posterior.trusted:
            code = TOO_SHORT
        return code if folder is None else max(code, self._write(folder, files, fit, posterior, identity))

    def _repeat(self, kept: Earlier, folder: Path) -> int:
        """Print the result of an earlier run, and return its exit code."""
        self.kept += 1
        self.records.append(kept.record)
        self._print(kept.record, kept.report)
        say(f"{folder}: from an earlier run")
        return CONVERGED if kept.record["status"] == "converged" else UNCLEAR

    def _print(self, record: dict[str, Any], report: str) -> None:
        from pellicle.reporting.json_record import one_line

        show(one_line(record) if self.json else report, self.out is not None)

    def _result(
        self, data: Any, scene: Any, folder: Path | None, progress: Progress
    ) -> tuple[Fit, Posterior | None]:
        from pellicle.api.fits import fit, sample

        options: dict[str, Any] = {"tolerance": self.inputs.tolerance, "residual": self.inputs.residual}
        if self.sampler is None:
            return with_flags(fit(data, scene, loss=self.inputs.loss, progress=progress, **options)), None
        posterior = sample(data, scene, progress=progress, **self.sampler.options(folder), **options)
        posterior = replace(posterior, fit=with_flags(posterior.fit))
        return posterior.fit, posterior

    def _write(
        self, folder: Path, files: list[Input], fit: Fit, posterior: Posterior | None, identity: str
    ) -> int:
        """Write the folder of a result, and return FAILED where it cannot be written."""
        from pellicle.reporting.folders import write_fit

        recipe = partial(self.inputs.recipe, files)
        try:
            write_fit(folder, fit, posterior, identity, self.inputs.described, recipe)
        except ValueError as error:  # the result is printed, and the other files go on
            say(f"pellicle: {error}; the result is printed, and the same command writes its files")
            return FAILED
        say(f"{folder}: report, figures and tables written")
        return CONVERGED


class _Captured(NamedTuple):
    """A finished fit of a worker process: exit code, record, and its text on both streams; `fits` has the
    fit itself where it is compared with others."""

    code: int
    record: dict[str, Any]
    fits: list[Fit]
    kept: int
    out: str
    err: str


def _captured(task: tuple[Batch, Path | None]) -> _Captured:
    """Fit the one group of a batch, and write its folder."""
    batch, folder = task
    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err), log_to_stderr() if batch.verbose else nullcontext():
        code = batch._fit(batch.inputs.files, folder)
    return _Captured(code, batch.records[0], batch.fits, batch.kept, out.getvalue(), err.getvalue())


def measurement(
    files: list[Input], joint: bool, notes: bool = True
) -> tuple[Spectrum | BrdfSamples | list[Any], Scene | Surface | list[Scene]]:
    """Read files: data and scene as `pellicle.fit` takes them, lists in a joint fit.

    The notes of the readers go to stderr, unless `notes` is false.
    """
    from pellicle.data.spectrum import Spectrum
    from pellicle.fitting.film.targets import without_scale
    from pellicle.scene.film import Scene
    from pellicle.scene.surface import Surface

    data, scenes = [], []
    for file in files:
        spectra = file.read()
        for values in spectra:
            say(*(f"{file.path}: {note}" for note in values.notes if notes))
            shared = len(files) + len(spectra) > 2 and not file.own_scale
            scene = file.scene
            if shared and isinstance(values, Spectrum) and isinstance(scene, Scene):
                scene = without_scale(scene, values)
            data.append(values)
            scenes.append(scene)
    if not joint and len(data) == 1:
        return data[0], scenes[0]
    return data, scenes[0] if isinstance(scenes[0], Surface) else scenes


def error_message(error: Exception, paths: list[str]) -> str:
    """The message of an error with flags for arguments, and the data files in front unless it names one."""
    message = as_flags(str(error))
    return message if any(path in message for path in paths) else f"{', '.join(paths)}: {message}"


class Earlier(NamedTuple):
    """The JSON record of a fit that is in its folder, and its report."""

    record: dict[str, Any]
    report: str


def fingerprint(*parts: Any) -> str:
    """Hash of pellicle's version and of `parts`: data, scenes and settings of a fit."""
    from pellicle.data.fingerprint import fingerprint as content_fingerprint
    from pellicle.reporting.json_record import versions

    return content_fingerprint(versions()["pellicle"], *parts)


def earlier(folder: Path, identity: str) -> Earlier | None:
    """The finished result of a fit with this fingerprint, None where the folder has none.

    A chain that was too short goes on, so its result does not count.
    """
    from pellicle.files import MARKER
    from pellicle.reporting.folders import FINGERPRINT, REPORT, SCENE
    from pellicle.reporting.json_record import SCHEMA

    try:
        record = loads((folder / MARKER).read_text(encoding="utf-8"))
        report = (folder / REPORT).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None
    if not isinstance(record, dict) or record.get("schema") != SCHEMA or "data" not in record:
        return None
    record.pop(SCENE, None)  # printed by no fit
    if record.pop(FINGERPRINT, None) != identity or not record.get("posterior", {}).get("trusted", True):
        return None
    return Earlier(record, report)
