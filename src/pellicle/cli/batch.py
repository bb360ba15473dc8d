"""Fits of one file after the other, or of several together, and what is left of each."""

from __future__ import annotations

import json as json_module
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pellicle.cli.flags import ReadWords
from pellicle.cli.messages import as_flags, with_flags
from pellicle.cli.options import read
from pellicle.cli.session import Progress, say
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit
    from pellicle.sampling.result import Posterior
    from pellicle.scene.film import Scene

TOO_SHORT = 5
"""The exit code of a chain that carries no interval."""


class Look(NamedTuple):
    """A file, the scene that is to explain it, and how it is read.

    `rescaled` says that the scale or the offset is of this file alone.
    """

    path: str
    scene: Scene
    reading: ReadWords
    rescaled: bool = False


class Sampler(NamedTuple):
    """How posteriors are sampled; None leaves a number to the library."""

    walkers: int | None = None
    steps: int | None = None
    seed: int = 0

    def settings(self, folder: Path | None) -> dict[str, Any]:
        """What the library takes, for a chain that is kept in `folder`."""
        from pellicle.reporting.folders import chain_file
        from pellicle.sampling.ensemble import STEPS

        chain = None if folder is None else chain_file(folder)
        return {"walkers": self.walkers, "steps": self.steps or STEPS, "seed": self.seed, "chain": chain}


class Batch:
    """Fits group after group of files; one that fails does not stop the others.

    A joint batch has one group, whose files are fitted together; else every group is one file. With a
    `sampler` every fit is followed by its posterior.
    """

    def __init__(
        self, out: str | None, as_json: bool, joint: bool, tolerance: float, sampler: Sampler | None = None
    ):
        self.out, self.as_json, self.joint, self.tolerance = out, as_json, joint, tolerance
        self.sampler = sampler
        self.done: list[Any] = []

    def __call__(self, groups: list[list[Look]]) -> int:
        from pellicle.files import new_folder
        from pellicle.reporting.folders import folder_per_file, write_summary

        if self.sampler is not None and any(
            looks[0].reading.loss not in (None, "least-squares") for looks in groups
        ):
            raise UsageError("a posterior needs least squares: leave the loss out, or the posterior")
        folders = [None] * len(groups)
        if self.out is not None:
            root = Path(self.out)
            folders = folder_per_file(root, [looks[0].path for looks in groups])
            if root.exists():
                new_folder(root)  # refuses a stranger's folder before the work, not after
        worst = 0
        try:
            for looks, folder in zip(groups, folders, strict=True):
                worst = max(worst, self._one(looks, folder))
        except KeyboardInterrupt:
            say(f"interrupted after {len(self.done)} of {len(groups)} files; what is done is kept")
            worst = 130
        if self.out is not None and len(groups) > 1 and self.done:
            write_summary(Path(self.out) / "summary.csv", self.done)
        return worst

    def _one(self, looks: list[Look], folder: Path | None) -> int:
        from pellicle.reporting.json_record import failure, to_json

        paths = [look.path for look in looks]
        label = ", ".join(paths)
        progress = Progress(label)
        try:
            found, posterior = self._found(looks, folder, progress)
        except ValueError as error:
            progress.clear()
            message = as_flags(str(error))
            message = message if any(path in message for path in paths) else f"{label}: {message}"
            say(f"pellicle: {message}")
            self.done.append(failure(paths if self.joint else paths[0], message))
            if self.as_json:
                print(json_module.dumps(self.done[-1], allow_nan=False), flush=True)
            return 3  # a failed file is 3, whatever would mend it
        progress.clear()
        found = with_flags(found)
        posterior = None if posterior is None else replace(posterior, fit=found)
        self.done.append(to_json(found))
        self._show(found, posterior, folder)
        if posterior is not None and not posterior.trusted:
            return TOO_SHORT
        return 0 if found.status == "converged" else 4

    def _show(self, found: Fit, posterior: Posterior | None, folder: Path | None) -> None:
        from pellicle.reporting.fit_text import report
        from pellicle.reporting.folders import write_fit
        from pellicle.reporting.json_record import one_line, to_json

        written = one_line(to_json(found, posterior)) if self.as_json else None
        print(written or report(found, posterior), flush=True)
        if folder is None:
            return
        write_fit(folder, found, posterior)
        say(f"{folder}: report, figures and tables written")

    def _found(
        self, looks: list[Look], folder: Path | None, progress: Progress
    ) -> tuple[Fit, Posterior | None]:
        what = measurements(looks, self.joint)
        if self.sampler is not None:
            posterior = self._sampled(what, self.sampler, folder, progress)
            return posterior.fit, posterior
        from pellicle.fitting.robust_losses import LEAST_SQUARES
        from pellicle.fitting.spectra.fit import fit

        loss = looks[0].reading.loss or LEAST_SQUARES
        return fit(*what, tolerance=self.tolerance, loss=loss, progress=progress), None

    def _sampled(
        self, what: tuple[Any, Any], sampler: Sampler, folder: Path | None, progress: Progress
    ) -> Posterior:
        from pellicle.sampling.sample import sample

        return sample(*what, **sampler.settings(folder), tolerance=self.tolerance, progress=progress)


def measurements(looks: list[Look], joint: bool, talk: bool = True) -> tuple[Any, Any]:
    """What is fitted, and its scenes: lists where the fit is joint. Says how the files were understood."""
    spectra, scenes = [], []
    for look in looks:
        spectrum, scene = _seen(look, own=look.rescaled or len(looks) == 1)
        spectra.append(spectrum)
        scenes.append(scene)
        say(*(f"{look.path}: {note}" for note in spectrum.notes if talk))
    return (spectra, scenes) if joint else (spectra[0], scenes[0])


def _seen(look: Look, own: bool) -> tuple[Any, Scene]:
    """The spectrum, and its scene: Ψ and Δ leave out a scale and an offset that are not their own."""
    from pellicle.fitting.spectra.targets import unscaled
    from pellicle.scene.instrument import Drift

    scaled = isinstance(look.scene.instrument.scale, Drift)
    spectrum = read(look.path, look.reading, scaled=scaled)
    return spectrum, look.scene if own or spectrum.delta is None else unscaled(look.scene)
