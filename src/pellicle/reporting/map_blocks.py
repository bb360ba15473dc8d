"""Blocks of pixels of a large map as the points of an image, and limits of its colours."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.reporting.map_axes import MapAxes

MOST_POINTS = 800
"""Most points of an image in each direction: more than a printed panel shows."""
SLAB = 2**22
"""Most pixels that are read at once."""


def block(axes: MapAxes) -> int:
    """Side of the blocks of pixels that are one point of an image."""
    return int(np.ceil(max(axes.shape[-2:]) / MOST_POINTS)) if axes.kind == "image" else 1


def block_codes(codes: np.ndarray, side: int) -> np.ndarray:
    """Most frequent status of each block of an image."""
    if side == 1:
        return codes
    found, most = None, None
    for code in np.unique(codes):
        count = _sums((codes == code).astype(np.int32), side)
        if found is None or most is None:
            found, most = np.full(count.shape, code, codes.dtype), count
            continue
        found[count > most] = code
        most = np.maximum(most, count)
    assert found is not None
    return found


def block_means(array: Any, used: np.ndarray, side: int) -> np.ndarray:
    """Means of an image over the used pixels of each block, NaN where there are none.

    The array is read in slabs of whole rows of blocks: it may be larger than memory.
    """
    rows = max(SLAB // max(used.shape[1] * side, 1), 1) * side
    means = []
    for start in range(0, used.shape[0], rows):
        values = np.asarray(array[start : start + rows], dtype=float)
        own = used[start : start + rows] & np.isfinite(values)
        count = _sums(own.astype(np.int32), side)
        total = _sums(np.where(own, values, 0.0), side)
        means.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    return np.concatenate(means)


def _sums(array: np.ndarray, side: int) -> np.ndarray:
    """Sums over blocks; those at the end may be smaller."""
    for along in (0, 1):
        array = np.add.reduceat(array, np.arange(0, array.shape[along], side), axis=along)
    return array


def evenly(array: np.ndarray, axes: MapAxes, side: int) -> np.ndarray:
    """Repeat rows and columns of an image whose coordinates are uneven, so that all points have one size."""
    assert axes.y is not None
    for along, axis in enumerate((axes.y, axes.x)):
        if axis.is_even:
            continue
        edges = np.append(axis.edges()[:-1:side], axis.edges()[-1])
        points = np.linspace(edges[0], edges[-1], 2 * MOST_POINTS + 1)[1::2]
        flip = edges[0] > edges[-1]
        index = np.searchsorted(edges[::-1] if flip else edges, np.sort(points) if flip else points) - 1
        index = (len(edges) - 2 - index)[::-1] if flip else index
        array = np.take(array, np.clip(index, 0, array.shape[along] - 1), axis=along)
    return array


def limits(values: np.ndarray) -> tuple[float, float, str]:
    """Limits of the colours that outliers do not set, and the ends at which a colour bar is extended."""
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0, "neither"
    low, high = np.percentile(known, [1, 99])
    least, largest = known.min(), known.max()
    room = 0.25 * (high - low)
    low, high = (least if least >= low - room else low), (largest if largest <= high + room else high)
    if high - low <= 1e-9 * max(abs(high), abs(low), 1e-300):
        middle = (high + low) / 2
        half = 0.01 * abs(middle) or 0.5
        return middle - half, middle + half, "neither"
    ends = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
    return float(low), float(high), ends[bool(least < low), bool(largest > high)]
