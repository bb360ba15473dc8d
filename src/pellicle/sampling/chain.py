"""A chain of an ensemble of walkers, in memory and on disk.

The file is HDF5 in emcee's own layout (`emcee.backends.HDFBackend` opens it), plus the identity of the run
that produced it. It is written whole and renamed, so that a killed run leaves its last checkpoint; with the
state of the random numbers in it, a resumed chain is the one that an undisturbed run would have given.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.errors import DataError, UsageError
from pellicle.files import replacing

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
            draft.write_bytes(image.getbuffer())
