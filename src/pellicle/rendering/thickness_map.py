"""Maps of a film's thickness over an object: arrays and grey images, in nm."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.errors import DataError, UsageError

_NODES = 9
"""Thicknesses of a map at which colours are compared: its quantiles from the least to the largest."""

_LEAST = 3.0
"""Largest thickness (nm) of a map in nm at least: one of 3 µm is beyond all interference colours."""


def read_thickness_map(path: str | os.PathLike[str]) -> np.ndarray:
    """Read a map of thicknesses in nm, (rows, columns): an array in `.npy`, or a grey image of 8 or 16 bits.

    **Raises:** DataError for a file that cannot be read, and for an image in colour.
    """
    try:
        if Path(path).suffix.lower() == ".npy":
            values = np.load(path, allow_pickle=False)
        else:
            from PIL import Image  # a requirement of Matplotlib

            with Image.open(path) as image:
                values = np.asarray(image)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DataError(
            f"{path}: cannot be read as a map of thicknesses ({reason}); give an array in .npy or a grey PNG,"
            " in nm"
        ) from None
    if values.ndim != 2:
        raise DataError(
            f"{path}: has the shape {values.shape}; a map of thicknesses is (rows, columns), as a grey image"
        )
    try:
        return checked(values)
    except UsageError as error:
        raise DataError(f"{path}: {error}") from None


def checked(values: Any) -> np.ndarray:
    """Return a map of thicknesses as an array. Raises UsageError for another shape, and for wrong values."""
    try:
        found = np.asarray(values, float)
    except ValueError:
        raise UsageError("`thickness_map` must have numbers, thicknesses in nm") from None
    if found.ndim != 2 or found.size == 0:
        raise UsageError(f"`thickness_map` must have the shape (rows, columns), not {found.shape}")
    if not np.all(np.isfinite(found)) or np.min(found) < 0:
        raise UsageError("`thickness_map` must have finite thicknesses in nm, none below 0")
    if np.max(found) < _LEAST:
        raise UsageError(
            f"`thickness_map` is {np.max(found):.3g} nm thick at most: give thicknesses in nm, not in µm"
        )
    return found


def nodes(thickness_map: np.ndarray) -> np.ndarray:
    """Return thicknesses that stand for a map: quantiles, with the least and the largest."""
    return np.unique(np.quantile(thickness_map, np.linspace(0.0, 1.0, _NODES)))
