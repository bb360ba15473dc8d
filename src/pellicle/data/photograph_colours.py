"""Colours of regions of a photograph, averaged in linear light and divided by a white."""

from collections.abc import Sequence

import numpy as np

from pellicle.colour.encoding import Encoding
from pellicle.data.cameras import Camera, Sight, sight
from pellicle.data.colour_rows import ColourRows
from pellicle.data.photographs import Photograph, Region, parse_points, parse_regions
from pellicle.errors import DataError, UsageError

Pixels = str | Sequence[int] | Sequence[Sequence[int]]
"""Regions or points of a photograph: "x,y,w,h;x,y,w,h", or numbers."""
_LIMITED = 0.5
"""Share of clipped pixels above which a channel is a limit: the median is clipped."""


def photograph_colours(
    photograph: Photograph,
    space: str | None,
    camera: Camera,
    region: Pixels | None,
    points: Pixels | None,
    white: Pixels | None,
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
    regions = parse_points(points, photograph) if points is not None else parse_regions(region or "")
    reference, notes = white_reference(photograph, seen.coding, white)
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
    for number, each in enumerate(regions):
        value, sigma, sentences = region_colour(each, photograph, seen.coding, reference)
        of_region = None if angles is None else np.atleast_1d(angles if angles.ndim == 0 else angles[number])
        films.append(ColourRows(space, value, sigma, of_region, None, (*told, *sentences), str(each)))
    if angles is not None and angles.ndim:
        films = [_joined(films)]
    return [film._replace(path=photograph.path, sha256=photograph.sha256) for film in films], seen


def _joined(films: list[ColourRows]) -> ColourRows:
    """The regions as colours of one film, without σ where one of them is a single pixel."""
    notes = dict.fromkeys(note for film in films for note in film.notes)
    sigma = [film.sigma for film in films if film.sigma is not None]
    return films[0]._replace(
        values=np.concatenate([film.values for film in films]),
        sigma=np.concatenate(sigma) if len(sigma) == len(films) else None,
        angle=np.concatenate([film.angle for film in films if film.angle is not None]),
        notes=tuple(notes),
        name=";".join(film.name for film in films),
    )


def check_photograph(photograph: Photograph, space: str | None) -> str:
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


def white_reference(
    photograph: Photograph, coding: Encoding, white: Pixels | None
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Linear channels (3,) of the region `white`, 1 without one. Raises UsageError where it is clipped."""
    if white is None:
        return np.ones(3), ()
    one, *others = parse_regions(white, "white")
    if others:
        raise UsageError("`white` must be one region")
    pixels = one.pixels(photograph, "white")
    dark = np.mean(pixels <= 0, axis=0)
    if np.any(dark > 0.01):
        name = "RGB"[int(np.argmax(dark))]
        raise UsageError(
            f"{photograph.path}: `white` {one} is black in {100 * dark.max():.0f} % of its pixels in {name}:"
            " choose the region of a white standard"
        )
    limited = np.mean(pixels >= 1, axis=0)
    if np.any(limited > 0.01):
        name, share = "RGB"[int(np.argmax(limited))], 100 * limited.max()
        raise UsageError(
            f"{photograph.path}: `white` {one} is clipped in {share:.0f} % of its pixels in {name}: expose"
            " less, or choose another region"
        )
    linear = coding.decoded(pixels).mean(axis=0)
    shown = ", ".join(f"{x:.3g}" for x in linear)
    return linear, (f"divided by the white of region {one}, linear {shown}",)


def region_colour(
    region: Region, photograph: Photograph, coding: Encoding, white: np.ndarray
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
        slope = [np.diagonal(coding.rise(at), axis1=-2, axis2=-1) for at in (mean, exposed)]
        sigma = scatter / slope[0] / white * slope[1]
    if np.any(exposed > 1 + 1e-6):
        notes.append(
            f"region {region}: brighter than white in {_named(exposed > 1 + 1e-6)}, taken as a limit"
        )
    for limit, what in ((0.0, "dark"), (1.0, "bright")):
        share = np.mean(pixels == limit, axis=0)
        if np.any(share > 0):
            percent = 100 * share.max()
            at_limit = share > _LIMITED
            value = np.where(at_limit, limit, value)
            told = f", taken as a limit in {_named(at_limit)}" if at_limit.any() else ""
            notes.append(f"region {region}: up to {percent:.2g} % of the pixels are clipped ({what}){told}")
    return value[None], None if sigma is None else sigma[None], tuple(notes)


def _named(channels: np.ndarray) -> str:
    return ", ".join("RGB"[i] for i in np.flatnonzero(channels))
