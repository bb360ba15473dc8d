"""Minima of the pixels of a map's dataset: reading some of them, and exchanging answers with other minima."""

from __future__ import annotations

from typing import Any

import numpy as np

_READ = 2_000_000
"""Numbers of a variable that are read at a time."""


def minima_at(dataset: Any, name: str, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thickness and Δχ² (pixels, orders) of the minima of some pixels, in increasing flat order."""
    thickness, delta = (_read(dataset[key], pixels) for key in (f"order_{name}", "order_delta_chi2"))
    return thickness, np.where(np.isfinite(thickness) & ~np.isnan(delta), delta, np.inf)


def _read(array: Any, pixels: np.ndarray) -> np.ndarray:
    """Rows (pixels, orders) of an array (*map, orders), a slab at a time: it may be larger than memory."""
    rows = int(np.prod(array.shape[1:-1], dtype=int))
    slab = max(1, _READ // max(rows * array.shape[-1], 1))
    read = np.empty((len(pixels), array.shape[-1]))
    for first in range(0, array.shape[0], slab):
        low, high = np.searchsorted(pixels, [first * rows, (first + slab) * rows])
        if high > low:
            part = np.asarray(array[first : first + slab], float).reshape(-1, array.shape[-1])
            read[low:high] = part[pixels[low:high] - first * rows]
    return read


def exchanged(dataset: Any, names: list[str], pixels: np.ndarray, order: np.ndarray) -> Any:
    """The dataset with the chosen minimum of each pixel as its answer, and the former answer as its rival."""
    made = dataset.copy()
    kept = dataset["order_delta_chi2"]
    orders = kept.shape[-1]
    rank = np.tile(np.arange(orders), (len(pixels), 1))
    rank = np.concatenate([order[:, None], rank[rank != order[:, None]].reshape(-1, orders - 1)], axis=1)
    swap, line = order > 0, np.arange(len(pixels))[:, None]

    where = np.unravel_index(pixels[swap], dataset["status"].shape)

    def put(key: str, rows: Any) -> None:
        """Replace the rows of the pixels whose minimum changes."""
        made[key] = dataset[key].copy(data=_replaced(dataset[key].data, where, np.asarray(rows)[swap]))

    delta = _read(kept, pixels)[line, rank]
    put("order_delta_chi2", delta - delta[:, :1])
    if "rival_delta_chi2" in dataset:
        put("rival_delta_chi2", delta[:, 1] - delta[:, 0])
    for key in dataset.data_vars:
        name = str(key)
        if f"{name}_stderr_noise" not in dataset:
            continue
        if name in names:
            minima = _read(dataset[f"order_{name}"], pixels)[line, rank]
            put(f"order_{name}", minima)
            put(name, minima[:, 0])
            if f"rival_{name}" in dataset:
                put(f"rival_{name}", minima[:, 1])
        else:
            for other in (name, f"{name}_stderr", f"{name}_stderr_noise"):
                put(other, np.full(len(pixels), np.nan))
    return made


def _replaced(array: Any, where: tuple[np.ndarray, ...], rows: np.ndarray) -> Any:
    """An array with other rows at some pixels; a dask array is changed chunk by chunk when it is computed."""
    if hasattr(array, "map_blocks"):
        return array.map_blocks(_in_chunk, where=where, rows=rows, dtype=array.dtype)
    whole = np.array(array)
    whole[where] = rows
    return whole


def _in_chunk(
    chunk: np.ndarray, *, where: tuple[np.ndarray, ...], rows: np.ndarray, block_info: Any = None
) -> np.ndarray:
    """A chunk of `_replaced`, which dask places by `block_info`."""
    if not block_info or not chunk.size:
        return chunk
    ends = np.array(block_info[0]["array-location"])[: len(where)]
    at = np.stack(where, axis=-1)
    inside = np.all((at >= ends[:, 0]) & (at < ends[:, 1]), axis=1)
    changed = chunk.copy()
    changed[tuple((at[inside] - ends[:, 0]).T)] = rows[inside]
    return changed
