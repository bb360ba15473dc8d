"""Blocks of pixels: they cover a cube once, are not too large, and follow the chunks of the input."""

import math

import dask.array
import numpy as np
import pytest

from pellicle.data.cube import Cube
from pellicle.mapping.store import BYTES, PIXELS, Blocks, blocks_of


def lazy(*shape, chunks=None):
    """A cube that takes no memory."""
    array = np.broadcast_to(0.5, shape) if chunks is None else dask.array.zeros(shape, chunks=chunks)
    dims = ("time", "y", "x")[4 - len(shape) :]
    return Cube({"values": array}, np.linspace(400, 700, shape[-1]), dims=dims)


@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (45, 32), (3, 7, 5)])
def test_blocks_cover_every_pixel_once(shape):
    blocks = Blocks(shape, (2, 3, 2)[-len(shape) :])
    seen = np.zeros(shape, int)
    for place in blocks:
        seen[blocks.where(place)] += 1
        assert blocks.count(place) == seen[blocks.where(place)].size
    assert (seen == 1).all()


@pytest.mark.parametrize("shape", [(512, 512, 100), (4000, 3000, 100), (600, 20, 4000), (50, 64, 64, 300)])
def test_a_block_is_bounded_and_not_small(shape):
    cube = lazy(*shape)
    pixels = math.prod(blocks_of(cube).size)
    assert pixels <= PIXELS
    assert 8 * pixels * cube.points <= BYTES
    assert 8 * pixels > min(PIXELS, BYTES / 8 / cube.points)


def test_blocks_are_whole_chunks_of_the_input():
    size = blocks_of(lazy(2000, 1500, 100, chunks=(48, 40, 100))).size
    assert [n % chunk for n, chunk in zip(size, (48, 40), strict=True)] == [0, 0]
    assert min(size) > 48


@pytest.mark.parametrize(
    ("shape", "chunks", "size"),
    [
        ((5000, 2048, 100), (1, 2048, 100), (8, 2048)),  # rows of a line scanner stay whole
        ((1024, 1024, 100), (1024, 1024, 1), (128, 128)),  # a chunk that is too large is divided
        ((1000, 8, 16, 50), None, (128, 8, 16)),  # several frames of a small image are one block
    ],
)
def test_sizes_of_blocks(shape, chunks, size):
    assert blocks_of(lazy(*shape, chunks=chunks)).size == size
