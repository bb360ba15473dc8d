"""Images beside a cube: frames of a camera, which make reflectance of its counts, and masks of pixels.

R = (raw − dark) / (white − dark) · R_white, block by block. A frame is an image of every pixel (y, x, bands),
a line of a pushbroom camera (x, bands), the mean of several such lines, or one spectrum (bands).
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import ANGLE, WAVELENGTH, RawCube, Stored
from pellicle.data.photographs import image_format
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError, decoding, needs
from pellicle.signals.limits import HIGHEST

_BLOCK = 64
"""Lines that are averaged at a time."""
DEPTHS = (8, 10, 12, 14, 16)
"""Bits of cameras: a white frame whose largest count is exactly the top of one of them is saturated there."""


@dataclass(frozen=True, eq=False)
class CameraFrames:
    """Step from counts to reflectance; NaN where white is not above dark, or saturated.

    The frames have those axes of the cube along which they differ; `reflectance` of the white is that at all
    bands of the cube.
    """

    white: Stored
    dark: Stored | None
    reflectance: np.ndarray
    saturation: float | None

    def __call__(self, block: np.ndarray, pixels: Mapping[str, range], bands: np.ndarray) -> np.ndarray:
        """Return the reflectances of a block of counts."""
        white = self.white.block(pixels, bands)
        dark = 0.0 if self.dark is None else self.dark.block(pixels, bands).astype(float)
        good = np.isfinite(block)
        if self.saturation is not None:
            good = good & (block < self.saturation) & (white < self.saturation)
        span = white - dark
        with np.errstate(divide="ignore", invalid="ignore"):
            values = (block - dark) / span * self.reflectance[bands]
        return np.where(good & (span > 0), values, np.nan)


def camera_frames(
    raw: RawCube,
    nm: np.ndarray,
    white: RawCube,
    dark: RawCube | None,
    reflectance: Any,
    saturation: float | None,
) -> tuple[CameraFrames, list[str]]:
    """Return the frames of a cube whose bands are at `nm`, and notes on them.

    `reflectance` of the white is a number, a CSV or a function of the wavelength. Raises DataError or
    UsageError.
    """
    if ANGLE in raw.arrays["values"].axes or "delta" in raw.arrays:
        raise UsageError(
            f"{raw.path}: `white_frame` is for a cube of counts against wavelength only: leave it out"
        )
    bright, note = _frame(white, raw, "white")
    notes, black = [note], None
    if dark is None:
        notes.append("no dark frame: the counts without light are taken as zero")
    else:
        black, note = _frame(dark, raw, "dark")
        notes.append(note)
    kind = raw.arrays["values"].data.dtype
    if saturation is not None:
        notes.append(f"counts from {saturation:g} are saturated, as given")
    elif kind.kind in "ui":  # the limit of another camera is not known
        saturation = float(np.iinfo(kind).max)
        sizes = bright.sizes
        first = max((axis for axis in sizes if axis != WAVELENGTH), key=sizes.__getitem__, default=WAVELENGTH)
        lines = np.unique(np.linspace(0, sizes[first] - 1, _BLOCK).astype(int))  # a sample of the frame
        largest = max(float(np.max(bright.read({first: slice(i, i + 1)}))) for i in lines)
        if largest < saturation and largest in (2.0**bits - 1 for bits in DEPTHS):
            saturation = largest
        notes.append(f"counts from {saturation:g} are saturated")
    return CameraFrames(bright, black, _white_reflectance(reflectance, nm, raw.path), saturation), notes


def _frame(raw: RawCube, cube: RawCube, name: str) -> tuple[Stored, str]:
    """A frame for the pixels of a cube, and a note on its form. Raises DataError for another size."""
    frame, whole = raw.arrays["values"], cube.arrays["values"].sizes
    sizes, bands = frame.sizes, whole.pop(WAVELENGTH)
    if sizes[WAVELENGTH] != bands:
        raise DataError(
            f"{raw.path}: the {name} frame has {sizes[WAVELENGTH]} bands and {cube.path} has "
            f"{bands}: record both with the same settings of the camera"
        )
    others = [axis for axis in frame.axes if axis not in ("x", WAVELENGTH)]
    long = [axis for axis, n in sizes.items() if n > 1 and axis != WAVELENGTH]
    if all(whole.get(axis) == sizes[axis] for axis in long):
        kept = tuple(axis for axis in frame.axes if axis in (*long, WAVELENGTH))
        if kept != frame.axes:
            frame = Stored(frame.read().reshape([sizes[axis] for axis in kept]), kept)
        form = {0: "one spectrum", 1: "a line of pixels"}.get(len(long), "an image")
        return frame, f"{name} frame {raw.path}: {form}"
    if "x" in whole and sizes.get("x") == whole["x"]:
        # the mean over all axes but x and wavelength, some lines at a time
        count, first = int(np.prod([sizes[axis] for axis in others])), max(others, key=sizes.__getitem__)
        summed = tuple(frame.axes.index(axis) for axis in others)
        blocks = (slice(start, start + _BLOCK) for start in range(0, sizes[first], _BLOCK))
        total = sum(frame.read({first: block}).astype(float).sum(axis=summed) for block in blocks)
        line = Stored(np.asarray(total) / count, tuple(axis for axis in frame.axes if axis not in others))
        return line, f"{name} frame {raw.path}: mean of {count} lines"
    shown = " x ".join(str(sizes[axis]) for axis in raw.dims)
    raise DataError(
        f"{raw.path}: the {name} frame has {shown} pixels and {cube.path} has "
        f"{' x '.join(map(str, cube.shape))}: it must be an image of the same size, a line of as many x, or "
        "one spectrum"
    )


def _white_reflectance(reflectance: Any, nm: np.ndarray, path: str) -> np.ndarray:
    """Reflectance of the white reference at all bands, NaN beyond its table. Raises UsageError."""
    if callable(reflectance):
        values = np.asarray(reflectance(nm), dtype=float)
    else:
        reflectance = 1.0 if reflectance is None else reflectance
        try:
            values = np.full(nm.size, float(reflectance))
        except (TypeError, ValueError):
            known = read_spectrum(reflectance)
            values = np.interp(nm, known.wavelength, known.values, left=np.nan, right=np.nan)
    values = np.broadcast_to(values, nm.shape)
    if np.any(values <= 0) or np.any(values > HIGHEST) or not np.any(np.isfinite(values)):
        raise UsageError(
            f"{path}: `white_reflectance` must be above 0 and a fraction at the wavelengths of the bands, "
            "as in 0.99"
        )
    return values


def read_mask(mask: str | os.PathLike[str] | np.ndarray, raw: RawCube) -> np.ndarray:
    """Return True for the pixels to use (*pixels), where the mask is not zero and not NaN.

    A mask of the last axes, as y and x of a series in time, applies to all of the first. Raises DataError for
    another size, UsageError for what is no mask.
    """
    if isinstance(mask, np.ndarray):
        values, name = mask, "the mask"
    else:
        name = os.fspath(mask)
        if name in raw.others:
            stored = raw.others[name]
            order = [stored.axes.index(axis) for axis in raw.dims if axis in stored.axes]
            values = np.transpose(stored.read(), order)
        else:
            values = _mask_file(Path(name), raw)
    used = values != 0
    if values.dtype.kind == "f":
        used &= ~np.isnan(values)
    if used.shape != raw.shape[-used.ndim :]:
        raise DataError(
            f"{name}: has {' x '.join(map(str, used.shape))} pixels and {raw.path} has "
            f"{' x '.join(map(str, raw.shape))}: the mask must have the same"
        )
    if not used.any():
        raise DataError(f"{name}: masks every pixel: what is not zero is used")
    return np.broadcast_to(used, raw.shape)


def _mask_file(path: Path, raw: RawCube) -> np.ndarray:
    if not path.is_file():
        known = f" or one of its variables {', '.join(map(repr, raw.others))}" if raw.others else ""
        raise UsageError(f"`mask` {str(path)!r} is no file{known}: name a PNG, a TIFF or a .npy file")
    if path.suffix.lower() == ".npy":
        return np.load(path)
    kind = image_format(path)
    if kind is None:
        raise UsageError(f"`mask` {str(path)!r} is no PNG, TIFF or .npy file: save it as one of these")
    damaged = decoding(f"{path}: the {kind} cannot be read", "save it again")
    with needs("images", f"{path}: images need"), damaged:
        if kind == "TIFF":
            import tifffile

            values = tifffile.imread(path)
        else:
            from PIL import Image

            with Image.open(path) as image:
                values = np.asarray(image.convert("RGB") if image.mode == "P" else image)
    return values if values.ndim == 2 else np.any(values[..., :3] != 0, axis=-1)
