"""Fits of pixels without JAX, for tests of what is around them; worker processes import this module."""

import os
import pickle
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.batch.data import CODES, NO_DATA, ORDERS, BatchFits


@dataclass(frozen=True)
class OnDisk:
    """Values in a .npy file that a process reads by its path."""

    path: Path
    shape: tuple[int, ...]
    dtype = np.dtype(float)

    def __getitem__(self, where):
        return np.load(self.path, mmap_mode="r")[where]


def save(path, arguments):
    """Write arguments for another process."""
    path.write_bytes(pickle.dumps(arguments))


def load(path):
    """Read arguments that another process wrote."""
    return pickle.loads(Path(path).read_bytes())


def fit(model, cube, where):
    """Numbers that depend on the data of a pixel and on nothing else."""
    values = cube.pixels(where)["values"]
    known = np.isfinite(values).all(axis=1)
    mean = np.where(known, 1000 * values.mean(axis=1), np.nan)[:, None]
    minima = np.full((len(values), ORDERS, 1), np.nan)
    minima[:, 0], minima[:, 1] = mean, mean + 200
    delta = np.full((len(values), ORDERS), np.inf)
    delta[:, 0], delta[:, 1] = 0, 9
    status = np.where(known, CODES["converged"], CODES[NO_DATA]).astype(np.uint8)
    stderr = np.where(known[:, None], np.inf, np.nan)
    return BatchFits(mean, stderr, mean / 50, status, minima, delta, values[:, 0], values[:, 1])


def slow(model, cube, where):
    """A fit that takes 20 ms a block."""
    time.sleep(0.02)
    return fit(model, cube, where)


def dying(model, cube, where):
    """Kills its process in the brightest block, where the file that the cube's path names is absent."""
    mark = Path(cube.path)
    if np.nanmax(cube.pixels(where)["values"]) > 0.7 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return fit(model, cube, where)


def deadly(model, cube, where):
    """Kills its process."""
    os.kill(os.getpid(), signal.SIGKILL)


def refusing(model, cube, where):
    """A fit that raises."""
    raise UsageError("no such pixel")
