"""ENVI cubes: a text header `.hdr` and a file of numbers beside it, read block by block.

**Source**: NV5 Geospatial, ENVI Header Files, https://www.nv5geospatialsoftware.com/docs/enviheaderfiles.html
"""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pellicle.data.cubes.numpy_files import need_wavelengths
from pellicle.data.cubes.raw_cube import COUNTS, Asked, MappedFile, RawCube, Stored
from pellicle.data.tabular.text import open_binary
from pellicle.data.tabular.units import to_nm, wavelength_unit
from pellicle.errors import DataError

_TYPES = {
    **{1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 6: "c8", 9: "c16"},
    **{12: "u2", 13: "u4", 14: "i8", 15: "u8"},
}
_AXES = {
    "bsq": ("wavelength", "y", "x"),
    "bil": ("y", "wavelength", "x"),
    "bip": ("y", "x", "wavelength"),
}
_SUFFIXES = ("", ".img", ".dat", ".raw", ".bin", ".bsq", ".bil", ".bip", ".cube", ".cub", ".hyspex", ".sli")
_FIELD = re.compile(r"^[ \t]*([^=;{}\n]+?)[ \t]*=[ \t]*(\{[^}]*\}|[^\n]*)", re.MULTILINE)
_MOST_HEADER = 2**24


class _Header(NamedTuple):
    """Header: its path, and its fields by name in lower case with single blanks, values without braces."""

    path: Path
    fields: dict[str, str]

    def number(self, name: str, default: float | None) -> float | None:
        """The number of a field, or the default without one. Raises DataError."""
        if not (text := self.fields.get(name, "")):
            return default
        try:
            return float(text)
        except ValueError:
            raise self.fault(f"`{name}` is {text!r}, no number: correct the header") from None

    def integer(self, name: str, default: int | None = None) -> int:
        """The whole number of a field, above zero where it has no default. Raises DataError."""
        value = self.number(name, None if default is None else float(default))
        if value is None or value != int(value) or value < 0 or (default is None and value == 0):
            written = self.fields.get(name, "missing")
            raise self.fault(f"`{name}` is {written!r}, no whole number: correct the header")
        return int(value)

    def numbers(self, name: str) -> np.ndarray:
        """The numbers of a field. Raises DataError."""
        try:
            return np.array([float(word) for word in re.split(r"[,\s]+", self.fields[name]) if word])
        except ValueError:
            raise self.fault(f"`{name}` is no list of numbers: correct the header") from None

    def fault(self, text: str) -> DataError:
        """The error of a header."""
        return DataError(f"{self.path}: {text}")


def _header_of(path: Path) -> Path | None:
    """The ENVI header of a file: itself, or the one beside it; None for a file of another format."""
    for header in (path, path.with_name(path.name + ".hdr"), path.with_suffix(".hdr")):
        if header.is_file():
            with open_binary(header) as file:
                if file.read(16).lstrip(b"\xef\xbb\xbf").startswith(b"ENVI"):
                    return header
    return None


def is_envi(path: Path) -> bool:
    """True for an ENVI header, or a file with one beside it."""
    return _header_of(path) is not None


def read_envi(path: Path, asked: Asked) -> RawCube:
    """Read the cube of an ENVI header, or of the data file beside one. Raises DataError or UsageError."""
    file = _header_of(path)
    assert file is not None, "the file was recognised by it"
    with open_binary(file) as opened:
        text = opened.read(_MOST_HEADER).decode("utf-8-sig", "replace")
    fields = {
        " ".join(name.lower().replace("_", " ").split()): " ".join(value.strip("{} \t\n").split())
        for name, value in _FIELD.findall(text.replace("\r\n", "\n").replace("\r", "\n"))
    }
    header = _Header(file, fields)
    stored = _stored(header, path if path != file else _data_file(file))
    mapped, bands = stored.data, stored.sizes["wavelength"]
    wavelength, unit = asked.wavelength, asked.unit
    if wavelength is None and "wavelength" in fields:
        wavelength, unit = header.numbers("wavelength"), fields.get("wavelength units")
    if wavelength is None:
        raise need_wavelengths(mapped.shape, str(file))
    if wavelength.size != bands:
        told = f"has {wavelength.size} wavelengths for {bands} bands: give one for each with `wavelengths`"
        raise header.fault(told)
    scaled = "reflectance scale factor" in fields
    divisor = header.number("reflectance scale factor", 1.0) or 1.0
    form = fields.get("interleave", "bsq").lower()
    notes = [f"ENVI, {form}, {mapped.dtype.name}, {Path(mapped.path).name}"]
    if "fwhm" in fields:
        notes.append(_width_note(header.numbers("fwhm"), unit))
    if divisor != 1.0:
        notes.append(f"values divided by {divisor:g}, the reflectance scale factor")
    good = header.numbers("bbl") != 0 if "bbl" in fields else None
    if good is not None and good.size != bands:
        raise header.fault(f"`bbl` has {good.size} numbers for {bands} bands: correct or delete it")
    return RawCube(
        str(path),
        {"values": stored},
        ("y", "x"),
        wavelength,
        unit,
        files=(file, Path(mapped.path)),
        signal="R" if scaled else None,
        signal_unit="fraction" if scaled else COUNTS if mapped.dtype.kind in "iu" else None,
        divisor=divisor,
        missing=header.number("data ignore value", None),
        good=good,
        notes=tuple(notes),
    )


def _stored(header: _Header, data: Path) -> Stored:
    """The numbers that a header describes. Raises DataError for what ENVI does not define."""
    fields = header.fields
    interleave = fields.get("interleave", "bsq").lower()
    if interleave not in _AXES:
        raise header.fault(f"`interleave` is {interleave!r}, not bsq, bil or bip: correct the header")
    code = header.integer("data type")
    if code not in _TYPES:
        raise header.fault(f"`data type` is {code}, which ENVI does not define: correct the header")
    if fields.get("file compression", "0") not in ("", "0"):
        raise header.fault("its data are compressed: save the cube without compression")
    if "spectral library" in fields.get("file type", "").lower():
        raise header.fault("is a spectral library and no image: export its spectra as CSV and fit them")
    dtype = np.dtype((">" if fields.get("byte order", "0") == "1" else "<") + _TYPES[code])
    names = {"y": "lines", "x": "samples", "wavelength": "bands"}
    shape = tuple(header.integer(names[axis]) for axis in _AXES[interleave])
    offset = header.integer("header offset", 0)
    needed = offset + int(np.prod(shape)) * dtype.itemsize
    if data.stat().st_size < needed:
        raise DataError(
            f"{data}: has {data.stat().st_size:,} bytes and its header {header.path.name} describes "
            f"{needed:,}: the copy is incomplete, or `lines`, `bands` or `data type` of the header are wrong"
        )
    return Stored(MappedFile(str(data), dtype, shape, offset), _AXES[interleave])


def _width_note(widths: np.ndarray, unit: str | None) -> str:
    width, shown = float(np.median(widths)), wavelength_unit(unit or "nm")
    if shown in ("um", "A"):
        width, shown = float(to_nm(np.array([width]), shown)[0]), "nm"
    return (
        f"bands are {width:g} {shown or unit} wide (fwhm of the header), which is not used: state it as "
        "bandwidth in the recipe's [instrument] where fringes are narrow"
    )


def _data_file(header: Path) -> Path:
    """The file of numbers beside a header: `cube`, `cube.img` or the like beside `cube.hdr`."""
    stem = header.name[: -len(header.suffix)]
    files = (file for file in header.parent.iterdir() if file.is_file() and file != header)
    beside = {file.name.lower(): file for file in files}
    for suffix in _SUFFIXES:
        if data := beside.get((stem + suffix).lower()):
            return data
    raise DataError(
        f"{header}: the file with its numbers is not beside it: looked for {stem} and "
        f"{', '.join(stem + suffix for suffix in _SUFFIXES[1:5])} and others; put it there"
    )
