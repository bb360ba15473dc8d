"""A cube as its file has it, and the arrays in which its numbers stay until a block of them is read.

Stored arrays hold a path and no open file, so that copies sent to other processes are small.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError

WAVELENGTH, ANGLE = "wavelength", "angle"
"""Names of the axes that are no axes of pixels."""
COUNTS = "counts"
"""The signal unit of raw counts of a camera."""


@dataclass(frozen=True, eq=False)
class Stored:
    """An array with the names of its axes: of NumPy, zarr, dask, a variable of xarray, or a `MappedFile`."""

    data: Any
    axes: tuple[str, ...]

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each axis."""
        return dict(zip(self.axes, map(int, self.data.shape), strict=True))

    def read(self, where: Mapping[str, slice] | None = None) -> np.ndarray:
        """Read a block; axes that `where` does not name are read whole."""
        part = self.data[tuple((where or {}).get(axis, slice(None)) for axis in self.axes)]
        if getattr(part, "chunks", None) is not None:
            # dask: in a worker, its scheduler would wait for itself
            part = part.compute(scheduler="synchronous")
        return np.asarray(part)

    def block(self, pixels: Mapping[str, range], bands: np.ndarray, more: Sequence[str] = ()) -> np.ndarray:
        """Read a block (*pixels, bands, *more), with an axis of length one for each that the array lacks."""
        low = int(bands.min())
        where = {a: slice(n.start, n.stop if n.stop >= 0 else None, n.step) for a, n in pixels.items()}
        values = self.read(where | {WAVELENGTH: slice(low, int(bands.max()) + 1)})
        order = [*pixels, WAVELENGTH, *more]
        values = np.transpose(values, [self.axes.index(axis) for axis in order if axis in self.axes])
        values = np.expand_dims(values, tuple(i for i, axis in enumerate(order) if axis not in self.axes))
        if WAVELENGTH in self.axes and np.any(np.diff(bands) != 1):
            values = np.take(values, bands - low, axis=len(pixels))
        return values


@dataclass(frozen=True)
class MappedFile:
    """Numbers in a file without compression, in the order of C or of Fortran.

    A memory map is opened for each block and closed after it: pages of a map that stays open count as memory
    of the process.
    """

    path: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    offset: int = 0
    order: str = "C"

    def __getitem__(self, where: Any) -> np.ndarray:
        try:
            order: Any = self.order
            mapped = np.memmap(self.path, self.dtype, "r", self.offset, self.shape, order)
        except (OSError, ValueError) as error:
            raise DataError(f"{self.path}: cannot be read ({error}); is it still complete?") from None
        return np.array(mapped[where])


@dataclass(frozen=True, eq=False)
class RawCube:
    """Content of a file of spectra of many pixels, before units, bands and frames of a camera are applied.

    **Arguments:**

    - `path` for messages; `files` on disk, whose content the fingerprint covers.
    - `arrays`: "values", and as far as present "delta", "sigma", "delta_sigma".
    - `dims`: axes of pixels in the order of the result.
    - `wavelength` of the bands as written, None where the file has none, and its `unit` as written.
    - `signal`, `polarisation`: as the file states them, else None.
    - `signal_unit`: "fraction", "percent", "absorbance" or "counts" where the file states it.
    - `calibrated`: False for an intensity on an arbitrary scale.
    - `divisor`: number by which stored values are divided, as `reflectance scale factor` of ENVI.
    - `missing`: stored value that marks what was not measured.
    - `good`: False for a band that the file marks as bad.
    - `angle` of incidence in degrees, along the axis "angle" or a single one.
    - `coords`, `units`: coordinates of pixels and their units.
    - `others`: further variables by name, which `noise` or `mask` may name.
    - `notes`: sentences on how the file was read.
    """

    path: str
    arrays: Mapping[str, Stored]
    dims: tuple[str, ...]
    wavelength: np.ndarray
    unit: str | None = None
    files: tuple[Path, ...] = ()
    signal: str | None = None
    polarisation: str | None = None
    signal_unit: str | None = None
    calibrated: bool = True
    divisor: float = 1.0
    missing: float | None = None
    good: np.ndarray | None = None
    angle: np.ndarray | None = None
    coords: Mapping[str, np.ndarray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    others: Mapping[str, Stored] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def pixels(self) -> dict[str, range]:
        """Numbers of the pixels along each of the `dims`."""
        sizes = self.arrays["values"].sizes
        return {axis: range(sizes[axis]) for axis in self.dims}

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of pixels along each of the `dims`."""
        return tuple(map(len, self.pixels.values()))


@dataclass(frozen=True)
class Asked:
    """The caller's statements about the content of a file, as far as readers need them.

    `wavelength` and its `unit` of the bands, None where the file has them; `variable` to read; `signal`.
    """

    wavelength: np.ndarray | None = None
    unit: str | None = None
    variable: str | None = None
    signal: str | None = None


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
        points = (self.bands.size,) if self.angles is None else (self.bands.size, self.angles)
        return (*map(len, self.pixels.values()), *points)

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
        in_order = self.stored.axes[: len(self.pixels)] == tuple(self.pixels)
        whole = in_order and self.shape == tuple(self.stored.data.shape)
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
        return np.asarray(self.part(slices))[(*kept, *keys[rank:])]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        del copy
        block = self.stored.block(self.pixels, self.bands, () if self.angles is None else (ANGLE,))
        for step in self.steps:
            block = step(block, self.pixels, self.bands)
        return np.asarray(np.broadcast_to(block.astype(float, copy=False), self.shape), dtype=dtype)


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

    def __call__(self, block: np.ndarray, *_: Any) -> np.ndarray:
        """Return the converted block."""
        values = np.array(block, dtype=float)
        if self.missing is not None:
            values[block == np.asarray(self.missing).astype(block.dtype)] = np.nan
        values[np.isinf(values)] = np.nan
        values *= self.factor
        return 10.0 ** -np.clip(values, -300.0, None) if self.absorbance else values


def share_of(block: np.ndarray, *_: Any, share: float) -> np.ndarray:
    """Step from values to errors that are a share of them, at least of a hundredth of full scale.

    Below that signal the noise of the dark dominates, and a share of it would be too small.
    """
    return share * np.maximum(np.abs(block), 0.01)


def divided(block: np.ndarray, *_: Any, gain: np.ndarray) -> np.ndarray:
    """Step that divides by a gain (bands,) or (bands, 1)."""
    return block / gain


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
        unit, full = signal_unit(str(asked)), np.nan
        with suppress(ValueError):
            full = float(asked)
        if unit is None and not 0 < full < np.inf:
            raise UsageError(
                f"`signal_unit` must be one of {', '.join(SIGNAL_UNITS)}, or the number that stands for 1, "
                f"not {asked!r}"
            )
        if 0 < full < np.inf and full != 1:
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
    assumed = f"fraction{'' if unit else ', assumed'}" if calibrated else "arbitrary (uncalibrated)"
    return Scale(factor, raw.missing), f"signal unit: {assumed}"
