"""Colours of films from CSV files and photographs, with the sensor that saw them.

Regions of a photograph are averaged in linear light and divided by a white.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pellicle.colour.spaces import Encoding
from pellicle.data import photographs
from pellicle.data.cameras import Camera, Sight, sight
from pellicle.data.colour_rows import ColourRows, read_colour_rows
from pellicle.data.colours import Colours
from pellicle.errors import DataError, UsageError

Pixels = str | Sequence[int] | Sequence[Sequence[int]]
"""Regions or points of a photograph: "x,y,w,h;x,y,w,h", or numbers."""
_LIMITED = 0.05
"""Share of clipped pixels above which a channel is a limit: the mean of the others is no measure of it."""

_UNBALANCED = 0.05
"""Relative error of the white balance of a photograph that is not divided by a white."""


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
    flat_field: str | os.PathLike[str] | None = None,
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
    - `flat_field`: photograph of an evenly white surface in the same light, by which each pixel is divided.
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
    if photographs.image_format(path) is not None:
        if columns is not None or signal_unit is not None:
            raise UsageError(f"{path}: is a photograph: leave `columns` and `signal_unit` out")
        films, seen = _photograph_colours(
            photographs.read_photograph(path), space, camera, region, points, white, flat_field, angle
        )
        angle = None
    else:
        if not region is points is white is flat_field is None:
            photographs.refuse_foreign_image(path)
            only = "`region`, `points`, `white` and `flat_field`"
            raise UsageError(f"{path}: is no photograph: leave {only} out")
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
    """The colours of one film, with the arguments of their reader. Raises UsageError."""
    read: dict[str, Any] = film._asdict() | {"notes": (*film.notes, *seen.notes)}
    stated = read.pop("sight")
    taken = f"observer {camera.observer} under {camera.illuminant}"
    if stated not in ("", taken) and camera.sensitivities is camera.chart is camera.lamp is None:
        _, observer, _, illuminant = stated.split()
        raise UsageError(
            f"{film.path}: states the {stated}, and would be read for the {taken}: give"
            f' `observer="{observer}"` and `illuminant="{illuminant}"`'
        )
    if noise is not None:
        if not (np.all(np.isfinite(noise)) and np.all(np.asarray(noise) > 0) and np.size(noise) in (1, 3)):
            raise UsageError(f"`noise` must be one standard deviation above zero, or three, got {noise}")
        if film.space != "lab" and np.any(np.asarray(noise) > 0.5):
            raise UsageError(f"`noise` {noise} is a fraction of white: divide 8-bit values by 255")
        read["sigma"] = np.broadcast_to(noise, film.values.shape)
    if angle is not None:
        count = len(film.values)
        if np.ndim(angle) and np.shape(angle) != (count,):
            raise UsageError(f"{film.path}: has {count} colours and `angle` {np.size(angle)} numbers")
        if film.angle is not None and not np.allclose(film.angle, angle, atol=1e-3):
            raise UsageError(f"{film.path}: states its own angles; leave `angle` out")
        read["angle"] = np.broadcast_to(np.asarray(angle, float), count)
    return Colours(
        **read,
        sensor=seen.sensor,
        signal="T" if camera.transmitted else "R",
        polarisation=polarisation,
        gamma=camera.gamma,
        white_balance=camera.white_balance,
        camera=seen.matrix,
        calibrated=film.space != "rgb" or (camera.sensitivities, camera.chart) != (None, None),
    )


def _photograph_colours(
    photograph: photographs.Photograph,
    space: str | None,
    camera: Camera,
    region: Pixels | None,
    points: Pixels | None,
    white: Pixels | None,
    flat_field: str | os.PathLike[str] | None,
    angle: float | Sequence[float] | None,
) -> tuple[list[ColourRows], Sight]:
    """Return the colours of the regions of a photograph, of a film each, or of one film at several angles."""
    assumed = space is None
    space = check_photograph(photograph, space)
    seen = sight(camera, space)
    if region is not None and points is not None:
        raise UsageError(f"{photograph.path}: `region` and `points` exclude each other: leave one out")
    if region is points is None:
        width, height = photograph.size
        either = '`region="x,y,width,height"` or `points="x,y"`'
        raise UsageError(f"{photograph.path}: is a photograph of {width} by {height} pixels: give {either}")
    squares = None if points is None else photographs.parse_points(points, photograph)
    regions = squares or photographs.parse_regions(region or "")
    photograph, reference, notes = against_white(photograph, seen.coding, white, flat_field)
    angles = None if angle is None else np.asarray(angle, float)
    if angles is not None and angles.ndim and len(angles) != len(regions):
        raise UsageError(
            f"{len(angles)} angles are given for {len(regions)} regions of the photograph: give one for each"
        )
    told = [*photograph.notes, *notes]
    if assumed and photograph.floats:
        told.append('floating-point values taken as coded in sRGB: give `space="rgb"` if they are linear')
    told += [f"colour profile {photograph.profile} ignored"] if photograph.profile else []
    films = []
    for number, region in enumerate(regions):
        value, sigma, sentences = _region_colour(region, photograph, seen.coding, reference)
        of_region = None if angles is None else np.atleast_1d(angles if angles.ndim == 0 else angles[number])
        rows = ColourRows(space, value, sigma, of_region, None, (*told, *sentences), str(region))
        rows = rows._replace(balance=white_balance_error(white, flat_field))
        films.append(rows._replace(path=photograph.path, sha256=photograph.sha256))
    if angles is None or not angles.ndim:
        return films, seen
    # the regions are colours of one film, without σ where one of them is a single pixel
    sigma = [film.sigma for film in films if film.sigma is not None]
    joined = films[0]._replace(
        values=np.concatenate([film.values for film in films]),
        sigma=np.concatenate(sigma) if len(sigma) == len(films) else None,
        angle=angles,
        notes=tuple(dict.fromkeys(note for film in films for note in film.notes)),
        name=";".join(film.name for film in films),
    )
    return [joined], seen


def check_photograph(photograph: photographs.Photograph, space: str | None) -> str:
    """Return the space of a photograph, "srgb" by default. Raises UsageError or DataError for another one."""
    if space not in (None, "srgb", "rgb"):
        raise UsageError(
            f'{photograph.path}: a photograph has `signal="srgb"` or `signal="rgb"`, not {space}'
        )
    if photograph.profile and space != "rgb":
        raise DataError(
            f"{photograph.path}: has the colour profile {photograph.profile!r}, not sRGB: convert the"
            " photograph to sRGB"
        )
    return space or "srgb"


def white_balance_error(white: Pixels | None, flat_field: str | os.PathLike[str] | None) -> float | None:
    """Relative standard uncertainty of a photograph's white balance, None for the usual one."""
    return _UNBALANCED if white is flat_field is None else None


def against_white(
    photograph: photographs.Photograph,
    coding: Encoding,
    white: Pixels | None,
    flat_field: str | os.PathLike[str] | None,
) -> tuple[photographs.Photograph, np.ndarray, list[str]]:
    """The photograph without the uneven light of a flat field, the linear channels (3,) of the region `white`
    in it (1 without one), and notes.

    Raises UsageError for a white that is clipped, and a flat field of another size.
    """
    notes, reference = list[str](), np.ones(3)
    if flat_field is not None:
        photograph = _flattened(photograph, coding, photographs.read_photograph(flat_field))
        notes.append(f"divided by the flat field {flat_field}")
    if white is not None:
        region, *others = photographs.parse_regions(white, "white")
        if others:
            raise UsageError("`white` must be one region")
        pixels = region.pixels(photograph, "white")
        _check_white(pixels, f"{photograph.path}: `white` {region}", "choose another region")
        reference = coding.decoded(pixels).mean(axis=0)
        shown = ", ".join(f"{x:.3g}" for x in reference)
        notes.append(f"divided by the white of region {region}, linear {shown}")
    return photograph, reference, notes


def _flattened(
    photograph: photographs.Photograph, coding: Encoding, flat: photographs.Photograph
) -> photographs.Photograph:
    """A photograph divided by one of an evenly white surface in linear light; clipped pixels stay so."""
    if flat.size != photograph.size:
        sizes = f"{flat.size[0]} by {flat.size[1]} pixels and {photograph.path} {photograph.size[0]} by"
        raise UsageError(f"{flat.path}: has {sizes} {photograph.size[1]}: take both with one camera")
    _check_white(flat.pixels.reshape(-1, 3), f"{flat.path}: the flat field", "photograph it again")
    linear = coding.decoded(photograph.pixels) / coding.decoded(np.maximum(flat.pixels, flat.step))
    clipped = (photograph.pixels <= 0) | (photograph.pixels >= 1)
    pixels = np.where(clipped, photograph.pixels, coding.encode(linear, coding.roots(linear)))
    return replace(photograph, pixels=pixels.astype(np.float32))


def _check_white(pixels: np.ndarray, where: str, remedy: str) -> None:
    """Raise UsageError where more than 1 % of the coded pixels (N, 3) of a white are black or clipped."""
    for limited, what, why in (
        (pixels <= 0, "black", "it is no white"),
        (pixels >= 1, "clipped", "expose less"),
    ):
        share = np.mean(limited, axis=0)
        if np.any(share > 0.01):
            percent, channel = 100 * share.max(), "RGB"[int(np.argmax(share))]
            raise UsageError(
                f"{where} is {what} in {percent:.0f} % of its pixels in {channel}: {why}, or {remedy}"
            )


def _region_colour(
    region: photographs.Region, photograph: photographs.Photograph, coding: Encoding, white: np.ndarray
) -> tuple[np.ndarray, np.ndarray | None, tuple[str, ...]]:
    """Mean colour of a region in linear light, coded again: (1, 3), its σ (1, 3), and sentences on it.

    σ is the scatter of the pixels, not that of their mean, and the rounding: neighbouring pixels of a photo
    share their errors. A single pixel has no σ.
    """
    pixels = region.pixels(photograph)
    mean = coding.decoded(pixels).mean(axis=0, dtype=float)
    notes = [f"region {region}: mean of {len(pixels)} pixels in linear light"]
    exposed = mean / white
    value = coding.encode(exposed, coding.roots(exposed))
    sigma = None
    if len(pixels) > 1:
        scatter = np.hypot(pixels.std(axis=0, dtype=float, ddof=1), photograph.step / np.sqrt(12))
        slope = [np.diagonal(coding.rise(x), axis1=-2, axis2=-1) for x in (mean, exposed)]
        sigma = scatter / slope[0] / white * slope[1]
    if np.any(exposed > 1 + 1e-6):
        notes.append(
            f"region {region}: brighter than white in {_named(exposed > 1 + 1e-6)}, taken as a limit"
        )
    for limit, what in ((0.0, "dark"), (1.0, "bright")):
        share = np.mean(pixels == limit, axis=0)
        if np.any(share > 0):
            percent = float(f"{100 * share.max():.2g}")  # 100, not 1e+02
            at_limit = share > _LIMITED
            value = np.where(at_limit, limit, value)
            told = f", taken as a limit in {_named(at_limit)}" if at_limit.any() else ""
            notes.append(f"region {region}: up to {percent:g} % of the pixels are clipped ({what}){told}")
    return value[None], None if sigma is None else sigma[None], tuple(notes)


def _named(channels: np.ndarray) -> str:
    return ", ".join("RGB"[i] for i in np.flatnonzero(channels))
