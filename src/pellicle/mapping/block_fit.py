"""Fit of one block of pixels of a map: read from the cube, fitted, and written into the store."""

import os
import platform
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from pellicle.data.cube import Cube
from pellicle.fitting.batch.data import BatchFits
from pellicle.mapping.pixels import PixelModel
from pellicle.mapping.store import MapStore, Where

Fitter = Callable[[PixelModel, Cube, Where], BatchFits]


class Job(NamedTuple):
    """Objects that every block of a map needs: model, cube, store, and the function that fits a block."""

    model: PixelModel
    cube: Cube
    store: MapStore
    fit: Fitter


class Fitted(NamedTuple):
    """A block that is in the store: its number of pixels, seconds of its fits, and of compilation, and the
    process that fitted it."""

    pixels: int
    seconds: float
    compiling: float
    process: str


def fit_block(job: Job, place: tuple[int, ...], block: Cube | None = None) -> Fitted:
    """Fit the block at a place of the grid, and write it into the store.

    `block` is the part of the cube, read by another process; None where this one reads it.
    """
    import jax.monitoring as monitoring

    compiling: list[float] = []  # seconds of every compilation

    def listen(event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith("/jax/core/compile/"):
            compiling.append(duration_secs)

    where, began = job.store.blocks.where(place), time.monotonic()
    monitoring.register_event_duration_secs_listener(listen)
    try:
        if block is None:
            fits = job.fit(job.model, job.cube, where)
        else:
            fits = job.fit(job.model, block, tuple(slice(0, n) for n in block.shape))
    finally:
        monitoring.unregister_event_duration_listener(listen)
    job.store.write(place, fits)
    seconds = sum(compiling)
    process = f"{platform.node()}:{os.getpid()}"
    return Fitted(job.store.blocks.count(place), time.monotonic() - began - seconds, seconds, process)
