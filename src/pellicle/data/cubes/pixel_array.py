"""Measured values of a cube as one lazy array: read by slicing, and converted block by block."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import ANGLE, COUNTS, WAVELENGTH, RawCube, Stored
from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError

Step = Callable[[np.ndarray, Mapping[str, range], np.ndarray], np.ndarray]
"""Conversion of a block (*pixels, bands[, angles]), given the numbers of its pixels and of its bands."""


@dataclass(frozen=True, eq=False)
class PixelArray:
    """Values (*pixels, bands) or (*pixels, bands, angles), float64, read by slicing.

    `stored` has the axes of the file in any order, and may lack some, along which its values repeat. `pixels`
    are the numbers of those that are used along each axis, `bands` (bands,) those of the bands in their
    order; `angles` is None without such an axis. `steps` convert a block, one after the other.

    Slices reach the file before any conversion, so that a preview of every so many pixels of a large file
    reads no others. (dask reads whole chunks below a transposition or a conversion.)
    """

    stored: Stored
    pixels: Mapping[str, range]
    bands: np.ndarray
    angles: int | None = None
    steps: tuple[Step, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Pixels along each axis, bands and perhaps angles."""
        return (*map(len, self.pixels.values()), *self._points)

    @property
    def _points(self) -> tuple[int, ...]:
        return (self.bands.size, *([] if self.angles is None else [self.angles]))

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values that are read."""
        return np.dtype(float)

    @property
    def chunks(self) -> Any:
        """Chunks of the stored array, where it has some and is used whole in its order."""
        whole = self.stored.axes[: len(self.pixels)] == tuple(self.pixels)
        whole = whole and self.shape == tuple(self.stored.data.shape)
        return getattr(self.stored.data, "chunks", None) if whole else None

    def part(self, where: tuple[slice, ...]) -> PixelArray:
        """The array of some of the pixels, a slice along each axis of them."""
        chosen = zip(self.pixels.items(), where, strict=True)
        return replace(self, pixels={axis: numbers[part] for (axis, numbers), part in chosen})

    def then(self, *steps: Step) -> PixelArray:
        """The array with further conversions."""
        return replace(self, steps=(*self.steps, *steps))

    def __getitem__(self, key: Any) -> np.ndarray:
        keys = key if isinstance(key, tuple) else (key,)
        rank = len(self.pixels)
        front = [*keys[:rank], *[slice(None)] * (rank - len(keys))]
        slices = tuple(k if isinstance(k, slice) else slice(k, k + 1 or None) for k in front)
        kept = tuple(slice(None) if isinstance(k, slice) else 0 for k in front)
        return self.part(slices)._read()[(*kept, *keys[rank:])]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        del copy
        return np.asarray(self._read(), dtype=dtype)

    def _read(self) -> np.ndarray:
        block = self.stored.block(self.pixels, self.bands, () if self.angles is None else (ANGLE,))
        for step in self.steps:
            block = step(block, self.pixels, self.bands)
        return np.broadcast_to(block.astype(float, copy=False), self.shape)


def lazy(array: Any, dims: tuple[str, ...]) -> PixelArray:
    """An array (*pixels, bands[, angles]) of any kind as a `PixelArray`."""
    if isinstance(array, PixelArray):
        return array
    sizes = array.shape
    axes = (*dims, WAVELENGTH, ANGLE)[: len(sizes)]
    pixels = {axis: range(n) for axis, n in zip(dims, sizes, strict=False)}
    angles = sizes[len(dims) + 1] if len(sizes) > len(dims) + 1 else None
    return PixelArray(Stored(array, axes), pixels, np.arange(sizes[len(dims)]), angles)


@dataclass(frozen=True)
class Scale:
    """Step from stored numbers to fractions or degrees: value · factor, or 10⁻ᵛᵃˡᵘᵉ of an absorbance.

    `missing` is the stored value of what was not measured, which becomes NaN, as infinite values do.
    """

    factor: float = 1.0
    missing: float | None = None
    absorbance: bool = False

    def __call__(self, block: np.ndarray, pixels: Mapping[str, range], bands: np.ndarray) -> np.ndarray:
        """Return the converted block."""
        del pixels, bands
        values = np.array(block, dtype=float)
        if self.missing is not None:
            values[block == np.asarray(self.missing).astype(block.dtype)] = np.nan
        values[np.isinf(values)] = np.nan
        values *= self.factor
        return 10.0 ** -np.clip(values, -300.0, None) if self.absorbance else values


@dataclass(frozen=True)
class Share:
    """Step from values to errors that are a share of them, at least of a hundredth of full scale.

    Below that signal the noise of the dark dominates, and a share of it would be too small.
    """

    share: float

    def __call__(self, block: np.ndarray, pixels: Mapping[str, range], bands: np.ndarray) -> np.ndarray:
        """Return the standard deviations."""
        del pixels, bands
        return self.share * np.maximum(np.abs(block), 0.01)


@dataclass(frozen=True, eq=False)
class Gain:
    """Step that divides by a gain (bands,) or (bands, 1)."""

    gain: np.ndarray

    def __call__(self, block: np.ndarray, pixels: Mapping[str, range], bands: np.ndarray) -> np.ndarray:
        """Return the divided block."""
        del pixels, bands
        return block / self.gain


def value_scale(
    raw: RawCube, signal: str, asked: str | float | None, *, calibrated: bool, framed: bool
) -> tuple[Scale, str]:
    """Return the conversion of the stored numbers, and a note on their unit.

    `asked` is the unit that the caller states, which is taken before that of the file; `framed` marks counts
    that frames of a camera convert. Raises DataError for counts without a scale, UsageError for an unknown
    unit.
    """
    factor = 1.0 / raw.divisor
    if framed or signal == "psi-delta":
        if asked is not None:
            reason = "frames of a camera give the scale" if framed else "psi and delta are in degrees"
            raise UsageError(f"{raw.path}: {reason}; leave `signal_unit` out")
        return Scale(factor, raw.missing), ""
    unit = raw.signal_unit
    if asked is not None:
        unit, full = signal_unit(str(asked)), _number(asked)
        if unit is None and full is None:
            raise UsageError(
                f"`signal_unit` must be one of {', '.join(SIGNAL_UNITS)}, or the number that stands for 1, "
                f"not {asked!r}"
            )
        if full is not None and full != 1:
            return Scale(factor / full, raw.missing), f"values divided by {full:g}, as given"
    stored = np.dtype(raw.arrays["values"].data.dtype)
    whole = stored.kind in "iu" and raw.divisor == 1.0 and unit is None
    if calibrated and (unit == COUNTS or whole):
        raise DataError(
            f"{raw.path}: has counts of a camera ({stored.name}): give `white_frame` and `dark_frame`, or, "
            "for scaled reflectances, percent or the number that stands for 1 as `signal_unit`"
        )
    if unit == "percent":
        return Scale(factor / 100, raw.missing), "signal unit: percent"
    if unit == "absorbance":
        return Scale(factor, raw.missing, True), f"signal unit: absorbance A, converted to {signal} = 10^-A"
    if not calibrated:
        return Scale(factor, raw.missing), "signal unit: arbitrary (uncalibrated)"
    return Scale(factor, raw.missing), f"signal unit: fraction{'' if unit else ', assumed'}"


def _number(asked: str | float) -> float | None:
    """A number above zero, None for anything else."""
    try:
        value = float(asked)
    except ValueError:
        return None
    return value if 0 < value < np.inf else None
