"""Sample a posterior of whatever was fitted, by an ensemble of walkers from every minimum that matters."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.errors import UsageError, install_command
from pellicle.fitting.progress import Progress
from pellicle.sampling import chain as chains
from pellicle.sampling.chain import Chain
from pellicle.sampling.checks import missing
from pellicle.sampling.density import LogDensity
from pellicle.sampling.modes import Modes
from pellicle.sampling.predict import Prediction
from pellicle.sampling.result import Posterior
from pellicle.sampling.run import run
from pellicle.sampling.target import Target

STEPS = 20_000
"""Maximum number of steps of a chain."""
FEWEST_WALKERS = 32
_PATIENCE = 2.0
"""Seconds between two checkpoints."""
_LIVE = 40
"""Numbers of float64 that one point of the data of one walker keeps alive at once, roughly."""


class Subject(NamedTuple):
    """What is sampled: a finished fit, and the posterior of its parameters in the unit cube of their bounds.

    `values` takes points of the cube to the parameters' own units; `fingerprint` identifies the problem;
    `points` how many data one evaluation compares; `predict` makes predictions of draws, from a seed.
    """

    fit: Any
    names: tuple[str, ...]
    log_density: LogDensity
    modes: Modes
    values: Callable[[np.ndarray], Any]
    fingerprint: str
    points: int
    predict: Callable[[np.ndarray, int], tuple[Prediction, ...]]
    assumption: str = ""


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
    path = None if chain is None else Path(chain)
    with jax.enable_x64(True):
        count = _walkers(walkers, steps, subject)
        begun = _begun(path, subject.fingerprint, count, len(subject.names), seed)
        target = Target(subject.log_density, (count + 1) // 2)
        keep = _Keeper(path, subject.fingerprint, subject.names)
        grown, checks = run(target, subject.modes, begun, steps, keep, progress)
        keep.last(grown)
    units = grown.draws[checks.discard :]
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


class _Keeper:
    """Writes the chain now and then, where it is to be kept."""

    def __init__(self, path: Path | None, fingerprint: str, names: tuple[str, ...]):
        self.path, self.fingerprint, self.names = path, fingerprint, names
        self.written = time.monotonic()

    def __call__(self, chain: Chain) -> None:
        if time.monotonic() - self.written > _PATIENCE:
            self.last(chain)

    def last(self, chain: Chain) -> None:
        if self.path is not None:
            chains.save(self.path, chain, self.fingerprint, self.names)
            self.written = time.monotonic()


def _begun(path: Path | None, fingerprint: str, walkers: int, parameters: int, seed: int) -> Chain:
    if path is None or not path.exists():
        return chains.empty(walkers, parameters, seed)
    chain = chains.load(path, fingerprint)
    if chain.draws.shape[1] != walkers:
        raise UsageError(
            f"{path}: is a chain of {chain.draws.shape[1]} walkers: go on with as many,"
            " or name another folder"
        )
    return chain


def installed() -> None:
    """UsageError where the sampler's packages are missing."""
    absent = missing()
    if absent:
        raise UsageError(
            f"posteriors need {', '.join(absent)}, not installed here: {install_command('posterior')}"
        )


def _walkers(walkers: int | None, steps: int, subject: Subject) -> int:
    """How many walkers memory are: walkers and possible, or four for each parameter and at least 32."""
    size = len(subject.names)
    if walkers is None:
        return max(FEWEST_WALKERS, 4 * size)
    if walkers < max(2 * size, 4) or walkers % 2:
        raise UsageError(f"walkers must be an even number of at least {max(2 * size, 4)}, got {walkers}")
    needed = 8.0 * walkers * (_LIVE * subject.points + 3 * steps * (size + 1))
    memory = _memory()
    if needed > memory:
        most = int(walkers * memory / needed) // 2 * 2
        raise UsageError(
            f"{walkers} walkers of {steps} steps need about {needed / 2**30:.3g} GiB and the machine has"
            f" {memory / 2**30:.3g}: take {most} at most, or fewer steps"
        )
    return walkers


def _memory() -> float:
    """The machine's memory in bytes; unknown, and so without limit, where the system does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")
