"""Detection of the format of a cube, by content and not by suffix."""

from __future__ import annotations

from pathlib import Path

from pellicle.data.cubes import envi, numpy_files, spectra_folder, tiff_stacks, xarray_cubes
from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.photographs import image_format
from pellicle.errors import DataError

LARGEST_SPECTRUM = 2**27
"""Bytes of a larger HDF5 file are no spectrum's."""
READ = "zarr, NetCDF, ENVI (.hdr), TIFF stacks, .npy, .npz, and folders of spectra with a table of file, x, y"


def read_raw(path: Path, asked: Asked) -> RawCube:
    """Read the cube of a file or folder. Raises DataError or UsageError, one sentence."""
    if not path.exists():
        raise DataError(f"{path}: no such file or folder; check its name")
    if path.is_dir():
        if xarray_cubes.is_zarr(path):
            return xarray_cubes.read_zarr(path, asked)
        return spectra_folder.read_folder(path, asked)
    if xarray_cubes.is_netcdf(path):
        return xarray_cubes.read_netcdf(path, asked)
    if numpy_files.is_numpy(path):
        return numpy_files.read_numpy(path, asked)
    if tiff_stacks.is_tiff(path):
        return tiff_stacks.read_tiff(path, asked)
    if envi.header_of(path) is not None:
        return envi.read_envi(path, asked)
    if image_format(path) is None and spectra_folder.table_of(path) is not None:
        return spectra_folder.read_folder(path, asked)
    raise DataError(f"{path}: is no cube that pellicle reads ({READ}): convert it to one of these")


def is_cube(path: Path) -> bool:
    """True for a file or folder that only a reader of cubes understands; HDF5 may also be a spectrum."""
    if not path.exists():
        return False
    if path.is_dir():
        return xarray_cubes.is_zarr(path) or spectra_folder.table_of(path) is not None
    if numpy_files.is_numpy(path) or envi.header_of(path) is not None:
        return True
    if tiff_stacks.is_tiff(path):
        return not tiff_stacks.is_colour_image(path)
    if xarray_cubes.is_netcdf(path):
        return xarray_cubes.is_classic(path) or path.stat().st_size > LARGEST_SPECTRUM
    return image_format(path) is None and spectra_folder.table_of(path) is not None


def is_photograph(path: Path) -> bool:
    """True for a photograph in colours: PNG, JPEG, or a TIFF of one page in R, G, B or with a palette."""
    if not path.is_file():
        return False
    kind = image_format(path)
    if kind != "TIFF":
        return kind is not None
    return tiff_stacks.is_colour_image(path)
