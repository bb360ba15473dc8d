"""Sweeps of a spectrum: rows that were measured one after the other at one angle of incidence."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

_SHORT = 5
"""Fewest points of a sweep, on average; rows that turn back more often are in no order."""


def sweeps(
    wavelength: Float[np.ndarray, " rows"], angle: Float[np.ndarray, " rows"]
) -> list[Int[np.ndarray, " points"]]:
    """Positions of the rows of each sweep, in the order of measurement.

    A sweep goes one way along the wavelength at one angle, or along the angle at one wavelength where there
    are fewer wavelengths than angles. Rows in no order form one sweep, sorted.
    """
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


def _count(values: np.ndarray) -> int:
    return len(np.unique(values))
