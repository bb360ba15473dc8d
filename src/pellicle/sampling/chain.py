"""A chain of an ensemble of walkers, in memory and on disk, and the checks of its convergence.

The file is HDF5 in emcee's own layout (`emcee.backends.HDFBackend` opens it), plus the identity of the run
that produced it. It is written whole and renamed, so that a killed run leaves its last checkpoint; with the
state of the random numbers in it, a resumed chain is the one that an undisturbed run would have given.
"""

from __future__ import annotations

import os
import time
import warnings
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pellicle.errors import DataError, UsageError
from pellicle.files import replacing
from pellicle.fitting.noise import integrated_time
from pellicle.sampling.density import Modes

GROUP = "mcmc"
_PATIENCE = 2.0
"""Seconds between two checkpoints."""


@dataclass(frozen=True)
class Chain:
    """Every step of every walker, in the unit cube between the bounds.

    `draws` (steps, walkers, parameters), `log_density` (steps, walkers), `accepted` moves of each walker,
    and the `random` state (of NumPy's `RandomState`) after the last step.
    """

    draws: np.ndarray
    log_density: np.ndarray
    accepted: np.ndarray
    random: tuple[Any, ...]

    @property
    def steps(self) -> int:
        return len(self.draws)

    def extended(self, more: Chain) -> Chain:
        """This chain with `more` after it."""
        return replace(
            more,
            draws=np.concatenate([self.draws, more.draws]),
            log_density=np.concatenate([self.log_density, more.log_density]),
            accepted=self.accepted + more.accepted,
        )


def empty(walkers: int, parameters: int, seed: int) -> Chain:
    """A chain without steps, whose random numbers start from `seed`."""
    random = np.random.RandomState(seed).get_state(legacy=True)
    return Chain(np.zeros((0, walkers, parameters)), np.zeros((0, walkers)), np.zeros(walkers), tuple(random))


class ChainFile:
    """The file of a chain of one problem, which a run resumes and writes now and then; none if `path` is."""

    def __init__(self, path: str | os.PathLike[str] | None, fingerprint: str, names: tuple[str, ...]):
        self.path = None if path is None else Path(path)
        self.fingerprint, self.names = fingerprint, names
        self.written = time.monotonic()

    def begin(self, walkers: int, seed: int) -> Chain:
        """The chain of the file, or a new one.

        Raises DataError where the file is no chain of this problem, UsageError where its walkers are not as
        many.
        """
        if self.path is None or not self.path.exists():
            return empty(walkers, len(self.names), seed)
        import h5py

        try:
            with h5py.File(self.path, "r") as file:
                group: Any = file[GROUP]
                fingerprint = group.attrs.get("fingerprint", "")
                random = tuple(group.attrs[f"random_state_{i}"] for i in range(5))
                chain = Chain(group["chain"][...], group["log_prob"][...], group["accepted"][...], random)
        except (OSError, KeyError):
            raise DataError(
                f"{self.path}: is no chain that pellicle wrote; move it away or name another folder"
            ) from None
        if fingerprint != self.fingerprint:
            raise DataError(
                f"{self.path}: is the chain of another problem (other data, bounds or priors); move it away"
                " or name another folder"
            )
        if chain.draws.shape[1] != walkers:
            raise UsageError(
                f"{self.path}: is a chain of {chain.draws.shape[1]} walkers: go on with as many,"
                " or name another folder"
            )
        return chain

    def keep(self, chain: Chain) -> None:
        """Write the chain if the last checkpoint is some time ago; a full disk does not end the chain."""
        if time.monotonic() - self.written > _PATIENCE:
            with suppress(DataError):
                self.write(chain)
            self.written = time.monotonic()

    def write(self, chain: Chain) -> None:
        """Write the chain, over an earlier one of the same problem. Raises as `files.replacing` does."""
        if self.path is None:
            return
        import h5py

        image = BytesIO()  # the HDF5 library crashes where a disk is full
        with h5py.File(image, "w") as file:
            group: Any = file.create_group(GROUP)
            steps, walkers, size = chain.draws.shape
            facts = {"version": version("emcee"), "nwalkers": walkers, "ndim": size, "has_blobs": False}
            random = {f"random_state_{i}": value for i, value in enumerate(chain.random)}
            ours = {"fingerprint": self.fingerprint, "names": list(self.names)}
            for key, value in (facts | {"iteration": steps} | random | ours).items():
                group.attrs[key] = value
            group.create_dataset("chain", data=chain.draws, maxshape=(None, walkers, size))
            group.create_dataset("log_prob", data=chain.log_density, maxshape=(None, walkers))
            group.create_dataset("accepted", data=chain.accepted)
        with replacing(self.path, overwrite=True) as draft:
            draft.write_bytes(image.getvalue())


LONG_ENOUGH = 50.0
"""Steps after burn-in, in autocorrelation times (D. Foreman-Mackey et al., 2013, PASP 125, 306)."""
MIXED_ENOUGH = 1.05
"""Largest split R̂ (A. Gelman et al., 2013, Bayesian data analysis, section 11.4)."""
MOVING = 0.01
"""Smallest share of proposals that is accepted."""
_BURNED = 5
"""Autocorrelation times that are thrown away."""


@dataclass(frozen=True)
class Checks:
    """Convergence checks of one chain.

    `discard` first steps are burn-in. `autocorrelation_time` is the longest of all parameters' and of the
    shares of the minima; `rhat` the largest split R̂, each walker a chain. `minima_found` counts the minima
    of the fit that hold a share worth missing, `minima_visited` those of them where walkers are.
    """

    steps: int
    discard: int
    autocorrelation_time: float
    rhat: float
    acceptance: float
    minima_found: int
    minima_visited: int
    independent: int

    @property
    def n_over_tau(self) -> float:
        return (self.steps - self.discard) / self.autocorrelation_time

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons not to take intervals from the chain; empty if it can be trusted."""
        reasons = []
        if not self.n_over_tau >= LONG_ENOUGH:
            reasons.append(
                f"the chain is {self.n_over_tau:.0f} autocorrelation times long,"
                f" and {LONG_ENOUGH:.0f} are needed"
            )
        if not self.rhat <= MIXED_ENOUGH:
            reasons.append(f"walkers differ (split R̂ {self.rhat:.3f}, at most {MIXED_ENOUGH} is trusted)")
        if self.minima_visited < self.minima_found:
            reasons.append(
                f"{self.minima_visited} of the {self.minima_found} minima that matter were visited"
            )
        if not self.acceptance >= MOVING:
            reasons.append(f"only {100 * self.acceptance:.2g} % of the moves were accepted")
        return tuple(reasons)

    @property
    def trusted(self) -> bool:
        return not self.doubts


def check(chain: Chain, modes: Modes) -> Checks:
    """Every check of a chain of at least a few steps."""
    tau = autocorrelation_time(chain.draws, modes)
    discard = int(min(np.ceil(_BURNED * tau), chain.steps // 2))
    kept = chain.draws[discard:]
    home = modes.nearest(kept.reshape(-1, kept.shape[-1]))
    minima = np.flatnonzero(modes.matter)
    return Checks(
        steps=chain.steps,
        discard=discard,
        autocorrelation_time=tau,
        rhat=split_rhat(kept),
        acceptance=float(chain.accepted.mean() / chain.steps),
        minima_found=len(minima),
        minima_visited=int(np.isin(minima, home).sum()),
        independent=int(kept.shape[0] * kept.shape[1] / tau),
    )


def autocorrelation_time(draws: np.ndarray, modes: Modes) -> float:
    """The longest integrated autocorrelation time (steps), of parameters and of the minima's shares;
    infinite where nothing moves.

    Distances are from the ensemble's mean. `emcee.autocorr` takes those from each walker's own, which are
    0/0 for a walker that stays in one minimum, and too short a time for one that nearly stays.
    """
    columns = list(np.moveaxis(draws, 2, 0))
    if not all(np.ptp(column) > 0 for column in columns):
        return float("inf")
    several = np.flatnonzero(modes.matter)
    if len(several) > 1:
        home = modes.nearest(draws.reshape(-1, draws.shape[-1])).reshape(draws.shape[:2])
        there = [(home == mode).astype(float) for mode in several[:-1]]
        columns += [share for share in there if np.ptp(share) > 0]
    return max(integrated_time(column - column.mean()) for column in columns)


def split_rhat(draws: np.ndarray) -> float:
    """The largest split R̂ of (steps, walkers, parameters), by ArviZ."""
    if len(draws) < 4:  # two in each half
        return float("nan")
    rhat = arviz().rhat
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(max(rhat(draws[:, :, i].T, method="split") for i in range(draws.shape[2])))


def arviz() -> ModuleType:
    """ArviZ, whose import warns once a day of its next version."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz

        return arviz


PACKAGES = ("emcee", "arviz", "corner", "h5py")


def missing() -> list[str]:
    """The packages that are not installed; none of them is imported."""
    return [name for name in PACKAGES if find_spec(name) is None]
