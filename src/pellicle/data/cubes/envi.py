"""ENVI cubes: a text header `.hdr` and a file of numbers beside it, read block by block.

**Source**: NV5 Geospatial, ENVI Header Files, https://www.nv5geospatialsoftware.com/docs/enviheaderfiles.html
"""

import re
from pathlib import Path

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
    header = _header_of(path)
    assert header is not None, "the file was recognised by it"
    fields = _fields(header)
    stored = _stored(fields, header, path if path != header else _data_file(header))
    mapped, bands = stored.data, stored.sizes["wavelength"]
    wavelength, unit = asked.wavelength, asked.unit
    if wavelength is None and "wavelength" in fields:
        wavelength, unit = _numbers(fields, "wavelength", header), fields.get("wavelength units")
    if wavelength is None:
        raise need_wavelengths(mapped.shape, str(header))
    if wavelength.size != bands:
        raise DataError(
            f"{header}: has {wavelength.size} wavelengths for {bands} bands: give one for each with "
            "`wavelengths`"
        )
    scaled = "reflectance scale factor" in fields
    divisor = _number(fields, "reflectance scale factor", header, 1.0) or 1.0
    form = fields.get("interleave", "bsq").lower()
    notes = [f"ENVI, {form}, {mapped.dtype.name}, {Path(mapped.path).name}"]
    if "fwhm" in fields:
        notes.append(_width_note(_numbers(fields, "fwhm", header), unit))
    if divisor != 1.0:
        notes.append(f"values divided by {divisor:g}, the reflectance scale factor")
    good = None
    if "bbl" in fields:
        good = _numbers(fields, "bbl", header) != 0
        if good.size != bands:
            raise DataError(
                f"{header}: `bbl` has {good.size} numbers for {bands} bands: correct or delete it"
            )
    return RawCube(
        str(path),
        {"values": stored},
        ("y", "x"),
        wavelength,
        unit,
        files=(header, Path(mapped.path)),
        signal="R" if scaled else None,
        signal_unit="fraction" if scaled else COUNTS if mapped.dtype.kind in "iu" else None,
        divisor=divisor,
        missing=_number(fields, "data ignore value", header, None),
        good=good,
        notes=tuple(notes),
    )


def _stored(fields: dict[str, str], header: Path, data: Path) -> Stored:
    """The numbers that a header describes. Raises DataError for what ENVI does not define."""
    interleave = fields.get("interleave", "bsq").lower()
    if interleave not in _AXES:
        raise DataError(f"{header}: `interleave` is {interleave!r}, not bsq, bil or bip: correct the header")
    code = _integer(fields, "data type", header)
    if code not in _TYPES:
        raise DataError(f"{header}: `data type` is {code}, which ENVI does not define: correct the header")
    if fields.get("file compression", "0") not in ("", "0"):
        raise DataError(f"{header}: its data are compressed: save the cube without compression")
    if "spectral library" in fields.get("file type", "").lower():
        raise DataError(
            f"{header}: is a spectral library and no image: export its spectra as CSV and fit them"
        )
    dtype = np.dtype((">" if fields.get("byte order", "0") == "1" else "<") + _TYPES[code])
    names = {"y": "lines", "x": "samples", "wavelength": "bands"}
    shape = tuple(_integer(fields, names[axis], header) for axis in _AXES[interleave])
    offset = _integer(fields, "header offset", header, 0)
    needed = offset + int(np.prod(shape)) * dtype.itemsize
    if data.stat().st_size < needed:
        raise DataError(
            f"{data}: has {data.stat().st_size:,} bytes and its header {header.name} describes {needed:,}: "
            "the copy is incomplete, or `lines`, `bands` or `data type` of the header are wrong"
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


def _fields(header: Path) -> dict[str, str]:
    """Fields of a header by name in lower case with single blanks, values without braces."""
    with open_binary(header) as file:
        text = file.read(_MOST_HEADER).decode("utf-8-sig", "replace")
    return {
        " ".join(name.lower().replace("_", " ").split()): " ".join(value.strip("{} \t\n").split())
        for name, value in _FIELD.findall(text.replace("\r\n", "\n").replace("\r", "\n"))
    }


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


def _integer(fields: dict[str, str], name: str, header: Path, default: int | None = None) -> int:
    value = _number(fields, name, header, None if default is None else float(default))
    if value is None or value != int(value) or value < 0 or (default is None and value == 0):
        raise DataError(
            f"{header}: `{name}` is {fields.get(name, 'missing')!r}, no whole number: correct the header"
        )
    return int(value)


def _number(fields: dict[str, str], name: str, header: Path, default: float | None) -> float | None:
    text = fields.get(name, "")
    if not text:
        return default
    try:
        return float(text)
    except ValueError:
        raise DataError(f"{header}: `{name}` is {text!r}, no number: correct the header") from None


def _numbers(fields: dict[str, str], name: str, header: Path) -> np.ndarray:
    try:
        return np.array([float(word) for word in re.split(r"[,\s]+", fields[name]) if word])
    except ValueError:
        raise DataError(f"{header}: `{name}` is no list of numbers: correct the header") from None
