"""Fits of data files, one by one or together: results on stdout, folders, exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from io import StringIO
from json import loads
from logging import INFO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.api.recipe_fits import LEAST_SQUARES, Input, Inputs, measurement
from pellicle.cli.flags import SamplerFlags
from pellicle.cli.messages import (
    LOG,
    Progress,
    TimeLeft,
    duration,
    log_to_stderr,
    say,
    show,
    with_flags,
)
from pellicle.cli.session import (
    BAD_DATA,
    GOOD,
    INTERRUPTED,
    OFF_SPEC,
    TOO_SHORT,
    UNCLEAR,
    check_folder,
    error_message,
    reported,
)
from pellicle.errors import UsageError
from pellicle.programs.workers import workers_for

if TYPE_CHECKING:
    from pellicle.fitting.repeated_measurements import Repeats
    from pellicle.fitting.result import Fit
    from pellicle.sampling.result import Posterior

JOURNAL_MM = 86.0
"""Width of a column of most journals of physics."""


@dataclass
class Batch:
    """Fits of several files; with a `sampler` each is followed by its posterior.

    A file that fails does not stop the others. `records` are the JSON records of the results so far, and
    `fits` the fits of repeated measurements. Several files are fitted by as many processes as there are
    `jobs`; with None by this one, and by several as soon as that saves time.

    Results of several files that an earlier run left in the folder `out`, from the same data by the same
    scene, settings and version, are printed and not computed again, unless `refit` is true. `kept` counts
    them. Of several files each result is one line (`brief`) unless `verbose`, and only the first has its
    notes: a batch of a worker process that does not have it is `later`. `spec` are texts of limits.
    `figure` is the path of a figure of one fit.
    """

    inputs: Inputs
    sampler: SamplerFlags | None = None
    out: str | None = None
    json: bool = False
    jobs: int | None = None
    refit: bool = False
    spec: list[str] | None = None
    figure: str | None = None
    verbose: bool = field(default_factory=lambda: LOG.isEnabledFor(INFO))
    records: list[dict[str, Any]] = field(default_factory=list)
    fits: list[Fit] = field(default_factory=list)
    kept: int = 0
    brief: bool = False
    later: bool = False

    def run(self) -> int:
        """Fit every group of files, print and write each result, and return the largest exit code."""
        from pellicle.reporting.folders import REPEATS, SUMMARY, folder_per_file, write_index, write_summary

        if self.sampler is not None and self.inputs.loss != LEAST_SQUARES:
            raise UsageError("a posterior needs least squares: leave the loss out, or the posterior")
        groups = self.inputs.groups
        if self.figure is not None:
            from pellicle.reporting.matplotlib_figure import figure_path

            if len(groups) > 1:
                raise UsageError("--figure is of one fit: give one file or --joint, or --out for all figures")
            figure_path(self.figure, "figure")
        if self.spec and len(groups[0]) == 1:
            from pellicle.reporting.specification import check_names, parse_limits

            check_names(parse_limits(self.spec), groups[0][0].scene)
        self.brief = len(groups) > 1 and not self.verbose and not self.inputs.repeats
        folders: list[Path | None] = [None] * len(groups)
        if self.out is not None:
            check_folder(self.out)
            folders = [*folder_per_file(self.out, [files[0].path for files in groups])]
            self.refit |= len(groups) == 1 or self.inputs.repeats  # repeats compare fits, not records
        again = "" if self.out is None else ": the same command goes on from there"
        worst = GOOD
        try:
            for code in self._codes(groups, folders):
                worst = max(worst, code)
                if self.out is not None and len(groups) > 1:
                    write = partial(write_summary, Path(self.out) / SUMMARY, self.records)
                    last = len(self.records) == len(groups)  # an error is stated once
                    worst = max(worst, written(write, failed="" if last else None))
        except KeyboardInterrupt:
            done = f"{len(self.records)} of {len(groups)} files"
            say(f"interrupted after {done}; finished results are kept{again}")
            worst = INTERRUPTED
        except BrokenExecutor:
            say(
                f"pellicle: a worker process ended before its fit did, often for lack of memory:"
                f" {len(self.records)} of {len(groups)} files are done; fit the others with fewer --jobs"
            )
            worst = BAD_DATA
        if self.kept:
            say(
                f"{self.kept} of {len(groups)} files were not fitted again: an earlier run has their results,"
                " of the same data, scene, settings and version; --refit fits them, too"
            )
        compared = self._compare() if self.inputs.repeats and worst != INTERRUPTED else None
        if self.out is not None and compared is None and worst != INTERRUPTED:
            for name in REPEATS:  # of earlier files
                (Path(self.out) / name).unlink(missing_ok=True)
        if self.out is not None and len(groups) > 1 and self.records:
            worst = max(worst, written(partial(write_index, self.out, self.records, folders, compared)))
        return worst

    def _compare(self) -> Repeats | None:
        """Compare the scatter of repeated measurements with their errors, print and write the result.

        None where they cannot be compared.
        """
        from pellicle.fitting.repeated_measurements import repeats
        from pellicle.reporting.repeats import failure, report, to_json, write_repeats

        try:
            compared = repeats(self.fits)
        except UsageError as error:
            record = failure([file.path for file in self.inputs.files], str(error))
            reported(str(error), record if self.json else None)
            return None
        show(to_json(compared) if self.json else report(compared), self.out is not None)
        if self.out is not None:
            write_repeats(self.out, compared)
        return compared

    def _codes(self, groups: list[list[Input]], folders: list[Path | None]) -> Iterator[int]:
        """Fit the groups one by one, or in worker processes, and yield their exit codes in order."""
        tasks, left, workers = list(zip(groups, folders, strict=True)), TimeLeft(), self.jobs or 1
        for number, task in enumerate(tasks):
            seconds = left("files", number - self.kept, len(tasks) - self.kept)
            if self.jobs is None:
                workers = workers_for(seconds)
            if workers > 1 and len(tasks) > 1:
                yield from self._shared(tasks, number, workers)
                return
            position = f"file {number + 1} of {len(tasks)}" if len(tasks) > 1 else ""
            rest = duration(seconds)
            yield self._fit(*task, f"{position}, {rest} left" if rest else position)

    def _shared(
        self, tasks: list[tuple[list[Input], Path | None]], first: int, workers: int
    ) -> Iterator[int]:
        """Fit the groups from the `first` on in worker processes, and yield their exit codes in order."""
        from pellicle.cli.session import in_order

        def part(number: int, files: list[Input]) -> Batch:
            own = replace(self.inputs, files=files)
            return replace(self, inputs=own, records=[], fits=[], kept=0, later=number > 0)

        parts = [(part(number, files), folder) for number, (files, folder) in enumerate(tasks)][first:]
        with Progress(f"{len(tasks)} files") as progress:
            progress("fit", first, len(tasks))
            results = in_order(_captured, parts, workers)
            for done, (code, one, out, err) in enumerate(results, first + 1):
                progress.clear()
                with suppress(BrokenPipeError):
                    print(err, end="", file=sys.stderr, flush=True)
                show(out, self.out is not None, end="")
                self.records += one.records
                self.fits += one.fits
                self.kept += one.kept
                yield code
                progress("fit", done, len(tasks))

    def _fit(self, files: list[Input], folder: Path | None, position: str = "") -> int:
        """Fit one group of files, print and write the result, and return its exit code.

        `position` in the batch is a part of the progress line.
        """
        from pellicle.reporting.fit_text import report
        from pellicle.reporting.folders import write_fit
        from pellicle.reporting.json_record import failure, to_json
        from pellicle.reporting.specification import parse_limits, verdicts

        paths, identity = [file.path for file in files], ""
        try:
            said = None if self.brief and (self.later or self.records) else say
            data, scene = measurement(files, self.inputs.joint, said)
            if folder is not None:
                settings = self.inputs.tolerance, self.inputs.loss, self.inputs.residual, self.sampler
                identity = fingerprint(data, scene, settings)
                if not self.refit and (kept := earlier(folder, identity)):
                    self.kept += 1
                    say(f"{folder}: from an earlier run")
                    return self._printed(*kept)
            with Progress(", ".join(paths) + (f" ({position})" if position else "")) as progress:
                fit, posterior = self._result(data, scene, folder, progress)
            record = to_json(fit, posterior)
            if self.spec:
                verdicts(record, parse_limits(self.spec))  # which refuses an unknown name
        except ValueError as error:
            message = error_message(error, paths)
            self.records.append(failure(paths if self.inputs.joint else paths[0], message))
            # also where the error is one of usage: the other files go on
            return reported(message, self.records[-1] if self.json else None)
        if self.inputs.repeats:
            self.fits.append(fit)
        code = self._printed(record, report(fit, posterior))
        if posterior is not None and not posterior.trusted:
            code = max(code, TOO_SHORT)
        if self.figure is not None:
            code = max(code, written(partial(_write_figure, self.figure, fit), f"{self.figure}: written"))
        if folder is None:
            return code
        recipe, spec = partial(self.inputs.recipe, files), record.get("spec")
        described = dict(self.inputs.described or {})
        if self.sampler is not None:
            described["sampler"] = {name: x for name, x in vars(self.sampler).items() if x is not None}
        write = partial(write_fit, folder, fit, posterior, identity, described, recipe, spec)
        failed = "; the result is printed, and the same command writes its files"
        return max(code, written(write, f"{folder}: report, figures and tables written", failed))

    def _printed(self, record: dict[str, Any], text: str) -> int:
        """Judge a result by the limits of --spec, keep and print it, and return its exit code.

        `text` is its report, of which a batch prints one line unless --verbose is given.
        """
        from pellicle.reporting import specification

        record.pop("spec", None)  # of an earlier run
        if self.spec:
            limits = specification.parse_limits(self.spec)
            record["spec"] = specification.verdicts(record, limits)
            found = specification.lines(record, limits, record["spec"])
            text = "\n".join([text.rstrip("\n"), "[[Specification]]", *(f"    {line}" for line in found), ""])
        self.records.append(record)
        if self.brief:
            text = specification.one_line(record)
        show(record if self.json else text, self.out is not None)
        if specification.FAIL in record.get("spec", {}).values():
            return OFF_SPEC
        return GOOD if record["status"] == "converged" else UNCLEAR

    def _result(
        self, data: Any, scene: Any, folder: Path | None, progress: Progress
    ) -> tuple[Fit, Posterior | None]:
        from pellicle.api.fits import fit, sample
        from pellicle.reporting.folders import chain_file

        options: dict[str, Any] = {"tolerance": self.inputs.tolerance, "residual": self.inputs.residual}
        if self.sampler is None:
            return with_flags(fit(data, scene, loss=self.inputs.loss, progress=progress, **options)), None
        options |= {name: x for name, x in vars(self.sampler).items() if x is not None}
        chain = None if folder is None else chain_file(folder)
        posterior = sample(data, scene, chain=chain, progress=progress, **options)
        posterior = replace(posterior, fit=with_flags(posterior.fit))
        return posterior.fit, posterior


def _write_figure(path: str, fit: Fit) -> None:
    from pellicle.reporting.figures import draw_fit
    from pellicle.reporting.matplotlib_figure import save_figure

    save_figure(draw_fit(fit, JOURNAL_MM), path, dpi=300)


def _captured(task: tuple[Batch, Path | None]) -> tuple[int, Batch, str, str]:
    """Fit the one group of a batch, and write its folder, in a worker process.

    Returns the exit code, the batch with its results, and its text on both streams.
    """
    batch, folder = task
    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err), log_to_stderr() if batch.verbose else nullcontext():
        code = batch._fit(batch.inputs.files, folder)
    return code, replace(batch, inputs=Inputs([], False)), out.getvalue(), err.getvalue()


def written(write: Callable[[], object], done: str = "", failed: str | None = "") -> int:
    """Write files and print `done`; where they cannot be written, print the error, unless `failed` is None.

    Returns GOOD or BAD_DATA: the result is printed, and other files go on.
    """
    try:
        write()
    except ValueError as error:
        if failed is not None:
            say(f"pellicle: {error}{failed}")
        return BAD_DATA
    say(*filter(None, [done]))
    return GOOD


def fingerprint(*parts: Any) -> str:
    """Hash of pellicle's version and of `parts`: data, scenes and settings of a fit."""
    from pellicle.data.fingerprint import fingerprint as content_fingerprint
    from pellicle.reporting.json_record import versions

    return content_fingerprint(versions()["pellicle"], *parts)


def earlier(folder: Path, identity: str) -> tuple[dict[str, Any], str] | None:
    """JSON record and report of the finished fit with this fingerprint; None where the folder has none.

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
    return record, report
