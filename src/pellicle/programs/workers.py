"""Worker processes: when they pay, how many, and one thread for each by the environment that it inherits."""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager

THREADS = ("NPROC", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Numbers of threads. XLA takes its own from NPROC, which, unlike XLA_FLAGS, does not enter the key of a
compiled program: workers share their programs with all other runs."""
WORTH_WORKERS = 30.0
"""Seconds of work from which worker processes save time: each takes 3 to 10 s to start."""
_OF_DASK = ("MALLOC_TRIM_THRESHOLD_", "PYTHONHASHSEED", "__DASK_PARENT_PID")
"""Variables that dask sets for its workers in this process, and leaves there."""


@contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started in the block use one thread each; the environment is then as before."""
    before = {name: os.environ.get(name) for name in (*THREADS, *_OF_DASK)}
    os.environ |= dict.fromkeys(THREADS, "1")
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def workers_for(seconds: float) -> int:
    """Number of processes that do `seconds` of work the fastest: 1, or up to one for each core of this
    process."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, math.ceil(3 * seconds / WORTH_WORKERS)) if seconds > WORTH_WORKERS else 1
