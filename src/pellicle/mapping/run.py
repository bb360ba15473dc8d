"""Maps of cubes: blocks of pixels are fitted one by one here, or side by side in worker processes."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.cube import Cube
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress, quiet
from pellicle.mapping.blocks import Where
from pellicle.mapping.map_attributes import attributes
from pellicle.mapping.map_identity import identity
from pellicle.mapping.map_result import Map, Run
from pellicle.mapping.pixels import fit as pixel_fit
from pellicle.mapping.pixels.fit import PixelModel
from pellicle.mapping.pixels.minima import ORDERS
from pellicle.mapping.pixels.results import PixelFits
from pellicle.mapping.store import MapStore, begin
from pellicle.scene.film import Scene

log = logging.getLogger(__name__)

START = 30.0
"""Seconds of fits for which worker processes are worth their start: each imports JAX, for 5 to 10 s."""

Fitter = Callable[[PixelModel, Cube, Where], PixelFits]


class Job(NamedTuple):
    """Objects that every block of a map needs: model, cube, store, and the function that fits a block."""

    model: PixelModel
    cube: Cube
    store: MapStore
    fit: Fitter


class Fitted(NamedTuple):
    """A block that is in the store: its number of pixels, seconds of its fits, and of compilation."""

    pixels: int
    seconds: float
    compiling: float


def run_map(
    cube: Cube,
    scene: Scene,
    path: str | os.PathLike[str],
    *,
    workers: int | None = 1,
    scheduler: str | None = None,
    resume: bool = True,
    overwrite: bool = False,
    preview: int = 1,
    options: Mapping[str, Any] | None = None,
    recipe: str = "",
    progress: Progress = quiet,
    fit: Fitter | None = None,
) -> Map:
    """Fit all pixels of a cube and write them into a zarr store, block by block.

    **Arguments:**

    - `path` of the store. A store that an earlier run of the same map began is continued, with `resume`, and
      any other map is replaced, with `overwrite`.
    - `workers`: processes on this machine, of one thread each; with 1 the blocks are fitted in this process,
      and with None as soon as one block has shown that the others take longer than processes to start.
    - `scheduler`: address of a running dask scheduler, "tcp://host:8786", whose workers share the files.
    - `preview`: the cube has every so many of the pixels in each direction.
    - `options` that change the result, `recipe`: the text of it; both are kept in the store.
    - `progress`: called with "pixels", the number that is done and their total.
    - `fit`: the function that fits a block, `pixels.fit.fit_pixels` by default.

    **Raises:** as `pixels.fit.prepare` and `store.begin` do; DataError where a block is lost with every
    worker that fits it. After KeyboardInterrupt the finished blocks are in the store.
    """
    if workers is not None and workers < 1:
        raise UsageError(f"`workers` must be at least 1, got {workers}")
    began = time.monotonic()
    model = pixel_fit.prepare(cube, scene)
    about = attributes(cube, model, recipe, preview)
    who = identity(cube, scene, options or {})
    store = begin(path, cube, model.parameters, who, about, orders=ORDERS, resume=resume, overwrite=overwrite)
    todo, total = store.unfinished(), int(np.prod(cube.shape))
    earlier = done = total - sum(map(store.blocks.count, todo))
    log.info("%s: %d of %d blocks of %s pixels are left", path, len(todo), *_sizes(store))
    progress("pixels", done, total)
    job, compiling, used = Job(model, cube, store, fit or pixel_fit.fit_pixels), 0.0, 1
    if scheduler is None and workers is None and todo:
        first = fit_block(job, todo.pop(0))
        done, compiling = done + first.pixels, first.compiling
        progress("pixels", done, total)
        workers = _worthwhile(len(todo), first.seconds)
    if scheduler is not None or (workers or 1) > 1:
        used = min(workers or len(todo), len(todo))
    for fitted in _fitted(job, todo, used, scheduler, progress):
        done += fitted.pixels
        compiling = max(compiling, fitted.compiling)
        progress("pixels", done, total)
    return Map(path, Run(done - earlier, earlier, used, time.monotonic() - began, compiling))


def _worthwhile(blocks: int, seconds: float) -> int:
    """Number of processes for blocks that take so many seconds each: 1, or as many as there are cores."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cores if blocks * seconds > START else 1


def _sizes(store: MapStore) -> tuple[int, str]:
    return int(np.prod(store.blocks.grid)), " x ".join(map(str, store.blocks.size))


def _fitted(
    job: Job, todo: list[tuple[int, ...]], workers: int, scheduler: str | None, progress: Progress
) -> Iterator[Fitted]:
    if not todo:
        return
    if scheduler is None and workers == 1:
        for place in todo:
            yield fit_block(job, place)
        return
    from pellicle.mapping.cluster import connected, local_cluster, on_cluster

    progress("starting workers", 0, workers)
    with local_cluster(workers) if scheduler is None else connected(scheduler) as client:
        yield from on_cluster(client, job, todo, local=scheduler is None)


def fit_block(job: Job, place: tuple[int, ...], block: Cube | None = None) -> Fitted:
    """Fit the block at a place of the grid, and write it into the store.

    `block` is the part of the cube, read by another process; None where this one reads it.
    """
    where, began = job.store.blocks.where(place), time.monotonic()
    with _compilation() as seconds:
        if block is None:
            fits = job.fit(job.model, job.cube, where)
        else:
            fits = job.fit(job.model, block, tuple(slice(0, n) for n in block.shape))
    job.store.write(place, fits)
    compiling = sum(seconds)
    return Fitted(job.store.blocks.count(place), time.monotonic() - began - compiling, compiling)


@contextmanager
def _compilation() -> Iterator[list[float]]:
    """Collect the seconds of every compilation in the block."""
    import jax.monitoring as monitoring

    seconds: list[float] = []

    def listen(event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith("/jax/core/compile/"):
            seconds.append(duration_secs)

    monitoring.register_event_duration_secs_listener(listen)
    try:
        yield seconds
    finally:
        monitoring.unregister_event_duration_listener(listen)
