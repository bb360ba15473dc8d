"""Sample the posterior of a scene's free parameters, from every minimum that the fit has found."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

import jax
import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.fit import fitted, measurements
from pellicle.fitting.search import Progress, quiet
from pellicle.fitting.weigh import Weighed
from pellicle.io.spectrum import Spectrum
from pellicle.sampling import chain as chains
from pellicle.sampling.chain import Chain
from pellicle.sampling.density import Target, fingerprint
from pellicle.sampling.extra import missing
from pellicle.sampling.modes import modes
from pellicle.sampling.result import Posterior
from pellicle.sampling.run import run
from pellicle.scene import Scene

STEPS = 20_000
"""Steps at which a chain that does not settle is given up."""
FEWEST_WALKERS = 32
_PATIENCE = 2.0
"""Seconds between two checkpoints."""
_LIVE = 40
"""Numbers of float64 that one wavelength of one walker keeps alive at once, roughly."""


def sample(
    data: Spectrum | Sequence[Spectrum],
    scene: Scene | Sequence[Scene],
    *,
    walkers: int | None = None,
    steps: int = STEPS,
    seed: int = 0,
    chain: str | os.PathLike[str] | None = None,
    tolerance: float = 0.0,
    progress: Progress = quiet,
) -> Posterior:
    """Fit as `pellicle.fit` does, then sample the posterior between the bounds, in float64.

    Priors are those of the `Free` parameters, uniform between the bounds by default; scale and offset
    are integrated out. Walkers start in every minimum in proportion to its share and move by
    differential evolution, its snooker update, and jumps between minima. The chain ends when it is 50
    autocorrelation times long and passes the other checks, or after `steps`. With a `chain` file it is
    kept there as it grows, and a run that was cut short goes on where it stopped.

    **Raises:** as `fit` does, and UsageError for too few walkers (two for each parameter at least) or
    more than the machine's memory holds; DataError for a chain of another problem.
    """
    began = time.perf_counter()
    _installed()
    fit, weighed = fitted(data, scene, tolerance, progress)
    path = None if chain is None else Path(chain)
    whose = fingerprint(measurements(data, scene), tolerance)
    with jax.enable_x64(True):
        count = _walkers(walkers, steps, weighed)
        begun = _begun(path, whose, count, len(weighed.problem.parameters), seed)
        target = Target(weighed.problem, (count + 1) // 2)
        found = modes(weighed)
        names = tuple(p.name for p in weighed.problem.parameters)
        keep = _Keeper(path, whose, names)
        grown, checks = run(target, found, begun, steps, keep, progress)
        keep.last(grown)
    units = grown.draws[checks.discard :]
    return Posterior(
        fit=fit,
        names=names,
        draws=np.asarray(weighed.problem.box.values(units)),
        units=units,
        log_density=grown.log_density[checks.discard :],
        modes=found,
        checks=checks,
        problem=weighed.problem,
        seconds=time.perf_counter() - began,
    )


class _Keeper:
    """Writes the chain now and then, where it is to be kept."""

    def __init__(self, path: Path | None, whose: str, names: tuple[str, ...]):
        self.path, self.whose, self.names = path, whose, names
        self.written = time.monotonic()

    def __call__(self, chain: Chain) -> None:
        if time.monotonic() - self.written > _PATIENCE:
            self.last(chain)

    def last(self, chain: Chain) -> None:
        if self.path is not None:
            chains.save(self.path, chain, self.whose, self.names)
            self.written = time.monotonic()


def _begun(path: Path | None, whose: str, walkers: int, parameters: int, seed: int) -> Chain:
    if path is None or not path.exists():
        return chains.empty(walkers, parameters, seed)
    found = chains.load(path, whose)
    if found.draws.shape[1] != walkers:
        raise UsageError(
            f"{path}: is a chain of {found.draws.shape[1]} walkers: go on with as many,"
            " or name another folder"
        )
    return found


def _installed() -> None:
    """UsageError where the sampler's packages are missing."""
    absent = missing()
    if absent:
        raise UsageError(
            f"posteriors need {', '.join(absent)}, not installed here: pip install 'pellicle[posterior]'"
        )


def _walkers(given: int | None, steps: int, weighed: Weighed) -> int:
    """How many walkers there are: given and possible, or four for each parameter and at least 32."""
    size = len(weighed.problem.parameters)
    if given is None:
        return max(FEWEST_WALKERS, 4 * size)
    if given < max(2 * size, 4) or given % 2:
        raise UsageError(f"walkers must be an even number of at least {max(2 * size, 4)}, got {given}")
    points = max(len(view.data.values) for view in weighed.problem.views)
    needed = 8.0 * given * (_LIVE * points + 3 * steps * (size + 1))
    there = _memory()
    if needed > there:
        most = int(given * there / needed) // 2 * 2
        raise UsageError(
            f"{given} walkers of {steps} steps need about {needed / 2**30:.3g} GiB and the machine has"
            f" {there / 2**30:.3g}: take {most} at most, or fewer steps"
        )
    return given


def _memory() -> float:
    """The machine's memory in bytes; unknown, and so without limit, where the system does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")
