"""Pixels of which as many points were measured, and the measured points of each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.film.sweeps import sweeps
from pellicle.fitting.film.view import SpectrumView
from pellicle.scene.free import is_free

BLOCK = 1024
"""Pixels that are judged at once. With 512 the calls of NumPy cost 1 to 3 µs more for each pixel; the systems
of equations of 2048 no longer stay in the cache."""


class Group(NamedTuple):
    """Pixels of which as many points were measured: their indices, the measured rows of each (pixels, rows),
    and the sweeps of those rows."""

    pixels: np.ndarray
    rows: np.ndarray
    parts: list[np.ndarray]

    def chunks(self, size: int) -> Iterator[Group]:
        """The group in parts of `size` pixels."""
        for first in range(0, len(self.pixels), size):
            own = slice(first, first + size)
            yield Group(self.pixels[own], self.rows[own], self.parts)


def groups(view: SpectrumView, weight: np.ndarray, known: np.ndarray) -> list[Group]:
    """Groups of the pixels that are `known` (pixels,); `weight` (pixels, points) is 0 where nothing was
    measured. Those of a view of several sweeps have measured the same points."""
    light = view.scene.light
    measured: Any = np.all((weight > 0).reshape(-1, view.rows, view.channels), axis=2)
    known = known & np.any(measured, axis=1)
    wavelength = np.asarray(light.wavelength)[: view.rows]
    own = 0.0 if is_free(light.angle) else light.angle  # a free one is the same for all
    angle = np.broadcast_to(own, np.shape(light.wavelength))[: view.rows]
    several = len(sweeps(wavelength, angle)) > 1
    keys = measured if several else measured.sum(axis=1)[:, None]
    _, which = np.unique(keys[known], axis=0, return_inverse=True)
    result = []
    for value in range(which.max(initial=-1) + 1):
        pixels = np.flatnonzero(known)[which.ravel() == value]
        count = int(measured[pixels[0]].sum())
        rows = np.argsort(~measured[pixels], axis=1, kind="stable")[:, :count]
        result.append(Group(pixels, rows, sweeps(wavelength[rows[0]], angle[rows[0]])))
    return result


class Taken:
    """The measured rows of arrays (pixels, points, ...) as (pixels, rows, channels, ...)."""

    def __init__(self, group: Group, view: SpectrumView):
        self._rows, self._view = group.rows, view
        self._all = group.rows.shape[1] == view.rows

    def __call__(self, x: np.ndarray) -> np.ndarray:
        view = self._view
        rows = x.reshape(len(x), view.rows, -1, *x.shape[2:])
        if self._all:
            return rows
        return np.take_along_axis(rows, self._rows.reshape(*self._rows.shape, *[1] * (rows.ndim - 2)), axis=1)
