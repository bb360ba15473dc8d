"""Sweeps of a spectrum: rows that were measured one after the other at one angle of incidence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pellicle.fitting.noise import integrated_time
from pellicle.scene.content import remembered

_SHORT = 5
"""Fewest points of a sweep, on average; rows that turn back more often are in no order."""


@remembered
def sweeps(
    wavelength: Float[np.ndarray, " rows"],
    angle: Float[np.ndarray, " rows"],
    azimuth: Float[np.ndarray, " rows"] | None = None,
) -> list[Int[np.ndarray, " points"]]:
    """Positions of the rows of each sweep, in the order of measurement.

    A sweep goes one way along the wavelength at one angle, or along the angle at one wavelength where there
    are fewer wavelengths than angles; each `azimuth` of the sample has its own, but one wavelength at one
    angle has a sweep of azimuths. Rows in no order form one sweep, sorted.
    """
    if azimuth is not None and _count(azimuth) > 1:
        if _count(angle) == _count(wavelength) == 1:
            return sweeps(azimuth, angle)
        each = [np.flatnonzero(azimuth == value) for value in dict.fromkeys(azimuth.tolist())]
        return [rows[own] for rows in each for own in sweeps(wavelength[rows], angle[rows])]
    fixed, along = (angle, wavelength) if _count(angle) <= _count(wavelength) else (wavelength, angle)
    result = []
    for value in dict.fromkeys(fixed.tolist()):
        rows = np.flatnonzero(fixed == value)
        turns, way = [], 0.0
        for i, step in enumerate(np.sign(np.diff(along[rows])).tolist(), start=1):
            if way and step and step != way:
                turns.append(i)
                way = 0.0  # the next sweep may go either way
            else:
                way = way or step
        if len(rows) < _SHORT * (len(turns) + 1):
            result.append(rows[np.argsort(along[rows], kind="stable")])
        else:
            result.extend(np.split(rows, turns))
    return result


def correlation_in_sweeps(
    residuals: Float[np.ndarray, "*pixels rows channels"], parts: Sequence[Int[np.ndarray, " points"]]
) -> Any:
    """Number of points of one channel whose residuals count as one: neighbours in a sweep, times the sweeps
    that have the same residuals, as angles have of one model's error. `parts` are the rows of each sweep."""
    total = 0.0
    for size in {len(part) for part in parts}:
        # those of one length have one estimate: each alone may be too short for it
        alike = np.stack([residuals[..., part, :] for part in parts if len(part) == size], axis=-2)
        count, among = alike.shape[-2], np.ones(1)
        if count > 1:
            among = count * np.mean(np.mean(alike, axis=-2) ** 2, axis=-2)
            among = np.clip(among / np.maximum(np.mean(alike**2, axis=(-3, -2)), 1e-300), 1.0, count)
        along = integrated_time(np.moveaxis(alike, -1, -3))
        total = total + np.mean(along * among, axis=-1) * alike.shape[-3] * count
    return total / residuals.shape[-2]


def _count(values: np.ndarray) -> int:
    return len(np.unique(values))
