"""Light of a trace: values, noise, outages, means of neighbouring times, and windows of time."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pellicle.data.cube import Cube
from pellicle.errors import UsageError
from pellicle.fitting.robust_losses import MAD_TO_SIGMA
from pellicle.scene.free import SHARED

_ENOUGH = 2000
"""Times on which other paths are tried: of a longer trace means of neighbouring ones."""
_JUMP, _SHORT, _EQUAL = 0.15, 0.2, 8
"""An outage: from a jump of the light to the next, in shares of its range, if they are near in shares of the
trace; or that many equal values, of a detector that is saturated or off."""
_PER_BRANCH, LEAST = 4, 24
"""Windows in the time from one extremum to the next, about, and least number of them."""

MIDDLE = 0.0, 0.5
"""Gain and offset of 0 in the unit cube."""


class Light(NamedTuple):
    """Values (times, wavelengths), NaN where absent, at the times (times,); noise and range (wavelengths,);
    known gain and offset."""

    values: np.ndarray
    time: np.ndarray
    noise: np.ndarray
    span: np.ndarray
    known: tuple[float | None, float | None]

    @property
    def free(self) -> list[int]:
        """0 and 1, as far as the gain and the offset are free."""
        return [i for i, number in enumerate(self.known) if number is None]

    @property
    def shared(self) -> list[str]:
        """Kinds of change of the free gains of all wavelengths, then of the free offsets."""
        return [SHARED] * (self.values.shape[1] * len(self.free))

    def gains(self, units: np.ndarray, gain: np.ndarray, scales: np.ndarray) -> np.ndarray:
        """Gains and offsets (wavelengths, 2): the free ones by their parameters in the unit cube, in `scales`
        (wavelengths, 2)."""
        found = gain.copy()
        for i, column in zip(self.free, units.reshape(len(self.free), -1), strict=True):
            found[:, i] = scales[:, i] * (column - MIDDLE[i])
        return found

    def part(self, which: np.ndarray) -> Light:
        """The light at some of the times."""
        return self._replace(values=self.values[which], time=self.time[which])


def light_of(cube: Cube, time: np.ndarray, known: tuple[float | None, float | None]) -> Light:
    """Return the light of a cube of one axis. Raises UsageError where it has too few values."""
    values = np.array(cube.pixels((slice(None),))["values"])
    outages = np.any([_outages(column) for column in values.T], axis=0)
    values[outages] = np.nan
    if (left := np.isfinite(values).all(axis=1).sum()) < LEAST:
        shut = f" besides {outages.sum()} that are constant, as of a closed shutter or a saturated detector"
        raise UsageError(
            f"{cube.path}: a trace needs {LEAST} times with values at least, and this has {left}"
            f"{shut if outages.any() else ''}"
        )
    second = np.abs(values[2:] - 2 * values[1:-1] + values[:-2])
    span = np.subtract(*np.nanpercentile(values, [99.5, 0.5], axis=0))
    noise = np.maximum(MAD_TO_SIGMA * np.nanmedian(second, axis=0) / np.sqrt(6), 1e-5 * span + 1e-12)
    return Light(values, time, noise, np.maximum(span, 1e-9), known)


def _outages(values: np.ndarray) -> np.ndarray:
    """True at times (times,) of a closed shutter or a saturated detector."""
    out, known = np.zeros(len(values), bool), np.flatnonzero(np.isfinite(values))
    if len(known) < LEAST:
        return out
    change = np.abs(np.diff(values[known]))
    least = max(_JUMP * float(np.ptp(values[known])), 6 * float(np.quantile(change, 0.98)))
    jumps = np.flatnonzero(change > least) + 1
    for first, after in pairwise(jumps):
        if after - first < _SHORT * len(known):
            out[known[first:after]] = True
    same = np.split(np.arange(len(known)), np.flatnonzero(change > 0) + 1)
    for run in same:
        if len(run) >= _EQUAL:
            out[known[run]] = True
    return out


def averaged(light: Light) -> Light:
    """The trace by means of neighbouring times, where it has more than `_ENOUGH` times and changes slowly."""
    windows, _ = windows_of(light)
    size = min(len(light.time) // _ENOUGH, min(map(len, windows[1:-1])))
    if size < 2:
        return light
    parts = np.array_split(np.arange(len(light.time)), len(light.time) // size)
    values = np.stack([light.values[part].mean(axis=0) for part in parts])
    time = np.array([light.time[part].mean() for part in parts])
    return light._replace(values=values, time=time, noise=light.noise / np.sqrt(size))


def windows_of(light: Light) -> tuple[list[np.ndarray], float]:
    """Positions of the times in the middle of each window; the share of the windows that are new looks at the
    order: two in a fringe."""
    known = np.flatnonzero(np.isfinite(light.values).all(axis=1))
    values, count = light.values[known] / light.span, len(known)
    # means over so many times that their noise is small, at most a twelfth of the shortest swing
    size = int(np.clip(np.ceil(np.max(light.noise / light.span / 0.02) ** 2), 1, count / LEAST))
    blocks = np.stack([part.mean(axis=0) for part in np.array_split(values, count // size)])
    dead = 5 * np.max(light.noise / light.span) / np.sqrt(size) + 0.02
    followed = np.empty_like(blocks)
    followed[0] = blocks[0]
    for i in range(1, len(blocks)):  # changes beyond the noise
        followed[i] = np.clip(followed[i - 1], blocks[i] - dead, blocks[i] + dead)
    moved = np.abs(np.diff(followed, axis=0, prepend=followed[:1])).max(axis=1)
    branches = float(moved.sum()) / (1 - 2 * min(dead, 0.25))
    at = (np.arange(len(blocks)) + 0.5) / len(blocks)
    along = np.interp((np.arange(count) + 0.5) / count, at, np.cumsum(moved))
    even = (light.time[known] - light.time[known[0]]) / np.ptp(light.time[known])
    place = 0.5 * _PER_BRANCH * (along + branches * even) + LEAST * even
    edges = np.flatnonzero(np.diff(np.floor(place))) + 1
    edges = np.unique(
        np.concatenate([[size], edges, [count - size]]).astype(int)
    )  # both ends, which may be known, by themselves
    parts = np.split(known, edges)
    looks = 1 + branches
    return [part[len(part) // 4 : len(part) - len(part) // 4] for part in parts], min(1.0, looks / len(parts))
