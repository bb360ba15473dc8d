"""Reflectance from the counts of a camera, with frames of a white reference and of the dark.

R = (raw − dark) / (white − dark) · R_white, block by block. A frame is an image of every pixel (y, x, bands),
a line of a pushbroom camera (x, bands), the mean of several such lines, or one spectrum (bands).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import RawCube
from pellicle.data.cubes.stored_arrays import WAVELENGTH, Stored
from pellicle.errors import DataError

_BLOCK = 64
"""Lines that are averaged at a time."""
_DEPTHS = (8, 10, 12, 14, 16)
"""Bits of cameras: a white frame whose largest count is exactly the top of one of them is saturated there."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Counts of a frame: an image that stays in its file, or a line or spectrum in memory.

    `axes` are those of the cube that it has, bands last as stored.
    """

    stored: Stored
    axes: tuple[str, ...]

    def block(self, where: tuple[slice, ...], dims: tuple[str, ...], bands: np.ndarray) -> np.ndarray:
        """Counts for a block of pixels, with axes of length one where the frame has none."""
        read = self.stored.read(dict(zip(dims, where, strict=True)))
        order = [self.stored.axes.index(axis) for axis in (*dims, WAVELENGTH) if axis in self.stored.axes]
        read = np.transpose(read, order)[..., bands]
        sizes = iter(read.shape[:-1])
        return read.reshape([*(next(sizes) if axis in self.axes else 1 for axis in dims), bands.size])


@dataclass(frozen=True, eq=False)
class Calibration:
    """Counts of a block to reflectance; NaN where white is not above dark, or saturated."""

    white: Frame
    dark: Frame | None
    reflectance: np.ndarray
    bands: np.ndarray
    saturation: float | None

    def __call__(self, block: np.ndarray, where: tuple[slice, ...], dims: tuple[str, ...]) -> np.ndarray:
        """Return the reflectances."""
        white = self.white.block(where, dims, self.bands)
        dark = 0.0 if self.dark is None else self.dark.block(where, dims, self.bands).astype(float)
        good = np.isfinite(block)
        if self.saturation is not None:
            good = good & (block < self.saturation) & (white < self.saturation)
        span = white - dark
        with np.errstate(divide="ignore", invalid="ignore"):
            values = (block - dark) / span * self.reflectance
        return np.where(good & (span > 0), values, np.nan)


def frame_of(raw: RawCube, cube: RawCube, name: str) -> tuple[Frame, str]:
    """Return a frame for the pixels of a cube, and a note on its form. Raises DataError for another size."""
    values, own = raw.arrays["values"], cube.arrays["values"]
    bands = own.size(WAVELENGTH)
    if values.size(WAVELENGTH) != bands:
        raise DataError(
            f"{raw.path}: the {name} frame has {values.size(WAVELENGTH)} bands and {cube.path} has "
            f"{bands}: record both with the same settings of the camera"
        )
    sizes = {axis: values.size(axis) for axis in values.axes if axis != WAVELENGTH}
    whole = {axis: own.size(axis) for axis in cube.dims}
    seen = {axis: n for axis, n in sizes.items() if n > 1}
    if all(whole.get(axis) == n for axis, n in seen.items()):
        axes = tuple(axis for axis in cube.dims if axis in seen)
        drop = {axis: slice(0, 1) for axis in sizes if axis not in seen}
        if drop:
            values = _loaded(values, drop, axes)
        form = {0: "one spectrum", 1: "a line of pixels"}.get(len(axes), "an image")
        return Frame(values, axes), f"{name} frame {raw.path}: {form}"
    if "x" in whole and sizes.get("x") == whole["x"]:
        others = [axis for axis in values.axes if axis not in ("x", WAVELENGTH)]
        count = int(np.prod([sizes[axis] for axis in others]))
        return Frame(_mean_line(values, others), ("x",)), f"{name} frame {raw.path}: mean of {count} lines"
    shown = " x ".join(map(str, sizes.values()))
    raise DataError(
        f"{raw.path}: the {name} frame has {shown} pixels and {cube.path} has "
        f"{' x '.join(map(str, whole.values()))}: it must be an image of the same size, a line of as many "
        "x, or one spectrum"
    )


def _loaded(values: Stored, drop: dict[str, slice], axes: tuple[str, ...]) -> Stored:
    """A frame without its axes of length one, in memory."""
    read = values.read(drop)
    kept = tuple(axis for axis in values.axes if axis in (*axes, WAVELENGTH))
    return Stored(read.reshape([values.size(axis) for axis in kept]), kept)


def _mean_line(values: Stored, others: list[str]) -> Stored:
    """The mean over all axes but x and wavelength, some lines at a time."""
    first = max(others, key=values.size)
    total: Any = 0.0
    order = [values.axes.index(axis) for axis in ("x", WAVELENGTH)]
    for start in range(0, values.size(first), _BLOCK):
        block = values.read({first: slice(start, start + _BLOCK)}).astype(float)
        total = total + np.transpose(
            block, [*order, *[i for i in range(block.ndim) if i not in order]]
        ).reshape(block.shape[order[0]], block.shape[order[1]], -1).sum(-1)
    return Stored(total / np.prod([values.size(axis) for axis in others]), ("x", WAVELENGTH))


def saturation_level(raw: RawCube, white: Frame, given: float | None) -> tuple[float | None, str]:
    """Counts from which a pixel is saturated, and a note; None for a camera whose limit is not known."""
    if given is not None:
        return given, f"counts from {given:g} are saturated, as given"
    kind = raw.arrays["values"].data.dtype
    if kind.kind not in "ui":
        return None, ""
    top = float(np.iinfo(kind).max)
    largest = _largest(white.stored)
    tops = [2.0**bits - 1 for bits in _DEPTHS if 2.0**bits - 1 < top]
    if largest in tops:
        top = largest
    return top, f"counts from {top:g} are saturated"


def _largest(stored: Stored) -> float:
    """The largest count in a sample of the frame."""
    first = max((axis for axis in stored.axes if axis != WAVELENGTH), key=stored.size, default=WAVELENGTH)
    lines = np.unique(np.linspace(0, stored.size(first) - 1, _BLOCK).astype(int))
    return max(float(np.max(stored.read({first: slice(i, i + 1)}))) for i in lines)
