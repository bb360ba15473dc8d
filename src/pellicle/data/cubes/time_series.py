"""Spectra of one film against time: a file for each time, or a column for each time."""

from __future__ import annotations

import csv
import datetime
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import WAVELENGTH, Asked, RawCube, Stored
from pellicle.data.read_spectrum import read_spectra
from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.text import decoded, open_binary
from pellicle.errors import DataError, UsageError

TIME = "time"
BY_NAME, BY_DATE, BY_HEADER = "name", "mtime", "header"
"""Sources of the times of files: their names, their dates, or a date in their first lines."""
_NUMBER = re.compile(
    r"(?<![\d.])(\d+(?:[.,]\d+)?)[ _]?(s|sec|min|h|hours?|minutes?|seconds?|d|ms|°C|C|K)?(?![A-Za-z\d.])"
)
_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?")
_HEADER = 2**14
_GRID = 1e-6
"""Relative difference of wavelengths that are one."""


def read_series(paths: Sequence[Path], time_from: str | None, asked: Asked) -> RawCube:
    """Read the spectra of several files, or of one with a column for each time, by increasing time.

    The file of a single spectrum has the time of its name, or by the clock. Files without a time in the table
    `time_from` are left out.

    **Raises:** DataError or UsageError, one sentence with the file and the remedy.
    """
    if not paths:
        raise UsageError("a series has no file: name the spectra of its times, or a folder that has them")
    read = partial(read_spectra, signal=asked.signal, wavelength_unit=asked.unit)
    spectra = read(paths[0], spectrum="all") if len(paths) == 1 else []
    if len(spectra) > 1:
        [path] = paths
        names = [one.name for one in spectra]
        where = f"the head of {path.name}"
        time, unit = _stated(names, time_from, path) if time_from else numbers_of(names, str(path), "columns")
    else:
        time, unit, where = file_times(list(paths), time_from or BY_NAME)
        known = np.flatnonzero(np.isfinite(time))
        where += f", files without one left out: {len(paths) - known.size}" * (known.size < len(paths))
        time, paths = np.asarray(time)[known], [paths[int(i)] for i in known]
        names = [path.name for path in paths]
        for path in [] if spectra else paths:
            found = read(path)
            if len(found) != 1:
                raise DataError(f"{path}: holds {len(found)} spectra, and a series of files has one in each")
            spectra.append(found[0])
    back = np.flatnonzero(np.diff(np.asarray(time)) < 0) if len(paths) == 1 else []
    by_time = [
        f"the times run back at {names[i + 1]}: the columns are taken by their times" for i in back[:1]
    ]
    order = np.argsort(time, kind="stable")
    twice = np.flatnonzero(np.diff(np.asarray(time)[order]) == 0)
    if twice.size:
        a, b = (names[order[twice[0] + i]] for i in (0, 1))
        told = f"{b} has the time of {a}, {time[order[twice[0]]]:g} {unit}"
        raise DataError(f"{paths[0] if len(paths) == 1 else paths[0].parent}: {told}: leave one of them out")
    first, arrays, wavelength, angle = spectra[0], *_arrays([spectra[i] for i in order])
    shared = [note for note in first.notes if all(note in one.notes for one in spectra)]  # not of its columns
    return RawCube(
        str(paths[0].parent if len(paths) > 1 else paths[0]),
        arrays,
        (TIME,),
        wavelength,
        "nm",
        files=tuple(paths),
        signal=first.signal,
        polarisation=first.polarisation,
        signal_unit=None if first.signal == "psi-delta" else "fraction",
        calibrated=first.calibrated,
        angle=angle,
        coords={TIME: np.asarray(time, float)[order]},
        units={TIME: unit},
        notes=(f"{len(spectra)} spectra, times from {where}", *by_time, *shared),
    )


def file_times(files: Sequence[Path], time_from: str) -> tuple[Any, str, str]:
    """Times of files, their unit, their source; by dates since the first, of one file since 1970."""
    if time_from == BY_NAME:
        path = files[0] if len(files) == 1 else files[0].parent
        return *numbers_of([file.stem for file in files], str(path), "files"), "the names of the files"
    if time_from == BY_DATE:
        stamps = np.array([file.stat().st_mtime for file in files])
        return *_since_first(stamps, datetime.UTC), "the dates of the files"
    if time_from == BY_HEADER:
        stamps = np.array([_date(file) for file in files])
        return *_since_first(stamps, None), "the dates in the files"
    check_time_from(time_from)
    return *_stated([file.name for file in files], time_from, files[0]), Path(time_from).name


def check_time_from(time_from: str) -> None:
    """Raise UsageError for a source of times that is neither a word nor a table."""
    if time_from not in (BY_NAME, BY_DATE, BY_HEADER) and not Path(time_from).is_file():
        raise UsageError(f"--time-from {time_from}: is no file, and not name, mtime or header")


def _since_first(stamps: np.ndarray, zone: datetime.timezone | None) -> tuple[np.ndarray, str]:
    """Seconds of several files since the first of them, with the unit that names its date in a `zone`."""
    if stamps.size < 2:
        return stamps, "s"
    first = datetime.datetime.fromtimestamp(float(stamps.min()), zone).replace(tzinfo=None)
    return stamps - stamps.min(), f"seconds since {first.isoformat()}"


def numbers_of(names: Sequence[str], path: str, what: str, unit: str | None = None) -> tuple[np.ndarray, str]:
    """The number in which names differ, with its unit, or counted in a `unit` of its own; of a single name
    the one that has a unit."""
    found = [_NUMBER.findall(name) for name in names]
    if len(names) == 1 and not found[0]:
        raise DataError(
            f"{path}: is one spectrum, whose name states no time: give a folder of spectra, a table with a"
            " column for each time, or --time-from FILE"
        )
    if any(len(one) != len(found[0]) for one in found) or not found[0]:
        raise DataError(f"{path}: the names of its {what} state no times: give a table with --time-from FILE")
    columns = [[one[i] for one in found] for i in range(len(found[0]))]
    differ = [i for i, column in enumerate(columns) if len({number for number, _ in column}) > 1]
    if len(names) == 1:
        differ = [i for i, [(_, unit)] in enumerate(columns) if unit]
    if len(differ) != 1:
        told = "differ in several numbers" if differ else "do not differ in a number"
        raise DataError(
            f"{path}: the names of its {what} {told}: give a table of times with --time-from FILE"
        )
    column = columns[differ[0]]
    units = {unit for _, unit in column} if unit is None else {unit}
    if len(units) > 1 or not units.copy().pop():
        raise DataError(
            f"{path}: the times in the names of its {what} have no unit: write 20s or 2 min, or give a table"
            " with --time-from FILE"
        )
    return np.array([float(number.replace(",", ".")) for number, _ in column]), units.pop()


def _date(file: Path) -> float:
    with open_binary(file) as opened:
        match = _DATE.search(decoded(opened.read(_HEADER)))
    if match is None:
        raise DataError(
            f"{file}: has no date such as 2026-05-04T12:30:00 in its first lines: use --time-from FILE"
        )
    return datetime.datetime.fromisoformat(match[0]).timestamp()


def _stated(names: Sequence[str], table: str, path: Path) -> tuple[Any, str]:
    """Times of names from a table with the columns file (or column) and time (unit)."""
    with open_binary(Path(table)) as opened:
        lines = [line for line in decoded(opened.read()).splitlines() if line.strip() and line[0] != "#"]
    rows = list(csv.reader(lines, delimiter="\t" if lines and "\t" in lines[0] else ","))
    head = [cell.strip() for cell in rows[0]] if rows else []
    unit = (
        re.fullmatch(r"time\s*[(\[_ ]\s*([^)\]]+?)\s*[)\]]?", head[1], re.IGNORECASE)
        if len(head) > 1
        else None
    )
    if unit is None:
        raise DataError(f"{table}: line 1 must name two columns, as in file,time (s)")
    known = {}
    for number, row in enumerate(rows[1:], 2):
        try:
            known[row[0].strip()] = float(row[1]) if row[1].strip() else np.nan
        except (ValueError, IndexError):
            raise DataError(f"{table}: row {number} is no name and time: correct {','.join(row)!r}") from None
    if absent := [name for name in names if name not in known]:
        raise DataError(f"{table}: has no time of {absent[0]}, which {path} needs: add a row")
    return np.array([known[name] for name in names]), unit[1]


def _arrays(spectra: Sequence[Spectrum]) -> tuple[dict[str, Stored], np.ndarray, np.ndarray | None]:
    """Arrays (times, bands) on the wavelengths of the longest spectrum; NaN where one has none there."""
    longest = max(spectra, key=len)
    for one in spectra:
        if (one.signal, one.polarisation) != (longest.signal, longest.polarisation):
            raise DataError(
                f"{one.path}: has {one.signal}, and {longest.path} has {longest.signal}: choose one"
            )
        if one.angle is not None and np.ptp(one.angle) > 0:
            raise DataError(f"{one.path}: has several angles, and a series takes one: choose it with --angle")
    nm = np.unique(longest.wavelength)
    if nm.size != len(longest):
        raise DataError(f"{longest.path}: has a wavelength twice: correct it")
    arrays: dict[str, Stored] = {}
    for name in ("values", "delta", "sigma", "delta_sigma"):
        if any(getattr(one, name) is None for one in spectra):
            continue
        rows = np.full((len(spectra), nm.size), np.nan)
        for row, one in zip(rows, spectra, strict=True):
            row[rows_on_grid(one.wavelength, nm, one.path, longest.path)] = getattr(one, name)
        arrays[name] = Stored(rows, (TIME, WAVELENGTH))
    angles = None if longest.angle is None else np.unique(longest.angle)
    return arrays, nm, angles


def rows_on_grid(wavelength: np.ndarray, grid: np.ndarray, path: str, of: str) -> np.ndarray:
    """Positions of wavelengths on the grid of the file `of`. Raises DataError for one that it lacks."""
    at = np.clip(np.searchsorted(grid, wavelength * (1 - _GRID)), 0, grid.size - 1)
    if not np.allclose(grid[at], wavelength, _GRID, 0):
        raise DataError(f"{path}: its wavelengths differ from those of {of}: use one grid")
    return at
