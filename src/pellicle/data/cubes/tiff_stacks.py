"""TIFF stacks with one page, or one sample, for each wavelength, read block by block."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.array_axes import array_axes, need_wavelengths
from pellicle.data.cubes.raw_cube import COUNTS, Asked, RawCube
from pellicle.data.cubes.stored_arrays import MappedFile, Stored, TiffPages
from pellicle.data.tabular.text import open_binary
from pellicle.errors import DataError, UsageError, install_command

_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_OME_CHANNEL = re.compile(r'<Channel\b[^>]*?\bEmissionWavelength="([\d.]+)"')
_OME_UNIT = re.compile(r'\bEmissionWavelengthUnit="([^"]+)"')
_LABEL = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)\s*nm\b", re.IGNORECASE)
_NAMES = {"Y": "y", "X": "x", "T": "time"}


def is_tiff(path: Path) -> bool:
    """True for a TIFF, by its first bytes."""
    with open_binary(path) as file:
        return file.read(4) in _SIGNATURES


def read_tiff(path: Path, asked: Asked) -> RawCube:
    """Read a TIFF stack. Raises DataError for a damaged one, UsageError without wavelengths or tifffile."""
    try:
        import tifffile
    except ImportError:
        raise UsageError(f"{path}: TIFF stacks need tifffile: {install_command('images')}") from None
    try:
        with tifffile.TiffFile(path) as file:
            data, letters = _stack(path, file)
            wavelength, unit, notes = asked.wavelength, asked.unit, []
            if wavelength is None:
                wavelength, told = _channel_wavelengths(file)
                unit, notes = "nm", [told] if told else []
    except DataError:
        raise
    except Exception as error:  # tifffile raises errors of every kind on damaged files
        reason = str(error).split("\n")[0].rstrip(".")
        raise DataError(f"{path}: the TIFF cannot be read ({reason}); save it again") from None
    if wavelength is None:
        raise need_wavelengths(data.shape, str(path))
    axes, told = _axes(data.shape, letters, wavelength.size, str(path))
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


def _stack(path: Path, file: Any) -> tuple[MappedFile | TiffPages, str]:
    """The numbers of a stack, and a letter for each axis as tifffile names them."""
    series = file.series
    first = series[0]
    alike = len(series) > 1 and all(s.shape == first.shape and s.dtype == first.dtype for s in series)
    if len(series) > 1 and not alike:
        shapes = ", ".join(sorted({" x ".join(map(str, s.shape)) for s in series}))
        raise DataError(
            f"{path}: its pages have different sizes ({shapes}): save one stack of pages of one size"
        )
    shape, letters = tuple(first.shape), first.axes
    if alike:
        shape, letters = (len(series), *shape), "Q" + letters
    elif first.dataoffset is not None and first.keyframe.fillorder == 1:
        dtype = np.dtype(first.dtype).newbyteorder(file.byteorder)
        kept = [i for i, n in enumerate(shape) if n > 1 or letters[i] in "YX"]
        mapped = MappedFile(str(path), dtype, tuple(shape[i] for i in kept), int(first.dataoffset))
        return mapped, "".join(letters[i] for i in kept)
    numbers = tuple(int(page.index) for one in series for page in one.pages)
    rank = len(first.keyframe.shape)
    leading = len(shape) - rank
    if int(np.prod(shape[:leading])) != len(numbers):
        raise DataError(f"{path}: its pages make no stack ({len(numbers)} pages, {shape}): save it as one")
    return TiffPages(str(path), numbers, np.dtype(first.dtype), shape, leading), letters


def _axes(shape: tuple[int, ...], letters: str, bands: int, path: str) -> tuple[tuple[str, ...], list[str]]:
    """Names of the axes: rows, columns and time as the file states them, that of the bands by its length."""
    if not {"Y", "X"} <= set(letters) or (letters.startswith("Q") and len(shape) == 3 and bands != shape[0]):
        return array_axes(shape, bands, path)
    rest = [i for i, letter in enumerate(letters) if letter not in _NAMES]
    if len(rest) == 1 and shape[rest[0]] == bands:
        names = [_NAMES.get(letter, "wavelength") for letter in letters]
        return tuple(names), []
    return array_axes(shape, bands, path)


def _channel_wavelengths(file: Any) -> tuple[np.ndarray | None, str]:
    """Wavelengths in nm that OME metadata or ImageJ labels (`450 nm`) state for every page, and a note."""
    if file.is_ome and (text := file.ome_metadata):
        units = set(_OME_UNIT.findall(text)) or {"nm"}
        found = [float(value) for value in _OME_CHANNEL.findall(text)]
        if found and units == {"nm"}:
            return np.array(found), "wavelengths of the channels, from the OME metadata"
    labels = (file.imagej_metadata or {}).get("Labels", []) if file.is_imagej else []
    found = [_LABEL.findall(str(label)) for label in labels]
    if found and all(len(one) == 1 for one in found):
        return np.array([float(one[0]) for one in found]), "wavelengths from the labels of the pages"
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
