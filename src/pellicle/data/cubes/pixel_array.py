"""Measured values of a cube as an array that is read and converted block by block."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.data.cubes.stored_arrays import ANGLE, WAVELENGTH, Stored

Conversion = Callable[[np.ndarray, tuple[slice, ...], tuple[str, ...]], np.ndarray]
"""Conversion of a block (*pixels, bands[, angles]) of stored numbers, given its pixels and their axes."""


@dataclass(frozen=True)
class Scale:
    """Stored numbers to fractions or degrees: (value · factor), or 10⁻ᵛᵃˡᵘᵉ of an absorbance.

    `missing` is the stored value of what was not measured, which becomes NaN, as infinite values do.
    """

    factor: float = 1.0
    missing: float | None = None
    absorbance: bool = False

    def __call__(self, block: np.ndarray, where: tuple[slice, ...], dims: tuple[str, ...]) -> np.ndarray:
        """Return the converted block."""
        del where, dims
        values = np.array(block, dtype=float)
        if self.missing is not None:
            values[block == np.asarray(self.missing).astype(block.dtype)] = np.nan
        values[np.isinf(values)] = np.nan
        values *= self.factor
        return 10.0 ** -np.clip(values, -300.0, None) if self.absorbance else values


@dataclass(frozen=True, eq=False)
class PixelArray:
    """Values (*pixels, bands) or (*pixels, bands, angles), float64, read by slicing.

    `stored` has the axes of the file in any order, and may lack some, along which its values repeat; `bands`
    and `angles` are the numbers of those that are used, in their order; `sizes` the pixels along each of
    `dims`.
    """

    stored: Stored
    dims: tuple[str, ...]
    sizes: tuple[int, ...]
    bands: np.ndarray
    angles: np.ndarray | None
    conversions: Sequence[Conversion]

    @property
    def shape(self) -> tuple[int, ...]:
        """Pixels along each axis, bands and perhaps angles."""
        return (*self.sizes, self.bands.size, *([] if self.angles is None else [self.angles.size]))

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values that are read."""
        return np.dtype(float)

    def __getitem__(self, key: Any) -> np.ndarray:
        keys = key if isinstance(key, tuple) else (key,)
        count = len(self.dims)
        front = [*keys[:count], *[slice(None)] * (count - len(keys))]
        where = tuple(slice(k, k + 1 or None) if isinstance(k, int | np.integer) else k for k in front)
        block = self._block(where)
        picked = tuple(0 if isinstance(k, int | np.integer) else slice(None) for k in front)
        return block[(*picked, *keys[count:])]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        del copy
        return np.asarray(self[()], dtype=dtype)

    def _block(self, where: tuple[slice, ...]) -> np.ndarray:
        low, high = int(self.bands.min()), int(self.bands.max()) + 1
        named = dict(zip(self.dims, where, strict=True)) | {WAVELENGTH: slice(low, high)}
        read = self.stored.read(named)
        wanted = (*self.dims, WAVELENGTH, *([] if self.angles is None else [ANGLE]))
        axes = self.stored.axes
        read = np.transpose(read, [axes.index(axis) for axis in wanted if axis in axes])
        if WAVELENGTH in axes:
            steps = np.diff(self.bands)
            pick: Any = self.bands - low
            if np.all(steps == 1):
                pick = slice(None)
            read = read[(*[slice(None)] * sum(axis in axes for axis in self.dims), pick)]
        if self.angles is not None and ANGLE in axes:
            read = read[..., self.angles]
        read = read.reshape(_expanded(read.shape, wanted, axes))
        for convert in self.conversions:
            read = convert(read, where, self.dims)
        lengths = [len(range(*s.indices(n))) for s, n in zip(where, self.sizes, strict=True)]
        return np.broadcast_to(read, (*lengths, *self.shape[len(self.dims) :]))


def _expanded(shape: tuple[int, ...], wanted: Sequence[str], axes: Sequence[str]) -> list[int]:
    """The shape with an axis of length one for each axis that the file lacks."""
    sizes = iter(shape)
    return [next(sizes) if axis in axes else 1 for axis in wanted]


@dataclass(frozen=True, eq=False)
class PartOfArray:
    """Some of the pixels of an array: every so many, or a rectangle, read by slicing."""

    array: Any
    part: tuple[slice, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Pixels along each axis, bands and perhaps angles."""
        whole = self.array.shape
        front = [len(range(*s.indices(n))) for s, n in zip(self.part, whole, strict=False)]
        return (*front, *whole[len(self.part) :])

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values that are read."""
        return np.dtype(self.array.dtype)

    def __getitem__(self, key: Any) -> Any:
        keys = key if isinstance(key, tuple) else (key,)
        count = len(self.part)
        front = [*keys[:count], *[slice(None)] * (count - len(keys))]
        inner = []
        for k, s, n in zip(front, self.part, self.array.shape, strict=False):
            chosen = range(n)[s][k]
            inner.append(chosen if isinstance(chosen, int) else _as_slice(chosen))
        return self.array[(*inner, *keys[count:])]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        del copy
        return np.asarray(self[()], dtype=dtype)


def _as_slice(numbers: range) -> slice:
    """The slice that picks these numbers, which increase."""
    return slice(numbers.start, numbers.stop if len(numbers) else numbers.start, numbers.step)


@dataclass(frozen=True, eq=False)
class ShareOfSignal:
    """Standard deviations that are a share of the values, at least those of a hundredth of full scale."""

    values: Any
    share: float

    least = 0.01
    """Below this signal the noise of the dark dominates, and a share of it would be too small."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values."""
        return tuple(self.values.shape)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values that are read."""
        return np.dtype(float)

    def __getitem__(self, key: Any) -> np.ndarray:
        return self.share * np.maximum(np.abs(np.asarray(self.values[key], dtype=float)), self.least)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        del copy
        return np.asarray(self[()], dtype=dtype)
