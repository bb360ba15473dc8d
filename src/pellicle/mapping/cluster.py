"""Blocks of a map as tasks of a dask cluster: processes of this machine, or a scheduler's workers anywhere.

Every worker gets the model and the cube once, by a plugin that the scheduler also sends to workers that come
later. A worker reads its blocks from the cube's files and writes them into the store, which it reaches by
its path. Blocks of a large cube in memory are sent to it one by one. Blocks of a worker that dies go to
others.
"""

import logging
import pickle
import signal
import time
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib.metadata import version
from io import BytesIO
from typing import Any

import jax
import numpy as np
from dask import config
from distributed import Client, LocalCluster, WorkerPlugin, as_completed, get_worker
from distributed.comm.core import CommClosedError
from distributed.scheduler import KilledWorker

from pellicle.data.cube import Cube
from pellicle.errors import DataError, UsageError
from pellicle.mapping.block_fit import Fitted, Job, fit_block
from pellicle.programs.workers import single_threaded

log = logging.getLogger(__name__)

_SETTINGS = (
    "jax_enable_x64",
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)
"""JAX's settings that workers take over: a program that one of them compiles is found by all."""
ANSWER = 10.0
"""Seconds to wait for the answer of a scheduler."""
WAIT = 60.0
"""Seconds to wait for a scheduler's first worker, or for another one where all have ended."""
LARGEST = 2**24
"""Bytes of an array in memory that is sent whole to every worker."""
_WINDOW = 2
"""Blocks of a large cube in memory that each worker has or waits for."""


@contextmanager
def local_cluster(workers: int) -> Iterator[Client]:
    """Start worker processes on this machine, spawned, with one thread each; they end with the block."""
    # a forked process inherits JAX's locks
    settings = {"distributed.worker.multiprocessing-method": "spawn"}
    logger = logging.getLogger("distributed")
    level = logger.level
    with config.set(settings), single_threaded():
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=0,  # the size of the blocks bounds it; a limit would count the page cache of files
            dashboard_address=":0",
            silence_logs=logging.CRITICAL,
        )
        try:
            with Client(cluster, set_as_default=False) as client:
                yield client
        finally:
            with suppress(TimeoutError):
                cluster.close(timeout=5)
            logger.setLevel(level)


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """Connect to a running scheduler and wait for its first worker.

    **Raises:** UsageError where none answers; DataError where it has no workers.
    """
    try:
        # one that finds no scheduler must not become dask's default client: later computations would hang
        client = Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UsageError(
            f"`scheduler`: no dask scheduler answers at {address} ({type(error).__name__}); start one, or"
            " leave it out to use this machine"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT)
        except TimeoutError:
            raise DataError(
                f"the scheduler at {address} has had no workers for {WAIT:.0f} s; start some and repeat"
            ) from None
        yield client


def on_cluster(client: Client, job: Job, todo: Sequence[tuple[int, ...]], *, local: bool) -> Iterator[Fitted]:
    """Fit blocks on the workers of a client, and yield each when it is in the store.

    **Raises:** DataError where a block is lost with every worker that fits it, or where no worker is left;
    ValueError of a fit as it is.
    """
    name = f"pellicle-{uuid.uuid4().hex}"
    shipped = not _can_be_read_there(job.cube)
    sent = replace(job.cube, arrays={}, mask=None, coords={}) if shipped else job.cube
    plugin = _Model(name, pickle.dumps(job._replace(cube=sent)), local)
    waiting = iter(todo)
    queue: Any = as_completed(loop=client.loop)
    most = _WINDOW * max(1, len(client.scheduler_info(n_workers=-1)["workers"])) if shipped else len(todo)

    def submit() -> None:
        for place in waiting:
            block = None
            if shipped:
                where = job.store.blocks.where(place)
                read = {k: np.asarray(a if np.ndim(a) == 1 else a[where]) for k, a in job.cube.arrays.items()}
                mask = None if job.cube.mask is None else job.cube.mask[where]
                block = replace(sent, arrays=read, mask=mask, units={}, notes=())
            queue.add(client.submit(_task, name, place, block, key=f"{name}-{place}", pure=False))
            if queue.count() >= most:
                return

    try:
        client.register_plugin(plugin, name=name)
        submit()
        for future in _completed(queue, client):
            yield future.result()
            submit()
    except (CancelledError, CommClosedError):
        raise DataError(
            "the dask scheduler was lost; what is finished is kept, and the same map goes on from there"
        ) from None
    except KilledWorker:
        raise DataError(
            "worker processes ended again and again while they fitted the same pixels, often for lack of"
            " memory; what is finished is kept: repeat with fewer `workers`"
        ) from None
    finally:
        with suppress(Exception):  # of a cluster that is gone
            client.cancel(list(queue.futures))
            client.unregister_worker_plugin(name)


def _completed(queue: Any, client: Client) -> Iterator[Any]:
    """Yield the futures of a queue when they are done.

    **Raises:** DataError where there have been no workers for `WAIT` seconds. Their nannies start others, but
    give up where that takes too long, and dask waits for ever.
    """
    seen = asked = time.monotonic()
    while not queue.is_empty():
        if queue.has_ready():
            yield next(queue)
            continue
        time.sleep(0.02)
        now = time.monotonic()
        if now - asked < min(1.0, WAIT):
            continue
        asked = now
        if client.scheduler_info(n_workers=-1)["workers"]:
            seen = now
        elif now - seen > WAIT:
            raise DataError(
                f"all worker processes have ended, and none has come for {WAIT:.0f} s; what is finished is"
                " kept: repeat with fewer `workers`, or with one"
            )


def _can_be_read_there(cube: Cube) -> bool:
    """False for a cube whose values are in memory, and large, or which cannot be pickled."""
    try:
        _Pickler(BytesIO()).dump(cube)
    except Exception as error:  # pickle raises many kinds
        log.info("blocks are sent to the workers, which cannot read the cube themselves: %s", error)
        return False
    return True


class _Pickler(pickle.Pickler):
    """A pickler that refuses large arrays before it copies them."""

    def reducer_override(self, obj: Any) -> Any:
        """Raise for a large array, leave anything else to pickle."""
        if isinstance(obj, np.ndarray) and obj.nbytes > LARGEST:
            raise ValueError(f"an array of {obj.nbytes} bytes is in memory")
        return NotImplemented


class _Model(WorkerPlugin):
    """Model and settings of all blocks, as a plugin of each worker; the worker's first task unpickles it."""

    def __init__(self, name: str, content: bytes, local: bool):
        self.name, self.content, self.local = name, content, local
        self.version = version("pellicle")
        self.settings = {name: jax.config.values[name] for name in _SETTINGS}
        self.job: Any = None

    def setup(self, worker: Any) -> None:
        if self.version != version("pellicle"):
            raise DataError(
                f"worker {worker.address} has pellicle {version('pellicle')}, and this process has"
                f" {self.version}; install the same version on both"
            )
        if self.local:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started this one

    def loaded(self) -> Job:
        if self.job is None:
            for name, value in self.settings.items():
                jax.config.update(name, value)
            with jax.enable_x64(True):  # float64 arrays stay so
                self.job = pickle.loads(self.content)
        return self.job


def _task(name: str, place: tuple[int, ...], block: Cube | None) -> Fitted:
    plugin: Any = get_worker().plugins[name]
    # arrays of dask are read here: the scheduler of this cluster would give their parts to busy workers
    with config.set(scheduler="synchronous"):
        return fit_block(plugin.loaded(), place, block)
