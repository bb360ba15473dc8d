"""Colours of films from files and photographs, with the sensor that saw them."""

import os
from collections.abc import Sequence

import numpy as np

from pellicle.data.cameras import Camera, Sight, sight
from pellicle.data.colour_rows import ColourRows, read_colour_rows
from pellicle.data.colours import Colours
from pellicle.data.photograph_colours import Pixels, photograph_colours
from pellicle.data.photographs import image_format, read_photograph
from pellicle.errors import UsageError


def read_colours(path: str | os.PathLike[str], *, name: str | None = None, **options) -> Colours:
    """Read the colours of one film from CSV, or from a PNG, TIFF or JPEG photograph.

    A CSV has R, G, B, or X, Y, Z, or x, y, Y, or L*, a*, b*, and may have angle_deg, sigma and name. Of a
    photograph the mean colour of a region, or of points, is taken in linear light.

    **Arguments:** `name` of the film where a file has several, or the region as written; all others are
    those of `read_colours_by_film`.

    **Returns:** `Colours`, as `pellicle.fit` takes them.

    **Raises:** as `read_colours_by_film`; UsageError for several films without a `name`, or an unknown one.
    """
    films = read_colours_by_film(path, **options)
    chosen = [film for film in films if name is None or film.name == name]
    if len(chosen) != 1:
        known = ", ".join(repr(film.name) for film in films)
        raise UsageError(f"{path}: has {len(films)} films, {known}: choose one with `name`")
    return chosen[0]


def read_colours_by_film(
    path: str | os.PathLike[str],
    *,
    space: str | None = None,
    observer: str = "1931",
    illuminant: str = "D65",
    lamp: str | os.PathLike[str] | None = None,
    sensitivities: str | os.PathLike[str] | None = None,
    chart: str | os.PathLike[str] | None = None,
    gamma: float = 1.0,
    white_balance: str = "fixed",
    white: Pixels | None = None,
    region: Pixels | None = None,
    points: Pixels | None = None,
    angle: float | Sequence[float] | None = None,
    polarisation: str = "unpolarised",
    signal: str = "R",
    noise: float | Sequence[float] | None = None,
    signal_unit: str | None = None,
    columns: str | Sequence[str] | None = None,
) -> list[Colours]:
    """Read the colours of every film of a CSV file, or of every region of a photograph.

    **Arguments:**

    - `path` of a CSV, or of a PNG, TIFF or JPEG photograph (extra `images`).
    - `space`: "srgb", "rgb" (a camera's channels), "xyz" or "lab", where the file does not say it; "srgb" of
      R, G, B and of photographs.
    - `observer`: "1931" or "1964"; `illuminant`: E, A, D50, D55, D65 or D75; `lamp`: CSV of a spectrum in
      place of the illuminant.
    - `sensitivities`: CSV of a camera's three channels; `chart`: CSV of a photographed chart in their place,
      with R, G, B as measured and X, Y, Z of the reference. Without either, "rgb" is linear sRGB.
    - `gamma` of "rgb": values are linear ones to the power 1/`gamma`.
    - `white_balance`: "fixed", or "free" where each channel has an unknown factor.
    - `white`: region of a photograph that shows a perfect reflector, by which colours are divided.
    - `region`: rectangles "x,y,width,height;..." of a photograph in pixels from its upper left corner;
      `points`: "x,y;...", each with the pixels around it, 5 by 5.
    - `angle` of incidence in degrees, for all colours; or one for each, and for each region of a photograph,
      which are then colours of one film.
    - `polarisation`: "unpolarised", "s" or "p"; `signal`: "R", or "T" for transmitted light.
    - `noise`: standard deviation of the values, one or three; of a photograph by default the scatter of the
      region's pixels and the rounding.
    - `signal_unit`: "fraction", "percent", "8-bit" or "16-bit", where values do not show it.
    - `columns`: names in the order of a CSV's columns, "_" to skip one.

    **Returns:** a list of `Colours`, one for each film.

    **Raises:** DataError (unreadable or impossible data) or UsageError (an argument missing or wrong, or a
    photograph without the extra `images`): one sentence.
    """
    if signal not in ("R", "T"):
        raise UsageError(f'`signal` must be R or T, and `space` the colour space, not `signal="{signal}"`')
    lamp, sensitivities, chart = (None if x is None else os.fspath(x) for x in (lamp, sensitivities, chart))
    camera = Camera(
        observer, illuminant, lamp, sensitivities, chart, gamma, white_balance, transmitted=signal == "T"
    )
    if image_format(path) is not None:
        if columns is not None or signal_unit is not None:
            raise UsageError(f"{path}: is a photograph: leave `columns` and `signal_unit` out")
        films, seen = photograph_colours(read_photograph(path), space, camera, region, points, white, angle)
        angle = None
    else:
        if not region is points is white is None:
            raise UsageError(f"{path}: is no photograph: leave `region`, `points` and `white` out")
        films = read_colour_rows(path, space, unit=signal_unit, columns=columns)
        seen = sight(camera, films[0].space)
    return [_assembled(film, seen, camera, angle, noise, polarisation) for film in films]


def _assembled(
    film: ColourRows,
    seen: Sight,
    camera: Camera,
    angle: float | Sequence[float] | None,
    noise: float | Sequence[float] | None,
    polarisation: str,
) -> Colours:
    sigma, stated = film.sigma, film.angle
    if film.sight and camera.sensitivities is camera.chart is camera.lamp is None:
        taken = f"observer {camera.observer} under {camera.illuminant}"
        if taken != film.sight:
            _, observer, _, illuminant = film.sight.split()
            raise UsageError(
                f"{film.path}: states the {film.sight}, and would be read for the {taken}: give"
                f' `observer="{observer}"` and `illuminant="{illuminant}"`'
            )
    if noise is not None:
        if not (np.all(np.isfinite(noise)) and np.all(np.asarray(noise) > 0) and np.size(noise) in (1, 3)):
            raise UsageError(f"`noise` must be one standard deviation above zero, or three, got {noise}")
        if film.space != "lab" and np.any(np.asarray(noise) > 0.5):
            raise UsageError(f"`noise` {noise} is a fraction of white: divide 8-bit values by 255")
        sigma = np.broadcast_to(noise, film.values.shape)
    if angle is not None:
        count = len(film.values)
        if np.ndim(angle) and np.shape(angle) != (count,):
            raise UsageError(f"{film.path}: has {count} colours and `angle` {np.size(angle)} numbers")
        if stated is not None and not np.allclose(stated, angle, atol=1e-3):
            raise UsageError(f"{film.path}: states its own angles; leave `angle` out")
        stated = np.broadcast_to(np.asarray(angle, float), count)
    return Colours(
        film.values,
        seen.sensor,
        film.space,
        "T" if camera.transmitted else "R",
        sigma=sigma,
        angle=stated,
        polarisation=polarisation,
        gamma=camera.gamma,
        white_balance=camera.white_balance,
        camera=seen.matrix,
        path=film.path,
        sha256=film.sha256,
        lines=film.lines,
        notes=(*film.notes, *seen.notes),
        name=film.name,
    )
