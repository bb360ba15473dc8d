"""A cube as its file has it, and the arrays in which its numbers stay until a block of them is read.

Stored arrays hold a path and no open file, so that copies sent to other processes are small.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.errors import DataError

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
        if (
            getattr(part, "chunks", None) is not None
        ):  # dask: in a worker, its scheduler would wait for itself
            part = part.compute(scheduler="synchronous")
        return np.asarray(part)

    def block(self, pixels: Mapping[str, range], bands: np.ndarray, more: Sequence[str] = ()) -> np.ndarray:
        """Read a block (*pixels, bands, *more), with an axis of length one for each that the array lacks."""
        low = int(bands.min())
        where = {axis: _slice(numbers) for axis, numbers in pixels.items()}
        values = self.read(where | {WAVELENGTH: slice(low, int(bands.max()) + 1)})
        order = [*pixels, WAVELENGTH, *more]
        values = np.transpose(values, [self.axes.index(axis) for axis in order if axis in self.axes])
        values = np.expand_dims(values, tuple(i for i, axis in enumerate(order) if axis not in self.axes))
        if WAVELENGTH in self.axes and np.any(np.diff(bands) != 1):
            values = np.take(values, bands - low, axis=len(pixels))
        return values


def _slice(numbers: range) -> slice:
    """The slice that picks these numbers."""
    return slice(numbers.start, numbers.stop if numbers.stop >= 0 else None, numbers.step)


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
