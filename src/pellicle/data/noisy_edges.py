"""Edges of a spectrum where the detector has no light: the range without them.

A lamp or a detector fades at the ends of its range, and the quotient of two small numbers scatters there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from pellicle.data.spectrum import FEWEST_POINTS, LEAST_SHARE, LeftOut
from pellicle.signals.limits import HIGHEST, LOWEST, LOWEST_OF_NOISE
from pellicle.signals.local_scatter import FEWEST, coherence, local_scatter

_TIMES = 8.0
"""Scatter over the lower quartile of the scatter, above which a point is bad. Noise of a good spectrum grows
by 2 to 4 towards its ends."""
_LEAST_SCATTER = 5e-4
_COHERENT, _COHERENT_IF_IMPOSSIBLE = 0.45, 0.75
"""Correlation of second differences above which an edge has fringes, not noise, which bend as much where they
are dense; the second where the edge has values that no film has. Fringes of two or three points reach 0.5 to
0.75, noise 0.28 to 0.43, and 0.6 where it is smoothed over a few points."""
_LEAST_RANGE = 50.0
"""Range in nm that must remain, or `LEAST_SHARE` of the points."""
_LEAST_LIGHT = 5.0
"""Light of the reference over its own scatter."""
_MOST_POINTS = 200_000


class GoodRange(NamedTuple):
    """The range that remains without noisy edges: its rows, the points left out, and a note."""

    rows: slice
    left_out: LeftOut
    note: str


def noisy_edges(
    wavelength: Float[np.ndarray, " points"],
    values: Float[np.ndarray, " points"],
    light: Float[np.ndarray, " points"] | None = None,
    *,
    calibrated: bool = True,
) -> GoodRange | None:
    """Find noisy edges: rows to keep, or None where there are no such edges.

    A point is bad if its local scatter exceeds 8 times the lower quartile of all (at least 5e-4), if it lies
    outside −0.1 to 1.5, or if the reference has no light there. The longest run of good points is kept where
    it has half of the points or 50 nm, and where most points left out at each end scatter so.

    **Arguments:** `wavelength` (nm), rising or falling; `values` as fractions, or on an unknown scale if
    `calibrated` is False, which are compared with their median; `light`: counts of the reference less the
    dark, where the file has them.
    """
    if not 2 * FEWEST < values.size <= _MOST_POINTS:
        return None
    measured = values
    if not calibrated:
        values = 0.5 * values / max(float(np.median(np.abs(values))), np.finfo(float).tiny)
    scatter = local_scatter(values)
    dark = np.zeros(values.size, dtype=bool)
    if light is not None:
        dark = light < _LEAST_LIGHT * local_scatter(light)
    if dark.all():
        return None
    rough = scatter > _TIMES * max(float(np.quantile(scatter[~dark], 0.25)), _LEAST_SCATTER)
    impossible = (values < LOWEST_OF_NOISE) | (values > HIGHEST)
    start, stop = longest_run(~(rough | dark | impossible))
    kept = stop - start
    if kept == values.size or kept < FEWEST_POINTS:
        return None
    remains = abs(wavelength[stop - 1] - wavelength[start])
    if kept < LEAST_SHARE * values.size and remains < _LEAST_RANGE:
        return None
    width = 2 * FEWEST
    edges = slice(0, start), slice(stop, None)
    windows = slice(0, max(start, width)), slice(min(stop, values.size - width), None)
    for edge, window in zip(edges, windows, strict=True):
        if not _is_noise(values[window], rough[edge], dark[edge], impossible[edge]):
            return None
    reason = "the reference has no light there" if dark.any() else "noise of an edge"
    out = np.r_[0:start, stop : values.size]
    low, high = sorted((wavelength[start], wavelength[stop - 1]))
    note = (
        f"{kept} of {values.size} points kept, {low:g} to {high:g} nm: beyond, {reason}; "
        f"`range=({wavelength.min():g}, {wavelength.max():g})` keeps all"
    )
    return GoodRange(slice(start, stop), LeftOut(wavelength[out], measured[out], reason), note)


def _is_noise(values: np.ndarray, rough: np.ndarray, dark: np.ndarray, impossible: np.ndarray) -> bool:
    """True for an edge that has no light, or scatters without the coherence of fringes; for an empty one.

    `values` are of the edge, or of a window as wide as coherence needs; the others are of its points.
    """
    if not rough.size or np.mean(dark) > LEAST_SHARE:
        return True
    most = _COHERENT_IF_IMPOSSIBLE if impossible.any() else _COHERENT
    return bool(np.mean(rough | dark) >= LEAST_SHARE and np.median(coherence(values)) <= most)


def readable_range(
    wavelength: Float[np.ndarray, " points"], values: Float[np.ndarray, " points"]
) -> tuple[float, float] | None:
    """Return the longest range (nm) without impossible values; None where it has under half of the points
    and under 50 nm."""
    start, stop = longest_run((values >= LOWEST) & (values <= HIGHEST))
    if stop - start < FEWEST_POINTS:
        return None
    ends = sorted((float(wavelength[start]), float(wavelength[stop - 1])))
    if stop - start < LEAST_SHARE * values.size and ends[1] - ends[0] < _LEAST_RANGE:
        return None
    low, high = float(np.ceil(ends[0])), float(np.floor(ends[1]))
    return (low, high) if low < high else (ends[0], ends[1])


def longest_run(good: Bool[np.ndarray, " points"]) -> tuple[int, int]:
    """Return start and stop of the longest run of True, (0, 0) without one."""
    steps = np.diff(np.concatenate([[0], good.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    if not starts.size:
        return 0, 0
    i = int(np.argmax(stops - starts))
    return int(starts[i]), int(stops[i])
