"""Folders of spectra with a table of their positions, as wafer maps are exported."""

import csv
import io
import itertools
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from pellicle.data.cubes.raw_cube import ANGLE, WAVELENGTH, Asked, RawCube, Stored
from pellicle.data.photographs import image_format
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.text import decoded, open_binary
from pellicle.errors import DataError, UsageError

_FILES = ("file", "filename", "file name", "spectrum", "path")
_HEADER = re.compile(r"([^\s(\[_/]+)[\s_/]*[(\[]?\s*([^)\]]*)[)\]]?")
_TABLES = ("*.csv", "*.txt", "*.tsv")
_MOST_HEADER = 2**16
_TOLERANCE = 1e-6
"""Relative difference of wavelengths that are taken as equal: rounding of exported numbers."""


def is_table(path: Path) -> bool:
    """True for a table of positions of spectra."""
    return image_format(path) is None and table_of(path) is not None


def table_of(path: Path) -> Path | None:
    """The table of positions: `path` itself, or the only one in a folder; None where there is none."""
    if path.is_file():
        return path if _columns(path) else None
    tables = [file for pattern in _TABLES for file in sorted(path.glob(pattern)) if _columns(file)]
    if len(tables) > 1:
        raise UsageError(
            f"{path}: has several tables of positions, {', '.join(file.name for file in tables)}: name one "
            "of them instead of the folder"
        )
    return tables[0] if tables else None


def read_folder(path: Path, asked: Asked) -> RawCube:
    """Read the spectra of a table of positions. Raises DataError, or UsageError of a spectrum's reader."""
    table = table_of(path)
    if table is None:
        raise _no_table(path)
    names, where, units, notes = _rows(table)
    there = [i for i, name in enumerate(names) if (table.parent / name).is_file()]
    absent = [name for i, name in enumerate(names) if i not in there]
    if len(there) < len(absent):
        raise DataError(
            f"{table}: {len(absent)} of its {len(names)} files do not exist, the first is "
            f"{table.parent / absent[0]}: check their names, which are relative to the table"
        )
    if absent:
        sites = "1 site" if len(absent) == 1 else f"{len(absent)} sites"
        notes.append(f"{sites} without data, for lack of a file: {_shortened(absent)}")
    files = [table.parent / names[i] for i in there]
    read = partial(read_spectrum, signal=asked.signal, spectrum=asked.variable, wavelength_unit=asked.unit)
    spectra = [read(file) for file in files]
    first = spectra[0]
    for file, one in zip(files, spectra, strict=True):
        _compare(one, first, names[there[0]], file)
    arrays, angle = _arrays(spectra, table, np.array(there), len(names))
    return RawCube(
        str(path),
        arrays,
        ("site",),
        np.unique(first.wavelength),
        "nm",
        files=(table, *files),
        signal=first.signal,
        polarisation=first.polarisation,
        signal_unit=None if first.signal == "psi-delta" else "fraction",
        calibrated=first.calibrated,
        angle=angle,
        coords={"file": np.array(names), **{key: np.array(values) for key, values in where.items()}},
        units=units,
        notes=(f"{len(files)} spectra at the positions of {table.name}", *notes, *first.notes),
    )


def _no_table(path: Path) -> DataError:
    """The error for a folder that is neither a store nor a wafer map."""
    files = sorted(file.name for file in path.iterdir())
    headers = [name for name in files if name.lower().endswith(".hdr")]
    images = [name for name in files if name.lower().endswith((".tif", ".tiff"))]
    if headers:
        told = f"is a folder of ENVI files: name one of them, {_shortened(headers)}"
    elif len(images) > 1:
        remedy = "write them into one TIFF stack, a page for each wavelength"
        told = f"is a folder of {len(images)} images: {remedy}"
    elif not files:
        told = "is an empty folder: name that of a zarr store or of spectra, or a file"
    else:
        told = (
            "is a folder without a table of positions: name a file in it, or put a CSV with the columns file,"
            " x and y beside spectra"
        )
    return DataError(f"{path}: {told}")


def _shortened(names: Sequence[str]) -> str:
    """Names in a row, the first three of many."""
    return ", ".join(names) if len(names) <= 4 else f"{', '.join(names[:3])} and {len(names) - 3} others"


def _columns(file: Path) -> dict[str, tuple[int, str]]:
    """Column and unit of file, x, y and name of a table; empty for a file that is no table of positions."""
    columns: dict[str, tuple[int, str]] = {}
    _, header = next(_numbered_cells(file, _MOST_HEADER), (0, []))
    for i, cell in enumerate(header):
        plain = cell.strip().strip('"').lower()
        if plain in _FILES:
            columns.setdefault("file", (i, ""))
        elif (match := _HEADER.fullmatch(plain)) and match[1] in ("x", "y", "name", "site"):
            columns.setdefault(match[1], (i, match[2].strip()))
    return columns if {"file", "x", "y"} <= set(columns) else {}


def _numbered_cells(file: Path, most: int = -1) -> Iterator[tuple[int, Sequence[str]]]:
    """Number and cells of each line of a text that is neither blank nor a comment."""
    with open_binary(file) as opened:
        text = decoded(opened.read(most))
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            delimiter = next((mark for mark in "\t;," if mark in line), ",")
            yield number, next(csv.reader(io.StringIO(line), delimiter=delimiter), [])


def _rows(table: Path) -> tuple[list[str], dict[str, list[float | str]], dict[str, str], list[str]]:
    """Files and positions of a table, units of the positions, and notes."""
    columns = _columns(table)
    names: list[str] = []
    where: dict[str, list[float | str]] = {key: [] for key in columns if key != "file"}
    for number, cells in itertools.islice(_numbered_cells(table), 1, None):
        if len(cells) <= max(i for i, _ in columns.values()):
            raise DataError(f"{table}: line {number} has {len(cells)} cells, too few: complete or delete it")
        names.append(cells[columns["file"][0]].strip())
        for key in where:
            text = cells[columns[key][0]].strip()
            try:
                where[key].append(text if key in ("name", "site") else float(text))
            except ValueError:
                raise DataError(f"{table}: line {number}: {key} is {text!r}, no number: correct it") from None
    if not names:
        raise DataError(f"{table}: has no rows below its header: add one for each spectrum")
    units = {key: columns[key][1] or "mm" for key in ("x", "y")}
    assumed = not (columns["x"][1] and columns["y"][1])
    return names, where, units, ["positions in mm, assumed"] if assumed else []


def _compare(one: Spectrum, first: Spectrum, first_name: str, file: Path) -> None:
    """Refuse a spectrum of another kind or grid than the first. Raises DataError."""
    if one.signal != first.signal or one.polarisation != first.polarisation:
        raise DataError(
            f"{file}: has {one.signal} in {one.polarisation} light and {first_name} has {first.signal} in "
            f"{first.polarisation}: map files of one quantity"
        )
    if len(one) != len(first) or not np.allclose(one.wavelength, first.wavelength, _TOLERANCE, 0):
        raise DataError(
            f"{file}: its {len(one)} wavelengths from {one.wavelength[0]:g} to {one.wavelength[-1]:g} nm "
            f"differ from those of {first_name}, {len(first)} from {first.wavelength[0]:g} to "
            f"{first.wavelength[-1]:g} nm: export all on one grid"
        )
    mine, others = (np.zeros(0) if s.angle is None else s.angle for s in (one, first))
    if not np.array_equal(mine, others):
        raise DataError(f"{file}: its angles differ from those of {first_name}: map files of one geometry")


def _arrays(
    spectra: Sequence[Spectrum], table: Path, rows: np.ndarray, sites: int
) -> tuple[dict[str, Stored], np.ndarray | None]:
    """Arrays (sites, bands[, angles]) with the spectra at some `rows` and NaN at others, and the angles."""
    first = spectra[0]
    angle = None if first.angle is None else np.unique(first.angle)
    axes: tuple[str, ...] = ("site", WAVELENGTH)
    shape: tuple[int, ...] = (len(first),)
    if angle is not None and angle.size > 1:
        axes, shape = (*axes, ANGLE), (len(first) // angle.size, angle.size)
        if not np.array_equal(np.asarray(first.angle), np.tile(angle, shape[0])):
            raise DataError(f"{table}: its spectra have other wavelengths at each angle: export one grid")
    arrays = {}
    for name in ("values", "delta", "sigma", "delta_sigma"):
        read = [getattr(one, name) for one in spectra]
        if all(values is not None for values in read):
            arrays[name] = Stored(np.full((sites, *shape), np.nan), axes)
            arrays[name].data[rows] = np.reshape(read, (len(spectra), *shape))
    return arrays, angle
