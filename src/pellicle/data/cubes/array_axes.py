"""Axes of arrays without names: which one is that of the bands, by its length."""

from __future__ import annotations

from pellicle.data.cubes.stored_arrays import WAVELENGTH
from pellicle.errors import DataError, UsageError

_PIXELS = {1: ("site",), 2: ("y", "x"), 3: ("time", "y", "x")}
"""Axes of pixels of an array, by their number."""


def array_axes(shape: tuple[int, ...], bands: int, path: str) -> tuple[tuple[str, ...], list[str]]:
    """Return the names of the axes of an array of pixels with `bands` bands, and notes.

    The axis of the bands is the last, or else the only one of that length. Raises DataError where no axis has
    it.
    """
    pixels = _PIXELS.get(len(shape) - 1)
    text = " x ".join(map(str, shape))
    if pixels is None:
        raise DataError(
            f"{path}: has {len(shape)} axes ({text}), and a cube has y, x and wavelength, perhaps after a "
            "time: give it as an xarray Dataset, which names its axes"
        )
    if bands not in shape:
        raise DataError(
            f"{path}: {bands} wavelengths are given, and none of its axes ({text}) has that length: give one "
            "for each band with `wavelengths`"
        )
    at = len(shape) - 1
    if shape[at] != bands:
        at = shape.index(bands)
    axes = (*pixels[:at], WAVELENGTH, *pixels[at:])
    return axes, [f"axes: {', '.join(axes)}, since that of the wavelengths has {bands} bands"]


def need_wavelengths(shape: tuple[int, ...], path: str) -> UsageError:
    """The error for an array whose wavelengths nobody states."""
    text = " x ".join(map(str, shape))
    if 3 in (shape[0], shape[-1]) and len(shape) == 3:
        return UsageError(
            f"{path}: has three channels ({text}) and no wavelengths: the map of colours reads a photograph "
            "as PNG "
            'or TIFF in R, G, B (`signal="srgb"`); give `wavelengths` if it has three bands'
        )
    return UsageError(
        f'{path}: has no wavelengths for its bands ({text}): give them with `wavelengths="400:900:5"`, '
        "numbers or "
        "a file"
    )
