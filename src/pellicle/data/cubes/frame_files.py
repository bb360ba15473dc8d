"""Frames of a camera from files and arrays: images, lines and single spectra of counts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.detect import read_raw
from pellicle.data.cubes.numpy_files import is_numpy
from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.cubes.stored_arrays import WAVELENGTH, Stored
from pellicle.errors import DataError, UsageError

_AXES = {1: (WAVELENGTH,), 2: ("x", WAVELENGTH)}


def read_frame(frame: str | os.PathLike[str] | np.ndarray, cube: RawCube) -> RawCube:
    """Read a frame for a cube. Raises DataError, or UsageError of a reader.

    An array has the axes (bands), (x, bands) or (y, x, bands).
    """
    if isinstance(frame, np.ndarray):
        return _array(frame, "the frame", cube)
    path = Path(frame)
    if path.is_file() and is_numpy(path) and path.suffix.lower() != ".npz":
        return _array(np.load(path, mmap_mode="r"), str(path), cube)
    try:
        raw = read_raw(path, Asked())
    except UsageError:  # it has no wavelengths of its own, or several variables
        raw = read_raw(path, Asked(cube.wavelength, cube.unit))
    if raw.wavelength.shape == cube.wavelength.shape and not np.allclose(
        raw.wavelength, cube.wavelength, 1e-4
    ):
        raise DataError(
            f"{path}: the wavelengths of the frame differ from those of {cube.path}: record both with the "
            "same settings of the camera"
        )
    return raw


def _array(values: Any, path: str, cube: RawCube) -> RawCube:
    if values.ndim not in (1, 2, 3):
        raise DataError(
            f"{path}: a frame has the axes bands, x and bands, or y, x and bands, not {values.ndim} axes"
        )
    axes = _AXES.get(values.ndim, ("y", "x", WAVELENGTH))
    if (
        values.ndim == 3
        and values.shape[-1] != cube.wavelength.size
        and values.shape[0] == cube.wavelength.size
    ):
        axes = (WAVELENGTH, "y", "x")
    return RawCube(path, {"values": Stored(values, axes)}, axes[:-1], cube.wavelength)
