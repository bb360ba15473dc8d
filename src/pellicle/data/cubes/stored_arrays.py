"""Arrays that stay in their file until a block of them is read.

They hold a path and no open file, so that copies sent to other processes are small. A memory map is opened
for each block and closed after it: pages of a map that stays open count as memory of the process.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pellicle.errors import DataError

WAVELENGTH, ANGLE = "wavelength", "angle"
"""Names of the axes that are no axes of pixels."""


@dataclass(frozen=True, eq=False)
class Stored:
    """An array, or anything with `shape` and `dtype` that is read by slicing, with the names of its axes."""

    data: Any
    axes: tuple[str, ...]

    def size(self, axis: str) -> int:
        """Length of an axis."""
        return int(self.data.shape[self.axes.index(axis)])

    def read(self, where: Mapping[str, slice]) -> np.ndarray:
        """Read a block; axes that `where` does not name are read whole."""
        part = self.data[tuple(where.get(axis, slice(None)) for axis in self.axes)]
        if hasattr(part, "compute"):  # dask: inside a worker, another scheduler would wait for itself
            part = part.compute(scheduler="synchronous")
        return np.asarray(part)


@dataclass(frozen=True)
class MappedFile:
    """Numbers in a file without compression, in the order of C or of Fortran."""

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

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)


@dataclass(frozen=True, eq=False)
class XarrayVariable:
    """A variable of xarray, in memory, in a file or computed by dask."""

    variable: Any
    dtype: np.dtype[Any] = field(init=False)
    shape: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "dtype", self.variable.dtype)
        object.__setattr__(self, "shape", tuple(self.variable.shape))

    @property
    def graph(self) -> str:
        """The name of a dask array, which depends on how it is computed; empty for others."""
        return "" if self.variable.chunks is None else str(self.variable.data.name)

    def __getitem__(self, where: Any) -> Any:
        part = self.variable[where]
        return part.data if part.chunks is not None else part.values


@dataclass(frozen=True)
class TiffPages:
    """Pages of one size in a TIFF, compressed or scattered over the file: (*leading, *shape of a page).

    Only the strips or tiles of the rows that are asked for are decoded.
    """

    path: str
    pages: tuple[int, ...]
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    leading: int

    def __getitem__(self, where: tuple[slice, ...]) -> np.ndarray:
        import tifffile

        front, rest = where[: self.leading], where[self.leading :]
        numbers = np.reshape(self.pages, self.shape[: self.leading])[front]
        try:
            with tifffile.TiffFile(self.path) as file:
                read = [_page(file.pages[int(i)], rest) for i in numbers.reshape(-1)]
        except Exception as error:  # decoders raise errors of every kind on damaged files
            reason = str(error.args[0] if error.args else error).split("\n")[0]
            raise DataError(
                f"{self.path}: cannot be decoded ({reason}); save it without compression"
            ) from None
        return np.stack(read).reshape(*numbers.shape, *read[0].shape)


def _page(page: Any, where: tuple[slice, ...]) -> np.ndarray:
    """A part of one page: rows first."""
    key = page.keyframe
    rows = range(*where[0].indices(key.shape[0]))
    if not rows or (key.planarconfig is not None and int(key.planarconfig) == 2):  # colours apart
        return page.asarray()[where]
    height, across = min(key.rowsperstrip, key.imagelength), 1
    if key.is_tiled:
        height, across = key.tilelength, -(-key.imagewidth // key.tilewidth)
    first, last = rows[0] // height, rows[-1] // height
    whole = np.zeros(((last + 1 - first) * height, *key.shape[1:]), key.dtype)
    for part, place, size in _segments(page, range(first * across, (last + 1) * across)):
        if part is None:
            continue  # a segment without data is empty
        _, _, row, left, _ = place
        top = row - first * height
        across_part = min(size[2], key.imagewidth - left)
        shape = (size[1], across_part, *key.shape[2:])
        whole[top : top + size[1], left : left + across_part] = part[0, :, :across_part].reshape(shape)
    start = rows[0] - first * height
    return whole[(slice(start, start + rows[-1] - rows[0] + 1, rows.step), *where[1:])]


def _segments(page: Any, numbers: range) -> Iterator[Any]:
    offsets = [page.dataoffsets[i] for i in numbers]
    counts = [page.databytecounts[i] for i in numbers]
    for data, i in page.parent.filehandle.read_segments(offsets, counts, indices=list(numbers)):
        yield page.keyframe.decode(data, i, jpegtables=page.jpegtables)
