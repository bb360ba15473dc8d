"""A chain of an ensemble of walkers, in memory and on disk.

The file is HDF5 in emcee's own layout (`emcee.backends.HDFBackend` opens it), with whose chain it is beside
it. It is written whole and renamed, so that a killed run leaves its last checkpoint; with the state of the
random numbers in it, a resumed chain is the one that an undisturbed run would have given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.errors import DataError
from pellicle.files import replacing

GROUP = "mcmc"


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


def save(path: Path, chain: Chain, fingerprint: str, names: tuple[str, ...]) -> None:
    """Write a chain, over an earlier one of the same problem. Raises UsageError where it cannot be."""
    import h5py

    with replacing(path, overwrite=True) as draft, h5py.File(draft, "w") as file:
        group: Any = file.create_group(GROUP)
        steps, walkers, size = chain.draws.shape
        facts = {"version": version("emcee"), "nwalkers": walkers, "ndim": size, "has_blobs": False}
        random = {f"random_state_{i}": value for i, value in enumerate(chain.random)}
        ours = {"fingerprint": fingerprint, "names": list(names)}
        for key, value in (facts | {"iteration": steps} | random | ours).items():
            group.attrs[key] = value
        group.create_dataset("chain", data=chain.draws, maxshape=(None, walkers, size))
        group.create_dataset("log_prob", data=chain.log_density, maxshape=(None, walkers))
        group.create_dataset("accepted", data=chain.accepted)


def load(path: Path, fingerprint: str) -> Chain:
    """The chain of a problem. Raises DataError where the file is of another one, or no chain at all."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            group: Any = file[GROUP]
            whose = group.attrs.get("fingerprint", "")
            random = tuple(group.attrs[f"random_state_{i}"] for i in range(5))
            chain = Chain(group["chain"][...], group["log_prob"][...], group["accepted"][...], random)
    except (OSError, KeyError):
        raise DataError(
            f"{path}: is no chain that pellicle wrote; move it away or name another folder"
        ) from None
    if whose != fingerprint:
        raise DataError(
            f"{path}: is the chain of another problem (other data, bounds or priors); move it away or name"
            " another folder"
        )
    return chain
