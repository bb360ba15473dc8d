"""Maps of cubes: preparation, and fits of all blocks of pixels, here or in several worker processes."""

import atexit
import hashlib
import json
import logging
import math
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.fingerprint import fingerprint
from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError
from pellicle.fitting.batch.data import ORDERS
from pellicle.fitting.progress import Progress, quiet
from pellicle.mapping.block_fit import Fitted, Fitter, Job, fit_block
from pellicle.mapping.continuity import record_of, row
from pellicle.mapping.lamp import LampCurve, lamp_curve_of
from pellicle.mapping.locks import held
from pellicle.mapping.map_result import Map, Run
from pellicle.mapping.pixels import PixelModel, bands_off, fit_pixels, prepare
from pellicle.mapping.store import BYTES, FORMAT, begin
from pellicle.programs.workers import workers_for
from pellicle.scene.film import Scene
from pellicle.scene.instrument import Drift

log = logging.getLogger(__name__)

PREVIEW = 4096
"""Pixels of a preview, of each image, at most."""


def map_cube(
    data: Any,
    scene: Scene,
    *,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = 1,
    scheduler: str | None = None,
    resume: bool = True,
    overwrite: bool = False,
    preview: bool = False,
    neighbours: bool = False,
    lamp_curve: str | Sequence[int] | LampCurve | None = None,
    lamp_reference: Scene | None = None,
    model: PixelModel | None = None,
    recipe: str = "",
    progress: Progress = quiet,
    fit: Fitter | None = None,
    **reading: Any,
) -> Map:
    """Fit every pixel of a cube; arguments as of `pellicle.map`, and `fit` as of `run_map`."""
    if isinstance(scene.instrument.scale, Drift):  # values may have any level
        reading = {"calibrated": False} | reading
    cube = read_cube(data, **reading)
    if lamp_curve is not None:
        cube = lamp_curve_of(lamp_curve, cube, scene, lamp_reference).correct(cube)
    elif lamp_reference is not None:
        raise UsageError("`lamp_reference` is of a region: give it as `lamp_curve`, x,y,width,height")
    factor = 1
    if preview:
        sizes = [n for dim, n in zip(cube.dims, cube.shape, strict=True) if dim != "time"]
        factor = max(1, math.ceil((math.prod(sizes) / PREVIEW) ** (1 / max(1, len(sizes)))))
        cube = cube.coarse(factor) if factor > 1 else cube
    folder = None
    if out is None:
        if scheduler is not None:
            raise UsageError("a map by `scheduler` needs `out`, a folder that its workers reach")
        folder = tempfile.mkdtemp(prefix="pellicle-map-")
        out = Path(folder) / "map.zarr"
    options: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "recipe": recipe}
    options |= {
        "resume": resume,
        "overwrite": overwrite,
        "preview": factor,
        "progress": progress,
        "model": model,
        "fit": fit,
    }
    try:
        made = run_map(cube, scene, out, **options)
        return made.by_neighbours() if neighbours else made
    finally:
        if folder is not None:  # not now: arrays of `Map.dataset` read it, and outlive the map
            atexit.register(shutil.rmtree, folder, ignore_errors=True)


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
    model: PixelModel | None = None,
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
    - `model` of the pixels, by default that of `pixels.prepare`.
    - `recipe`: the text of it, which is kept in the store.
    - `progress`: called with "pixels", the number that is done and their total.
    - `fit`: the function that fits a block, `pixels.fit_pixels` by default.

    **Raises:** as `pixels.prepare` and `store.begin` do; DataError where a block is lost with every
    worker that fits it. After KeyboardInterrupt the finished blocks are in the store.
    """
    if workers is not None and workers < 1:
        raise UsageError(f"`workers` must be at least 1, got {workers}")
    if fit is None and cube.points < 2:
        raise DataError(f"{cube.path or 'cube'}: has one band, and a fit needs a spectrum at each pixel")
    began = time.monotonic()
    model = prepare(cube, scene) if model is None else model
    orders = model.search.orders
    about, who = attributes(cube, model, recipe, preview), identity(cube, scene, orders)
    how: Any = {"orders": orders, "resume": resume, "overwrite": overwrite}
    with held(Path(path)):
        tried = time.monotonic()
        if fit is None and (overwrite or not Path(path).exists()):
            about["notes"] += bands_off(model, cube)
        tried = time.monotonic() - tried  # nearly all of it compilation
        store = begin(path, cube, model.parameters, who, about, **how)
        run = _fit_blocks(Job(model, cube, store, fit or fit_pixels), workers, scheduler, progress)
    return Map(path, run._replace(seconds=time.monotonic() - began, compiling=run.compiling + tried))


def _fit_blocks(job: Job, workers: int | None, scheduler: str | None, progress: Progress) -> Run:
    """Fit the blocks that are left."""
    blocks, todo = job.store.blocks, job.store.unfinished()
    total = math.prod(blocks.shape)
    earlier = done = total - sum(map(blocks.count, todo))
    size, grid = " x ".join(map(str, blocks.size)), math.prod(blocks.grid)
    log.info("%s: %d of %d blocks of %s pixels are left", job.store.path, len(todo), grid, size)
    progress("pixels", done, total)
    compiling = 0.0
    if scheduler is None and workers is None and todo:
        first = fit_block(job, todo.pop(0))
        done, compiling = done + first.pixels, first.compiling
        progress("pixels", done, total)
        workers = workers_for(len(todo) * first.seconds)
    used = 1 if scheduler is None and (workers or 1) == 1 else min(workers or len(todo), len(todo))
    processes = set()
    for fitted in _fitted(job, todo, used, scheduler, progress):
        done += fitted.pixels
        processes.add(fitted.process)
        compiling = max(compiling, fitted.compiling)
        progress("pixels", done, total)
    used = used if scheduler is None else len(processes)
    return Run(done - earlier, earlier, used, 0.0, compiling)


def _fitted(
    job: Job, todo: list[tuple[int, ...]], workers: int, scheduler: str | None, progress: Progress
) -> Iterator[Fitted]:
    if (scheduler is None and workers == 1) or not todo:
        yield from (fit_block(job, place) for place in todo)
        return
    from pellicle.mapping.cluster import connected, local_cluster, on_cluster  # imports dask's scheduler

    progress("starting workers", 0, workers)
    with local_cluster(workers) if scheduler is None else connected(scheduler) as client:
        yield from on_cluster(client, job, todo, local=scheduler is None)


def attributes(cube: Cube, model: PixelModel, recipe: str, preview: int) -> dict[str, Any]:
    """Attributes of a map's store: input, recipe, plan, free parameters with their units.

    `preview` is the distance of its pixels in the input.
    """
    effects = [*(effect for view in model.problem.views for effect in view.plan.rows), row(None)]
    return {
        "title": "map of thin-film parameters",
        "source": f"pellicle {version('pellicle')}",
        "path": cube.path,
        "fingerprint": cube.fingerprint,
        "signal": cube.signal,
        "bands": cube.wavelength.size,
        "range_nm": [float(cube.wavelength[0]), float(cube.wavelength[-1])],
        "preview": preview,
        "recipe": recipe or str(model.scene),
        "notes": list(cube.notes),
        "parameters": {parameter.name: parameter.unit for parameter in model.parameters},
        "plan": json.dumps(list(map(record_of, effects))),
    }


def identity(cube: Cube, scene: Scene, orders: int = ORDERS) -> dict[str, str]:
    """Hash the input and the scene of a map; `orders`, the minima of each pixel that it keeps.

    The content of a cube without a `fingerprint` is read once, in slabs along the first axis of pixels.
    """
    read = cube.signal, cube.polarisation, cube.calibrated, cube.dims, cube.wavelength, cube.angle, cube.mask
    content: Any = cube.fingerprint or []
    for name, array in [] if cube.fingerprint else sorted(cube.arrays.items()):
        digest = hashlib.sha256(f"{name} {array.dtype} {array.shape}".encode())
        rows = max(1, int(BYTES * array.shape[0] / (np.dtype(array.dtype).itemsize * math.prod(array.shape))))
        for start in range(0, array.shape[0], rows):
            digest.update(np.ascontiguousarray(array[start : start + rows]).tobytes())
        content.append(digest.hexdigest())
    return {
        "format": FORMAT,
        "version": version("pellicle"),
        "input": fingerprint(content, cube.shape, *read),
        "scene": fingerprint(scene),
        "orders": str(orders),
    }
