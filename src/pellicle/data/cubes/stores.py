"""Cubes in zarr stores and NetCDF files, which stay closed but for the block that is read."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

from pellicle.data.cubes.numpy_files import arrays_to_raw
from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.cubes.xarray_cubes import xarray_to_raw
from pellicle.data.tabular.text import open_binary
from pellicle.errors import DataError, UsageError, install_command

_HDF5, _CLASSIC = b"\x89HDF\r\n\x1a\n", b"CDF"
_STORES = ("zarr.json", ".zgroup", ".zarray", ".zmetadata")


def is_netcdf(path: Path) -> bool:
    """True for a NetCDF or HDF5 file, by its first bytes."""
    with open_binary(path) as file:
        head = file.read(8)
    return head == _HDF5 or head.startswith(_CLASSIC)


def is_classic(path: Path) -> bool:
    """True for NetCDF 3, which has its own format."""
    with open_binary(path) as file:
        return file.read(3) == _CLASSIC


def is_zarr(path: Path) -> bool:
    """True for the folder of a zarr store."""
    return any((path / name).exists() for name in _STORES)


def read_netcdf(path: Path, asked: Asked) -> RawCube:
    """Read a NetCDF file. Raises DataError for a damaged one, UsageError without the packages."""
    engine = "scipy" if is_classic(path) else "h5netcdf"
    dataset = _opened(path, lambda xarray: xarray.open_dataset(path, engine=engine, chunks=None, cache=False))
    return xarray_to_raw(dataset, str(path), asked, (path,))


def read_zarr(path: Path, asked: Asked) -> RawCube:
    """Read a zarr store: a group as xarray writes it, or one array. Raises DataError or UsageError."""

    def group(xarray: Any) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # metadata that are not consolidated take longer to read
            return xarray.open_zarr(path, chunks=None, decode_timedelta=True)

    if (path / ".zarray").exists() or _node_type(path / "zarr.json") == "array":
        return _zarr_array(path, asked)
    return xarray_to_raw(_opened(path, group), str(path), asked, (path,))


def _node_type(path: Path) -> str:
    """Type of a store of zarr 3, array or group; its text may also contain the types of its arrays."""
    try:
        return str(json.loads(path.read_bytes())["node_type"]) if path.is_file() else ""
    except (ValueError, KeyError, TypeError):
        raise DataError(f"{path}: is damaged: it states no node_type; write the store again") from None


def _opened(path: Path, opening: Any) -> Any:
    try:
        import xarray

        return opening(xarray)
    except ImportError as error:
        raise UsageError(
            f"{path}: cubes in zarr and NetCDF need {error.name}: {install_command('maps')}"
        ) from None
    except Exception as error:  # xarray and its engines raise errors of every kind on damaged files
        reason = " ".join(str(error).split())[:200].rstrip(".")
        raise DataError(f"{path}: cannot be opened as a cube ({reason}); write it again") from None


def _zarr_array(path: Path, asked: Asked) -> RawCube:
    """The only array of a store, whose axes may have names (zarr 3)."""

    def opening(_: Any) -> Any:
        import zarr

        return zarr.open_array(path, mode="r")

    array = _opened(path, opening)
    names = getattr(array.metadata, "dimension_names", None)
    if names and all(names):
        import xarray

        variable = _opened(path, lambda _: xarray.Variable(tuple(names), array))
        return xarray_to_raw(xarray.DataArray(variable), str(path), asked, (path,))
    return arrays_to_raw({"": array}, str(path), asked, (path,))
