"""Verb of maps: a fit at every pixel of a cube or a photograph."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from pellicle.data.read_cube import is_photograph, read_cube
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress, quiet
from pellicle.mapping.photograph import ThicknessMap, map_photograph
from pellicle.mapping.run import map_cube
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface, check_scene

if TYPE_CHECKING:
    from pellicle.mapping.lamp import LampCurve
    from pellicle.mapping.map_result import Map


@overload
def map(  # pyright: ignore[reportOverlappingOverload]  # a path is of either kind
    data: str | os.PathLike[str],
    scene: Scene,
    *,
    strip: str | Sequence[int] | None = None,
    region: str | Sequence[int] | None = None,
    space: str | None = None,
    observer: str = "1931",
    illuminant: str = "D65",
    lamp: str | os.PathLike[str] | None = None,
    sensitivities: str | os.PathLike[str] | None = None,
    gamma: float = 1.0,
    white: str | Sequence[int] | None = None,
    layer: str | None = None,
    noise: float | None = None,
) -> ThicknessMap: ...
@overload
def map(
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
) -> Map: ...
def map(data: Any, scene: Scene, **options: Any) -> Any:
    """Fit `scene` at every pixel of a cube of spectra, or find the thickness at every pixel of a photograph.

    Every pixel of a cube is fitted as `pellicle.fit` fits a spectrum, with the same statuses. Each position
    of a photograph is inverted by itself (`pellicle.colour.ColourInverse`), between the bounds of the free
    thickness; other free parameters take their start values, and a free scale of the instrument is a free
    exposure of each position.

    **Arguments:**

    - `data`: a cube: an xarray DataArray or Dataset, a `Cube`, or the path of one (zarr, NetCDF, ENVI, TIFF
      stack, `.npy`, folder of spectra); or the path of a photograph in colours (PNG, TIFF or JPEG).
    - `scene`: a film; of a photograph with a free thickness.

    Of a cube:

    - `out`: path of the zarr store of the map, a temporary one by default. A store of the same input and
      scene that an earlier run left unfinished is continued; not with `resume=False`. `overwrite` replaces
      any other map there.
    - `workers`: processes on this machine, of one thread each. A script that asks for several needs
      `if __name__ == "__main__":`. None: as many as there are cores, if that saves time.
    - `scheduler`: address of a dask scheduler, "tcp://host:8786", whose workers reach the files by the same
      paths.
    - `preview`: fit only so many pixels, evenly spread, that it takes seconds; `out` must be another one.
    - `neighbours`: decide ambiguous pixels by the order of interference of their neighbours. The result is
      stored beside `out`, with "-neighbours" in its name.
    - `lamp_curve`: a gain against wavelength that all pixels have in common, by which the cube is divided:
      "joint", fitted together with the films of some pixels; "x,y,width,height", from a region whose scene is
      `lamp_reference`, by default the bare substrate; or a `LampCurve`.
    - `recipe`: text of the scene's recipe, kept in the map.
    - `progress`: called with the name of a stage, the number of pixels done and their total.
    - `reading`: arguments of `pellicle.read_cube`, such as `wavelengths`, `signal_unit`, `noise`, `mask`.

    Of a photograph:

    - `strip`: "x0,y0,x1,y1", the ends of a line, 5 pixels wide; or `region`: "x,y,width,height", by default
      the whole photograph. Pixels count from the upper left corner.
    - `space`: "srgb" (the default), or "rgb" with its `gamma`.
    - `observer`, `illuminant`, `lamp`, `sensitivities`, `white`: as in `pellicle.read_colours_by_film`.
    - `layer`: name of the layer whose thickness is sought, the free one by default.
    - `noise`: standard deviation of a coded channel, by default 1.5/255 of sRGB and 0.01 of "rgb".

    **Returns:** of a cube a `Map`: `dataset` has values, standard errors, status and rivals of each pixel. Of
    a photograph a `ThicknessMap`: `found` has thickness, standard error (of the noise alone), probability and
    status of each position, the most probable thickness first.

    **Raises:** DataError for data that cannot be read; UsageError for arguments of the other kind of data,
    for a store that is of another map, for pixels outside a photograph, and where nothing is free.
    """
    check_scene(scene)
    if isinstance(scene, Surface):
        raise UsageError("`scene` of a map must be a Scene, a film, not a Surface")
    photograph = isinstance(data, str | os.PathLike) and is_photograph(Path(data))
    _refuse_others(options, ("photograph", "cube") if photograph else ("cube", "photograph"))
    if photograph:
        return map_photograph(data, scene, **options)
    return map_cube(data, scene, **options)


def _refuse_others(options: Iterable[str], kinds: tuple[str, str]) -> None:
    """Raise UsageError for an argument of `map` that is not for the first of the kinds of data."""
    names = {
        "photograph": {*signature(map_photograph).parameters},
        "cube": {*signature(map_cube).parameters, *signature(read_cube).parameters} - {"reading"},
    }
    own, other = kinds
    for name in options:
        if name not in names[own]:
            known = (
                f"is for a {other}, and the data are a {own}" if name in names[other] else "is no argument"
            )
            raise UsageError(f"`{name}` {known}; leave it out")
