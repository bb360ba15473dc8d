"""Maps of cubes: reading, preview, the place of the store, and the computation."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pellicle.data.cube import Cube
from pellicle.data.read_cube import read_cube
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress, quiet
from pellicle.mapping.lamp import LampCurve, lamp_curve_of
from pellicle.mapping.map_result import Map
from pellicle.mapping.run import run_map
from pellicle.scene.film import Scene
from pellicle.scene.instrument import Drift

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
    recipe: str = "",
    progress: Progress = quiet,
    **reading: Any,
) -> Map:
    """Fit every pixel of a cube; arguments as of `pellicle.map`."""
    cube = cube_of(data, scene, **reading)
    if lamp_curve is not None:
        cube = lamp_curve_of(lamp_curve, cube, scene, lamp_reference).correct(cube)
    elif lamp_reference is not None:
        raise UsageError("`lamp_reference` is of a region: give it as `lamp_curve`, x,y,width,height")
    factor = preview_factor(cube) if preview else 1
    options: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "recipe": recipe}
    options |= {"resume": resume, "overwrite": overwrite, "preview": factor, "progress": progress}
    if factor > 1:
        cube = cube.coarse(factor)
    folder = None
    if out is None:
        if scheduler is not None:
            raise UsageError("a map by `scheduler` needs `out`, a folder that its workers reach")
        folder = tempfile.mkdtemp(prefix="pellicle-map-")
        out = Path(folder) / "map.zarr"
    made = run_map(cube, scene, out, **options)
    if neighbours:
        made = made.by_neighbours()
    return made if folder is None else made.remove_at_exit(folder)


def cube_of(data: Any, scene: Scene, **reading: Any) -> Cube:
    """Read a cube; where the scale of the scene is free, its values may have any level."""
    if isinstance(scene.instrument.scale, Drift):
        reading = {"calibrated": False} | reading
    return read_cube(data, **reading)


def preview_factor(cube: Cube) -> int:
    """The distance of the pixels of a preview, at which each image has at most `PREVIEW`."""
    sizes = [n for dim, n in zip(cube.dims, cube.shape, strict=True) if dim != "time"]
    return max(1, math.ceil((math.prod(sizes) / PREVIEW) ** (1 / max(1, len(sizes)))))
