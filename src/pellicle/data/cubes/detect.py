"""Detection of the format of a cube, by content and not by suffix."""

from collections.abc import Callable
from pathlib import Path

from pellicle.data.cubes import envi, numpy_files, spectra_folder, tiff_stacks, xarray_cubes
from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.photographs import image_format
from pellicle.errors import DataError

LARGEST_SPECTRUM = 2**27
"""Bytes of a larger HDF5 file are no spectrum's."""
READ = "zarr, NetCDF, ENVI (.hdr), TIFF stacks, .npy, .npz, and folders of spectra with a table of file, x, y"


READERS: dict[Callable[[Path], bool], Callable[[Path, Asked], RawCube]] = {
    xarray_cubes.is_zarr: xarray_cubes.read_zarr,
    Path.is_dir: spectra_folder.read_folder,
    xarray_cubes.is_netcdf: xarray_cubes.read_netcdf,
    numpy_files.is_numpy: numpy_files.read_numpy,
    tiff_stacks.is_tiff: tiff_stacks.read_tiff,
    envi.is_envi: envi.read_envi,
    spectra_folder.is_table: spectra_folder.read_folder,
}
"""Readers of cubes by the test of a file or folder that they read; the first that holds is taken."""


def read_raw(path: Path, asked: Asked) -> RawCube:
    """Read the cube of a file or folder. Raises DataError or UsageError, one sentence."""
    if not path.exists():
        raise DataError(f"{path}: no such file or folder; check its name")
    for recognises, read in READERS.items():
        if recognises(path):
            return read(path, asked)
    raise DataError(f"{path}: is no cube that pellicle reads ({READ}): convert it to one of these")


def is_cube(path: Path) -> bool:
    """True for a file or folder that only a reader of cubes understands; HDF5 may also be a spectrum."""
    read = next((read for recognises, read in READERS.items() if path.exists() and recognises(path)), None)
    if read is spectra_folder.read_folder:
        return spectra_folder.table_of(path) is not None
    if read is tiff_stacks.read_tiff:
        return not tiff_stacks.is_colour_image(path)
    if read is xarray_cubes.read_netcdf:
        return xarray_cubes.is_classic(path) or path.stat().st_size > LARGEST_SPECTRUM
    return read is not None


def is_photograph(path: Path) -> bool:
    """True for a photograph in colours: PNG, JPEG, or a TIFF of one page in R, G, B or with a palette."""
    kind = image_format(path) if path.is_file() else None
    return tiff_stacks.is_colour_image(path) if kind == "TIFF" else kind is not None
