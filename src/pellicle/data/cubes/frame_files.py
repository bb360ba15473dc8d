"""Frames of a camera from files and arrays: images, lines and single spectra of counts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.detect import read_raw
from pellicle.data.cubes.numpy_files import is_numpy, mapped_array
from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.cubes.stored_arrays import WAVELENGTH, Stored
from pellicle.errors import DataError, UsageError

_AXES = {1: (WAVELENGTH,), 2: ("x", WAVELENGTH), 3: ("y", "x", WAVELENGTH)}


def read_frame(frame: str | os.PathLike[str] | np.ndarray, cube: RawCube) -> RawCube:
    """Read a frame for a cube. Raises DataError, or UsageError of a reader.

    An array has the axes (bands), (x, bands) or (y, x, bands).
    """
    if isinstance(frame, np.ndarray):
        return _array(frame, "the frame", cube)
    path = Path(frame)
    if path.is_file() and is_numpy(path) and path.suffix.lower() != ".npz":
        with path.open("rb") as file:
            try:
                stored = mapped_array(path, file)
            except ValueError as error:
                raise DataError(f"{path}: is a damaged NumPy file ({error}); save it again") from None
        return _array(stored, str(path), cube)
    try:
        raw = read_raw(path, Asked())
    except UsageError:  # it has no wavelengths of its own, or several variables
        raw = read_raw(path, Asked(cube.wavelength, cube.unit))
    comparable = raw.unit == cube.unit and raw.wavelength.shape == cube.wavelength.shape
    if comparable and not np.allclose(raw.wavelength, cube.wavelength, 1e-4):
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
    axes, bands = _AXES[values.ndim], cube.wavelength.size
    if values.ndim == 3 and values.shape[0] == bands != values.shape[-1]:
        axes = (WAVELENGTH, "y", "x")
    dims = tuple(axis for axis in axes if axis != WAVELENGTH)
    return RawCube(path, {"values": Stored(values, axes)}, dims, cube.wavelength)
