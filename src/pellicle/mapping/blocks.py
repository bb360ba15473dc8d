"""Blocks of pixels: the parts of a cube that are read, fitted and stored one at a time."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from pellicle.data.cube import Cube

BYTES = 64e6
"""Size of the measured values of a block in float64, at most: with the arrays of a fit a process then takes
less than 1 GB."""
PIXELS = 2**14
"""Pixels of a block, at most: a second of fits, which is what a killed process loses."""

Where = tuple[slice, ...]
"""A block of pixels: one slice for each axis of pixels."""


@dataclass(frozen=True)
class Blocks:
    """A grid of blocks over the pixels of a cube: `shape` of the pixels and `size` of a block, per axis."""

    shape: tuple[int, ...]
    size: tuple[int, ...]

    @property
    def grid(self) -> tuple[int, ...]:
        """Number of blocks along each axis."""
        return tuple(math.ceil(n / size) for n, size in zip(self.shape, self.size, strict=True))

    def __iter__(self) -> Iterator[tuple[int, ...]]:
        """Places of all blocks in the grid, row by row."""
        return product(*map(range, self.grid))

    def where(self, place: tuple[int, ...]) -> Where:
        """The pixels of the block at a place in the grid."""
        parts = zip(place, self.size, self.shape, strict=True)
        return tuple(slice(i * size, min((i + 1) * size, n)) for i, size, n in parts)

    def count(self, place: tuple[int, ...]) -> int:
        """Number of pixels of a block."""
        return math.prod(part.stop - part.start for part in self.where(place))


def blocks_of(cube: Cube) -> Blocks:
    """Choose blocks of at most `BYTES` and `PIXELS`, whole chunks of the input where it has chunks.

    A block grows by doubling along the shorter of the last two axes (y and x), and along earlier ones (time)
    when these are covered. A chunk of the input that is larger than a block is divided.
    """
    arrays = sum(len(array.shape) > 1 for array in cube.arrays.values())
    most = max(1, min(PIXELS, int(BYTES / (8 * cube.points * arrays))))
    size = [min(chunk, n) for chunk, n in zip(_chunks(cube), cube.shape, strict=True)]
    while math.prod(size) > most:
        longest = size.index(max(size))
        size[longest] = math.ceil(size[longest] / 2)
    while True:
        short = [axis for axis, n in enumerate(cube.shape) if size[axis] < n]
        image = [axis for axis in short if axis >= len(size) - 2]
        if not short:
            break
        axis = min(image, key=size.__getitem__) if image else short[-1]
        longer = [*size]
        longer[axis] = min(2 * size[axis], cube.shape[axis])
        if math.prod(longer) > most:
            break
        size = longer
    return Blocks(cube.shape, tuple(size))


def _chunks(cube: Cube) -> tuple[int, ...]:
    """Pixels along each axis of a chunk of the input, 1 where it has none."""
    chunks = getattr(cube.arrays["values"], "chunks", None) or ()
    # of a dask array, the sizes of all chunks along an axis
    sizes = [max(chunk) if isinstance(chunk, tuple) else int(chunk) for chunk in chunks]
    return tuple(sizes[: len(cube.dims)]) or (1,) * len(cube.dims)
