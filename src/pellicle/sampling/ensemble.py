"""Sample a posterior of whatever was fitted, by an ensemble of walkers from every minimum that matters."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from logging import getLogger
from typing import NamedTuple

import jax
import numpy as np

from pellicle.errors import DataError, UsageError, install_command
from pellicle.fitting.progress import Progress
from pellicle.fitting.result import Fit
from pellicle.sampling.chain import ChainFile
from pellicle.sampling.checks import missing
from pellicle.sampling.density import LogDensity
from pellicle.sampling.modes import Modes
from pellicle.sampling.predict import Prediction
from pellicle.sampling.result import Posterior
from pellicle.sampling.run import run
from pellicle.sampling.sandwich import Stretch, unchanged
from pellicle.sampling.target import Target

log = getLogger(__name__)

STEPS = 20_000
"""Maximum number of steps of a chain."""
FEWEST_WALKERS = 32
_LIVE = 40
"""Numbers of float64 that one point of the data of one walker keeps alive at once, roughly."""


class Subject(NamedTuple):
    """A finished fit and the posterior of its parameters, in the unit cube of their bounds.

    `values` takes points of the cube to the parameters' own units; `fingerprint` identifies the problem;
    `points` how many data one evaluation compares; `predict` makes predictions of draws, from a seed;
    `stretch` widens draws to the covariance of the fit.
    """

    fit: Fit
    names: tuple[str, ...]
    log_density: LogDensity
    modes: Modes
    values: Callable[[np.ndarray], np.ndarray]
    fingerprint: str
    points: int
    predict: Callable[[np.ndarray, int], tuple[Prediction, ...]]
    assumption: str = ""
    stretch: Stretch = unchanged

    def walkers(self, count: int | None, steps: int) -> int:
        """The number of walkers: `count` if it is possible, or four for each parameter and at least 32.

        Raises UsageError where they are too few, or need more than the machine's memory.
        """
        size = len(self.names)
        if count is None:
            return max(FEWEST_WALKERS, 4 * size)
        if count < max(2 * size, 4) or count % 2:
            raise UsageError(f"walkers must be an even number of at least {max(2 * size, 4)}, got {count}")
        try:
            memory = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
        except (AttributeError, ValueError, OSError):  # unknown to the system, and so without limit
            memory = float("inf")
        needed = 8.0 * count * (_LIVE * self.points + 3 * steps * (size + 1))
        if needed > memory:
            most = int(count * memory / needed) // 2 * 2
            raise UsageError(
                f"{count} walkers of {steps} steps need about {needed / 2**30:.3g} GiB and the machine has"
                f" {memory / 2**30:.3g}: take {most} at most, or fewer steps"
            )
        return count


def sampled(
    subject: Subject,
    walkers: int | None,
    steps: int,
    seed: int,
    chain: str | os.PathLike[str] | None,
    progress: Progress,
    began: float,
) -> Posterior:
    """The posterior, in float64, from a chain that is kept in the file `chain`. Raises as `sample` does."""
    file = ChainFile(chain, subject.fingerprint, subject.names)
    with jax.enable_x64(True):
        count = subject.walkers(walkers, steps)
        target = Target(subject.log_density, (count + 1) // 2)
        grown, checks = run(target, subject.modes, file.begin(count, seed), steps, file.keep, progress)
        try:
            file.write(grown)
        except DataError as error:  # of the disk: the chain in memory is complete
            log.warning("%s; this chain cannot be continued", error)
    units = subject.stretch(grown.draws[checks.discard :])
    return Posterior(
        fit=subject.fit,
        names=subject.names,
        draws=np.asarray(subject.values(units)),
        units=units,
        log_density=grown.log_density[checks.discard :],
        modes=subject.modes,
        checks=checks,
        predict=subject.predict,
        seconds=time.perf_counter() - began,
        assumption=subject.assumption,
    )


def installed() -> None:
    """UsageError where the sampler's packages are missing."""
    absent = missing()
    if absent:
        raise UsageError(
            f"posteriors need {', '.join(absent)}, not installed here: {install_command('posterior')}"
        )
