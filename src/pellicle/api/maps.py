"""Verbs of maps and series: fits at every pixel of a cube or a photograph, and of a film against time."""

import os
from collections.abc import Callable
from inspect import signature
from pathlib import Path
from typing import Any

from pellicle.data.movies import is_movie
from pellicle.data.read_cube import is_photograph, read_cube
from pellicle.errors import UsageError
from pellicle.mapping.movie import fit_movie
from pellicle.mapping.photograph import map_photograph
from pellicle.mapping.run import map_cube
from pellicle.mapping.series import fit_series
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface, check_scene


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
      `if __name__ == "__main__":`. None: as many as there are cores, if that saves time. `scheduler`: address
      of a dask scheduler, "tcp://host:8786", whose workers reach the files by the same paths.
    - `preview`: fit only so many pixels, evenly spread, that it takes seconds; `out` must be another one.
    - `neighbours`: decide ambiguous pixels by the order of interference of their neighbours, of a photograph
      too. That of a cube is stored beside `out`, with "-neighbours" in its name.
    - `lamp_curve`: a gain against wavelength that all pixels have in common, by which the cube is divided:
      "joint", fitted together with the films of some pixels; "x,y,width,height", from a region whose scene is
      `lamp_reference`, by default the bare substrate; or a `LampCurve`.
    - `recipe`: text of the scene's recipe, kept in the map. `progress`: called with the name of a stage, the
      number of pixels done and their total. Others, such as `wavelengths`, `signal_unit`, `noise` and `mask`,
      are those of `pellicle.read_cube`.

    Of a photograph:

    - `strip`: "x0,y0,x1,y1", the ends of a line, 5 pixels wide; or `region`: "x,y,width,height", the whole
      photograph by default. Pixels count from the upper left corner.
    - `space`: "srgb" (the default), or "rgb" with its `gamma`. `observer`, `illuminant`, `lamp`,
      `sensitivities`, `white`, `flat_field`: as in `pellicle.read_colours_by_film`.
    - `layer`: name of the layer whose thickness is sought, the free one by default. `noise`: standard
      deviation of a coded channel, by default 1.5/255 of sRGB and 0.01 of "rgb".

    **Returns:** of a cube a `Map`: `dataset` has values, standard errors, status and rivals of each pixel. Of
    a photograph a `ThicknessMap`: `found` has thickness, standard error (of noise and camera), probability
    and status of each position, the most probable thickness first.

    **Raises:** DataError for data that cannot be read; UsageError for arguments of the other kind of data,
    for a store that is of another map, for pixels outside a photograph, and where nothing is free.
    """
    return _verb_for(data, scene, options)(data, scene, **options)


_OF_MAPS = "neighbours", "preview", "lamp_reference", "model"
"""Arguments of the map of a cube that a series does not take."""


def series(data: Any, scene: Scene, **options: Any) -> Any:
    """Fit a film that changes: thickness and rate against time from all spectra together, or from a movie.

    Each spectrum is fitted alone first, as a pixel of a map. The path of the thickness then decides the order
    of interference, and a state-space smoother joins all spectra, linearised around their values.

    **Arguments:**

    - `data`: paths of the spectra of all times, of a table with a column for each time, or of a cube whose
      only axis beside the wavelength is `time`; or such a cube as an xarray object. `time_from` says where
      the times of files are from, as in `pellicle.read_cube`, whose other arguments apply too.
    - `scene`: a film with a free thickness. It varies slowly, and all times share the other free numbers,
      unless their `varies` states otherwise.
    - `out`, `workers`, `resume`, `overwrite`, `progress`: of the map, as in `pellicle.map`.
    - `lamp_curve`: a gain against wavelength that no time changes, as of a window, by which all spectra are
      divided: "joint", fitted together with the films of all times, or a `LampCurve`.

    Of a movie, whose frames `data` are: a folder of images or their paths, or a TIFF of several pages:

    - `time_from` as above, or `frame_rate`, frames per second by the numbers in the names. Grey frames need
      the one wavelength of their filter in nm, `wavelengths`.
    - `strip` "x0,y0,x1,y1", a line of places, or `region` "x,y,width,height", by default the whole frame in
      squares; `points` "x,y;x,y", or positions along the line, at which thinning laws are fitted.
    - `space`, `observer`, `illuminant`, `lamp`, `sensitivities`, `gamma`, `flat_field`: as in `pellicle.map`
      of a photograph. Gain and dark level of each channel come from the movie.

    **Returns:** a `Series`: `dataset` has thickness, rate, errors and status of each time. Of a movie a
    `MovieResult`, whose `dataset` has them at each place, too, and which has thinning `laws`.

    **Raises:** DataError for data that cannot be read; UsageError for fewer than three times, and where
    nothing varies.

    ```python
    grown = pl.series(["film_0s.csv", "film_20s.csv", "film_40s.csv"], scene)
    grown.dataset.rate.plot()
    ```
    """
    check_scene(scene)
    if isinstance(scene, Surface):
        raise UsageError("`scene` of a series must be a Scene, a film, not a Surface")
    if is_movie(data):
        if unknown := sorted(options.keys() - {*signature(fit_movie).parameters}):
            raise UsageError(f"`{unknown[0]}` is no argument of a movie; leave it out")
        return fit_movie(data, scene, **options)
    known = {*signature(map_cube).parameters, *signature(read_cube).parameters}
    known -= {"reading", *_OF_MAPS}
    if unknown := sorted(options.keys() - known):
        raise UsageError(f"`{unknown[0]}` is no argument of a series; leave it out")
    return fit_series(data, scene, **options)


def _verb_for(data: Any, scene: Any, options: dict[str, Any]) -> Callable[..., Any]:
    """The function that maps these data. Raises UsageError for an argument that is for other data."""
    check_scene(scene)
    if isinstance(scene, Surface):
        raise UsageError("`scene` of a map must be a Scene, a film, not a Surface")
    names = {
        "photograph": {*signature(map_photograph).parameters},
        "cube": {*signature(map_cube).parameters, *signature(read_cube).parameters} - {"reading"},
    }
    photograph = isinstance(data, str | os.PathLike) and is_photograph(Path(data))
    kind, other = ("photograph", "cube") if photograph else ("cube", "photograph")
    for name in options.keys() - names[kind]:
        why = f"is for a {other}, and the data are a {kind}" if name in names[other] else "is no argument"
        raise UsageError(f"`{name}` {why}; leave it out")
    return map_photograph if photograph else map_cube
