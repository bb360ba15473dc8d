"""Spectra of two detectors that overlap: their join, and the step between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from pellicle.data.repeated_sweeps import one_way
from pellicle.data.spectrum import FEWEST_POINTS
from pellicle.data.spectrum_rows import Axis, Rows
from pellicle.errors import DataError

_MOST_STEP = 0.25
"""Step, as a share of the signal, beyond which the two parts are no measurements of one sample."""


def detectors(wavelength: Float[np.ndarray, " rows"]) -> tuple[np.ndarray, np.ndarray] | None:
    """Find two detectors in the rows of a file: the rows of each, in rising order, or None.

    Their ranges overlap by 5 points or more, less than half of all, and each goes beyond the
    other. The file has one detector after the other, or pairs of equal wavelengths where they overlap, that
    of the first detector first.
    """
    steps = np.diff(wavelength)
    rising = np.sum(np.sign(steps)) >= 0
    back = np.flatnonzero(steps <= 0 if rising else steps >= 0)
    rows = np.arange(wavelength.size)
    if back.size == 1:
        parts = rows[: back[0] + 1], rows[back[0] + 1 :]
    elif back.size >= FEWEST_POINTS and np.all(np.diff(back) == 2) and not steps[back].any():
        second = back + 1
        after = rows > second[-1]
        parts = rows[~after & ~np.isin(rows, second)], np.concatenate([second, rows[after]])
    else:
        return None
    if min(map(len, parts)) < 2 or not all(one_way(wavelength[part]) for part in parts):
        return None
    low, high = sorted((part[np.argsort(wavelength[part])] for part in parts), key=lambda p: wavelength[p[0]])
    (start, end), (first, last) = wavelength[low[[0, -1]]], wavelength[high[[0, -1]]]
    shared = [np.sum(wavelength[low] >= first), np.sum(wavelength[high] <= end)]
    partly = min(shared) >= FEWEST_POINTS and 2 * shared[0] < low.size + high.size - shared[1]
    return (low, high) if start < first and end < last and partly else None


def joined(rows: Rows, low: Int[np.ndarray, " low"], high: Int[np.ndarray, " high"]) -> Rows:
    """Join the rows of two detectors, with a note on the step between them.

    Both are scaled to the mean of their levels where they overlap, and averaged there at the wavelengths of
    the lower one. `rows` have `values` and perhaps `sigma`. Raises DataError for a step above 25 %.
    """
    nm, values = rows.axis.wavelength, rows.columns["values"]
    begin, end = nm[high[0]], nm[low[-1]]
    both = low[nm[low] >= begin]
    other = np.interp(nm[both], nm[high], values[high])
    ratio = float(np.sum(other) / np.sum(values[both])) if np.sum(values[both]) > 0 else np.inf
    place = f"from {begin:g} to {end:g} nm"
    if not abs(ratio - 1) < _MOST_STEP:
        raise DataError(
            f"{rows.table.path}: has two parts that overlap {place}, the second {ratio:.3g} times "
            "the first: no step of two detectors; keep one of them with `range`, or in the file"
        )
    factors = (1 + ratio) / 2, (1 + 1 / ratio) / 2
    beyond = high[nm[high] > end]
    inside = np.isin(low, both)
    columns = {}
    for name, x in rows.columns.items():
        first, second = factors[0] * x[low], factors[1] * x[beyond]
        pair = first[inside], factors[1] * np.interp(nm[both], nm[high], x[high])
        first[inside] = np.hypot(*pair) / 2 if name == "sigma" else np.mean(pair, axis=0)
        columns[name] = np.concatenate([first, second])
    kept = np.concatenate([low, beyond])
    note = (
        f"two detectors overlap {place}, averaged there: that of longer wavelengths "
        f"reads {100 * (ratio - 1):+.2g} %; both are scaled to their mean, which leaves the level open "
        f"by {50 * abs(ratio - 1):.2g} %: free it with "
        '`scale="free"`'
    )
    axis = Axis(nm[kept])
    return replace(
        rows, positions=rows.positions[kept], axis=axis, columns=columns, notes=(*rows.notes, note)
    )
