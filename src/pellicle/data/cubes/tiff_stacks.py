"""TIFF stacks with one page, or one sample, for each wavelength, read block by block."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.numpy_files import array_axes, need_wavelengths
from pellicle.data.cubes.raw_cube import COUNTS, Asked, MappedFile, RawCube, Stored
from pellicle.data.photographs import image_format
from pellicle.errors import DataError, decoding, needs

_OME_CHANNEL = re.compile(r'<Channel\b[^>]*?\bEmissionWavelength="([\d.]+)"')
_OME_UNIT = re.compile(r'\bEmissionWavelengthUnit="([^"]+)"')
_LABEL = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)\s*nm\b", re.IGNORECASE)
_NAMES = {"Y": "y", "X": "x", "T": "time"}


def is_tiff(path: Path) -> bool:
    """True for a TIFF, by its first bytes."""
    return image_format(path) == "TIFF"


def read_tiff(path: Path, asked: Asked) -> RawCube:
    """Read a TIFF stack. Raises DataError for a damaged one, UsageError without wavelengths or tifffile."""
    damaged = decoding(f"{path}: the TIFF cannot be read", "save it again")
    with needs("images", f"{path}: TIFF stacks need"), damaged:
        import tifffile

        with tifffile.TiffFile(path) as file:
            shaped = len(file.series) == 1  # else the pages were written one by one
        with tifffile.TiffFile(path, is_shaped=None if shaped else False) as file:
            data, letters = _stack(path, file, shaped)
            wavelength, unit, notes = asked.wavelength, asked.unit, []
            if wavelength is None:
                wavelength, told = _channel_wavelengths(file)
                unit, notes = "nm", [told] if told else []
    if wavelength is None:
        raise need_wavelengths(data.shape, str(path))
    # rows, columns and time as the file states them, the axis of the bands by its length
    rest = [n for n, letter in zip(data.shape, letters, strict=True) if letter not in _NAMES]
    pages = letters[0] in "QI" and len(data.shape) == 3 and wavelength.size != data.shape[0]
    if {"Y", "X"} <= set(letters) and not pages and rest == [wavelength.size]:
        axes, told = tuple(_NAMES.get(letter, "wavelength") for letter in letters), []
    else:
        axes, told = array_axes(data.shape, wavelength.size, str(path))
    return RawCube(
        str(path),
        {"values": Stored(data, axes)},
        tuple(axis for axis in axes if axis != "wavelength"),
        wavelength,
        unit,
        files=(path,),
        signal_unit=COUNTS if data.dtype.kind in "iu" else None,
        notes=(f"TIFF stack, {data.dtype.name}", *notes, *told),
    )


@dataclass(frozen=True)
class CompressedPages:
    """Pages of a TIFF, compressed or scattered over the file; only strips or tiles of a block are decoded.

    `shaped`: pages are one stack as tifffile states it in their description.
    """

    path: str
    shaped: bool
    dtype: np.dtype[Any]
    shape: tuple[int, ...]

    def __getitem__(self, where: Any) -> np.ndarray:
        import tifffile
        import zarr

        damaged = decoding(f"{self.path}: cannot be decoded", "save it without compression")
        with damaged, tifffile.TiffFile(self.path, is_shaped=None if self.shaped else False) as file:
            pages: Any = zarr.open_array(file.series[0].aszarr(), mode="r")
            return np.asarray(pages[where])


def _stack(path: Path, file: Any, shaped: bool) -> tuple[MappedFile | CompressedPages, str]:
    """The numbers of a stack, and a letter for each axis as tifffile names them."""
    series = file.series
    first = series[0]
    if len(series) > 1:
        shapes = ", ".join(sorted({" x ".join(map(str, s.shape)) for s in series}))
        raise DataError(
            f"{path}: its pages have different sizes ({shapes}): save one stack of pages of one size"
        )
    dtype, shape, letters = np.dtype(first.dtype), tuple(first.shape), first.axes
    if first.dataoffset is None or first.keyframe.fillorder != 1:
        with needs("maps", f"{path}: compressed TIFF stacks need"):
            import zarr  # noqa: F401
        return CompressedPages(str(path), shaped, dtype, shape), letters
    kept = [i for i, n in enumerate(shape) if n > 1 or letters[i] in "YX"]
    dtype = dtype.newbyteorder(file.byteorder)
    mapped = MappedFile(str(path), dtype, tuple(shape[i] for i in kept), int(first.dataoffset))
    return mapped, "".join(letters[i] for i in kept)


def _channel_wavelengths(file: Any) -> tuple[np.ndarray | None, str]:
    """Wavelengths in nm that OME metadata or ImageJ labels (`450 nm`) state for every page, and a note."""
    if file.is_ome and (text := file.ome_metadata):
        units = set(_OME_UNIT.findall(text)) or {"nm"}
        channels = [float(value) for value in _OME_CHANNEL.findall(text)]
        if channels and units == {"nm"}:
            return np.array(channels), "wavelengths of the channels, from the OME metadata"
    labels = (file.imagej_metadata or {}).get("Labels", []) if file.is_imagej else []
    numbers = [_LABEL.findall(str(label)) for label in labels]
    if numbers and all(len(one) == 1 for one in numbers):
        return np.array([float(one[0]) for one in numbers]), "wavelengths from the labels of the pages"
    return None, ""


def is_colour_image(path: Path) -> bool:
    """True for a TIFF whose first page is in R, G, B or has a palette; also without tifffile."""
    try:
        import tifffile

        with tifffile.TiffFile(path) as file:
            kind: Any = file.pages.first.photometric
            return kind is not None and kind.name in ("RGB", "PALETTE") and len(file.pages) == 1
    except Exception:  # the reader of the one or the other format then reports it
        return True
