"""Wavelengths of the bands of a cube: their unit, checks, and the bands to use."""

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pellicle.data.tabular.axis import LONGEST_ASSUMED, SHORTEST_ASSUMED
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.units import WAVELENGTH_UNITS, to_nm, wavelength_unit
from pellicle.errors import DataError, UsageError

_SHORTEST, _LONGEST = 10.0, 1e6
"""Bands in nm outside these limits (soft X-rays, 1 mm) come from a mistaken unit."""
_METRES = ("m", "meter", "meters", "metre", "metres")
_NO_UNIT = ("", "unknown", "index", "none", "-")
_MOST = 100_000
_EXAMPLE = "as in 400:900:5, 450,550,650 or a file with one number a line"


def parse_wavelengths(value: str | os.PathLike[str] | Sequence[float] | np.ndarray) -> tuple[np.ndarray, str]:
    """Return the wavelengths of `400:900:5`, of `450,550,650`, of a file or of an array, and their unit.

    The unit is empty unless the first line of the file names it. Raises UsageError.
    """
    if not isinstance(value, str | os.PathLike):
        given = np.asarray(value, dtype=float)
        if given.ndim != 1 or not given.size:
            raise UsageError(f"`wavelengths` must be one list of numbers, {_EXAMPLE}")
        return given, ""
    text = os.fspath(value)
    unit = ""
    if Path(text).is_file():
        if text.endswith(".npy"):
            return np.load(text).astype(float).reshape(-1), ""
        words, unit = _words_of_file(Path(text))
    elif ":" in text:
        return _evenly(text), ""
    else:
        words = [word for word in text.split(",") if word.strip()]
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.array([])
    if not numbers.size:
        raise UsageError(
            f"`wavelengths` {text!r} is no list of numbers and no file of them: give them {_EXAMPLE}"
        )
    return numbers, unit


def _words_of_file(path: Path) -> tuple[list[str], str]:
    """Numbers of a file, or of the column of wavelengths that its header names, and their unit.

    Raises UsageError for a header of several columns without wavelengths.
    """
    lines = [line.strip() for line in path.read_text("utf-8-sig").splitlines() if line.strip()]
    if not lines or re.match(r"[\d.]", lines[0]):
        return [word for line in lines for word in re.split(r"[\s,;]+", line) if word], ""
    header = lines.pop(0).strip("# ")
    delimiter = next((mark for mark in "\t;," if mark in header), None)
    names = [name.strip().strip('"') for name in header.split(delimiter)] if delimiter else [header]
    if delimiter != ",":  # a comma is a decimal point
        lines = [re.sub(r"(\d),(\d)", r"\1.\2", line) for line in lines]
    columns = [recognise(name) for name in names]
    at = next((i for i, column in enumerate(columns) if column.role == "wavelength"), 0)
    rows = [line.split(delimiter) for line in lines]
    if len(columns) == 1:
        return [word for line in lines for word in re.split(r"[\s,;]+", line) if word], columns[0].unit or ""
    if columns[at].role != "wavelength" or any(len(row) != len(columns) for row in rows):
        raise UsageError(
            f"`wavelengths` {str(path)!r} has several columns, {', '.join(names)}: keep that of the "
            "wavelengths only"
        )
    return [row[at] for row in rows], columns[at].unit or ""


def _evenly(text: str) -> np.ndarray:
    try:
        start, stop, step = (float(part) for part in text.split(":"))
        count = round((stop - start) / step)
        if not 1 <= count <= _MOST or abs(start + count * step - stop) > 1e-6 * abs(step):
            raise ValueError
    except (ValueError, ZeroDivisionError):
        raise UsageError(
            f"`wavelengths` {text!r} is not START:STOP:STEP with a whole number of steps: give them "
            f"{_EXAMPLE}"
        ) from None
    return start + step * np.arange(count + 1)


def in_nm(
    values: np.ndarray, written: str | None, requested: str | None, path: str
) -> tuple[np.ndarray, list[str]]:
    """Convert the wavelengths of bands to nm; returns them in their order, and notes.

    `written` is the unit that the file states, `requested` that of the caller, which is taken first. Raises
    DataError for impossible wavelengths, UsageError for an unknown unit.
    """
    values = np.asarray(values, dtype=float)
    if not values.size:
        raise DataError(f"{path}: has no bands")
    if np.any(~np.isfinite(values) | (values <= 0)):
        wrong = int(np.argmax(~np.isfinite(values) | (values <= 0)))
        raise DataError(
            f"{path}: the wavelength of band {wrong + 1} is {values[wrong]:g}, not above zero: correct the "
            "file, or give `wavelengths`"
        )
    unit = wavelength_unit(requested) if requested else None
    if requested and unit is None:
        raise UsageError(f"`wavelength_unit` must be one of {', '.join(WAVELENGTH_UNITS)}, not {requested!r}")
    notes = []
    if unit is None and written is not None and written.strip().lower() in _METRES:
        values, unit, written = values * 1e9, "nm", "m"
    elif unit is None and written is not None and written.strip().lower() not in _NO_UNIT:
        unit = wavelength_unit(written)
        if unit is None:
            raise DataError(
                f"{path}: its wavelengths are in an unknown unit {written!r}; state one of "
                f"{', '.join(WAVELENGTH_UNITS)} with `wavelength_unit`"
            )
    assumed = unit is None
    shortest, longest = (SHORTEST_ASSUMED, LONGEST_ASSUMED) if assumed else (_SHORTEST, _LONGEST)
    nm = to_nm(values, unit or "nm")
    if nm.min() < shortest or nm.max() > longest:
        raise DataError(
            f"{path}: its wavelengths run from {values.min():g} to {values.max():g}"
            + (", which is unlike nm" if assumed else f" {unit}, which is no wavelength of light")
            + f"{_likely(values)}; state their unit with `wavelength_unit`"
        )
    _refuse_repeated(nm, path)
    if assumed:
        notes.append("wavelength unit: nm, assumed")
    else:
        shown = "m" if written == "m" and not requested else unit
        notes.append(f"wavelength unit: {shown}" + ("" if shown == "nm" else ", converted to nm"))
    if np.any(np.diff(nm) < 0):
        notes.append("bands sorted by wavelength")
    return nm, notes


def _likely(values: np.ndarray) -> str:
    """Name the unit in which `values` would be those of visible or near infrared light."""
    low, high = values.min(), values.max()
    fits = [
        shown
        for shown, limits in (
            ("µm", (0.1, 30.0)),
            ("nm", (100.0, 30000.0)),
            ("Å", (1500.0, 20000.0)),
            ("cm-1", (300.0, 60000.0)),
        )
        if limits[0] <= low and high <= limits[1]
    ]
    return f" and looks like {' or '.join(fits)}" if fits else ""


def _refuse_repeated(nm: np.ndarray, path: str) -> None:
    order = np.argsort(nm, kind="stable")
    same = np.flatnonzero(np.diff(nm[order]) <= 1e-9 * nm.max())
    if same.size:
        first, second = sorted(order[same[0] : same[0] + 2])
        raise DataError(
            f"{path}: bands {first + 1} and {second + 1} have the same wavelength, {nm[first]:.6g} nm: "
            "correct it, or give `wavelengths`"
        )


def chosen_bands(
    nm: np.ndarray,
    range: tuple[float, float] | None,
    without: str | Sequence[tuple[float, float]] | None,
    good: np.ndarray | None,
    path: str,
) -> tuple[np.ndarray, list[str]]:
    """Return the numbers of the bands to use, by increasing wavelength, and notes on those left out."""
    used, notes = np.ones(nm.size, bool), []
    if range is not None:
        used &= (nm >= range[0]) & (nm <= range[1])
    if good is not None and not np.all(good):
        used &= np.asarray(good, bool)
        notes.append(f"{int(np.sum(~np.asarray(good, bool)))} bands left out, which the file marks as bad")
    if without is not None:
        dead = np.zeros(nm.size, bool)
        step = np.median(np.abs(np.diff(nm))) if nm.size > 1 else 1.0
        for low, high in _intervals(without):
            inside = (nm >= low) & (nm <= high)
            if low == high:
                nearest = np.abs(nm - low)
                inside = (nearest == nearest.min()) & (nearest <= max(step, 1e-6))
            if not inside.any():
                raise UsageError(
                    f"{path}: `without_bands` has no band at {low:g}:{high:g} nm; leave that out"
                )
            dead |= inside
        used &= ~dead
        notes.append(f"{int(dead.sum())} bands left out, as asked")
    if not used.any():
        raise UsageError(
            f"{path}: no band is left of {nm.size} from {nm.min():g} to {nm.max():g} nm: widen `range`, or "
            "leave out fewer bands"
        )
    order = np.argsort(nm, kind="stable")
    return order[used[order]], notes


def _intervals(without: str | Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    if not isinstance(without, str):
        return [(float(low), float(high)) for low, high in without]
    intervals = []
    try:
        for word in without.split(","):
            low, _, high = word.partition(":")
            intervals.append((float(low), float(high or low)))
    except ValueError:
        raise UsageError(
            "`without_bands` must be wavelengths in nm, LO:HI or single ones, as in 755:775,820, not "
            f"{without!r}"
        ) from None
    return intervals
