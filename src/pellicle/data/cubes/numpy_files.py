"""Cubes in NumPy files: `.npy`, and `.npz` with the wavelengths beside them.

Both are read block by block from the file, but for compressed `.npz`, which are unpacked into memory.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.array_axes import array_axes, need_wavelengths
from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.cubes.stored_arrays import ANGLE, MappedFile, Stored
from pellicle.data.cubes.variable_names import Chosen, choose_variables
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.text import open_binary
from pellicle.errors import DataError

_NPY, _ZIP = b"\x93NUMPY", b"PK\x03\x04"


def is_numpy(path: Path) -> bool:
    """True for a `.npy` or `.npz` file, by its content."""
    with open_binary(path) as file:
        head = file.read(8)
    return head.startswith(_NPY) or (head.startswith(_ZIP) and path.suffix.lower() == ".npz")


def read_numpy(path: Path, asked: Asked) -> RawCube:
    """Read a `.npy` or `.npz` file. Raises DataError for a damaged one, UsageError without wavelengths."""
    try:
        if zipfile.is_zipfile(path):
            arrays: Mapping[str, Any] = _members(path)
        else:
            with path.open("rb") as file:
                arrays = {"": mapped_array(path, file)}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise DataError(f"{path}: is a damaged NumPy file ({error}); save it again") from None
    return arrays_to_raw(arrays, str(path), asked, (path,))


def arrays_to_raw(
    arrays: Mapping[str, Any], path: str, asked: Asked, files: tuple[Path, ...], notes: tuple[str, ...] = ()
) -> RawCube:
    """Return the cube of arrays by name, one of which may be the wavelengths."""
    roles = {name: recognise(name) for name in arrays if name}
    wavelength, unit = asked.wavelength, asked.unit
    angle = None
    for name, column in roles.items():
        if column.role == "wavelength" and wavelength is None:
            wavelength, unit = np.asarray(arrays[name][...], dtype=float).reshape(-1), column.unit
        elif column.role == "angle":
            angle = np.asarray(arrays[name][...], dtype=float).reshape(-1)
    measured = {
        name: array
        for name, array in arrays.items()
        if len(array.shape) >= 2 and (not name or roles[name].role not in ("wavelength", "angle"))
    }
    if not measured:
        raise DataError(f"{path}: has no array of pixels and bands, only {_shapes(arrays) or 'none'}")
    chosen = choose_variables(dict.fromkeys(measured), asked.variable, asked.signal, path)
    shape = tuple(measured[chosen.arrays["values"]].shape)
    if wavelength is None:
        raise need_wavelengths(shape, path)
    axes, told = _axes(shape, wavelength.size, angle, path)
    dims = tuple(axis for axis in axes if axis not in ("wavelength", ANGLE))
    others = {name: array for name, array in arrays.items() if name not in chosen.arrays.values()}
    return _raw(chosen, measured, others, axes, dims, path, wavelength, unit, angle, files, (*notes, *told))


def _raw(
    chosen: Chosen,
    measured: Mapping[str, Any],
    others: Mapping[str, Any],
    axes: tuple[str, ...],
    dims: tuple[str, ...],
    path: str,
    wavelength: np.ndarray,
    unit: str | None,
    angle: np.ndarray | None,
    files: tuple[Path, ...],
    notes: tuple[str, ...],
) -> RawCube:
    arrays = {role: Stored(measured[name], axes) for role, name in chosen.arrays.items()}
    by_rank = {len(axes): axes, len(dims): dims, 1: ("wavelength",)}
    stored = {
        name: Stored(array, by_rank[len(array.shape)])
        for name, array in others.items()
        if len(array.shape) in by_rank
    }
    return RawCube(
        path,
        arrays,
        dims,
        wavelength,
        unit,
        files=files,
        signal=chosen.signal,
        polarisation=chosen.polarisation,
        signal_unit=chosen.unit,
        calibrated=chosen.calibrated,
        angle=angle,
        others=stored,
        notes=notes,
    )


def _axes(
    shape: tuple[int, ...], bands: int, angle: np.ndarray | None, path: str
) -> tuple[tuple[str, ...], list[str]]:
    """Axes of an array, of which the last is that of the angles where there are several."""
    if angle is None or angle.size == 1:
        return array_axes(shape, bands, path)
    if shape[-1] != angle.size:
        raise DataError(
            f"{path}: has {angle.size} angles, and the last of its axes ({_text(shape)}) another length: "
            "store it as y, x, wavelength, angle"
        )
    axes, notes = array_axes(shape[:-1], bands, path)
    return (*axes, ANGLE), notes


def _shapes(arrays: Mapping[str, Any]) -> str:
    return ", ".join(f"{name or 'one'} ({_text(array.shape)})" for name, array in arrays.items())


def _text(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))


def _members(path: Path) -> dict[str, Any]:
    """Arrays of an `.npz`: maps of the file where they are stored without compression."""
    found: dict[str, Any] = {}
    with zipfile.ZipFile(path) as archive, path.open("rb") as whole:
        for info in archive.infolist():
            name = info.filename.removesuffix(".npy")
            if info.compress_type != zipfile.ZIP_STORED:
                with archive.open(info) as member:
                    found[name] = np.lib.format.read_array(member, allow_pickle=False)
                continue
            whole.seek(info.header_offset + 26)  # lengths of the name and of the extra field
            lengths = np.frombuffer(whole.read(4), "<u2")
            start = info.header_offset + 30 + int(lengths.sum())
            found[name] = mapped_array(path, whole, start)
    return found


def mapped_array(path: Path, file: Any, start: int = 0) -> MappedFile:
    """The array whose header begins at a place of an open file. Raises ValueError for a damaged one."""
    file.seek(start)
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = read(file)
    if dtype.hasobject:
        raise ValueError("it has Python objects in it, not numbers")
    size = int(np.prod(shape)) * dtype.itemsize
    if file.tell() + size > path.stat().st_size:
        raise ValueError("it ends before its last number")
    return MappedFile(str(path), dtype, shape, file.tell(), "F" if fortran else "C")
