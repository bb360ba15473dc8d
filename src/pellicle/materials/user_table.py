"""n,k tables of one's own: text with a wavelength, n and, if known, k.

Separated by commas, semicolons, tabs or blanks; `#` begins a comment. With a header, columns are
found by name (`wavelength_nm`, `wl_um`, `lambda [µm]`, `energy_ev`; `n`; `k`, optional); without one
they are wavelength in nm, n, k.
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.errors import DataError
from pellicle.materials.database_page import NOISE_IN_K, Contents, table

if TYPE_CHECKING:
    import pandas as pd

_WAVELENGTH = {"wavelength", "wavelengths", "wl", "lambda", "λ"}
_UNITS = {"nm": "nm", "um": "um", "µm": "um", "μm": "um", "micron": "um", "microns": "um", "a": "A", "å": "A"}
_EV_NM = 1239.841984
_IN_NM = {"nm": lambda x: x, "um": lambda x: 1e3 * x, "A": lambda x: 0.1 * x, "eV": lambda x: _EV_NM / x}
_REMEDY = "write the table as wavelength_nm,n,k"


def _decode(path: Path) -> str:
    if path.is_dir():
        raise DataError(f"{path} is a directory, expected an n,k table: name a file in it")
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise DataError(f"{path}: no such file: check the name, or give a catalogue name like SiO2") from None
    except OSError as error:
        raise DataError(f"{path} cannot be read ({error.strerror}): check its permissions") from None
    if b"\0" in raw:
        raise DataError(f"{path} is not text: export it as CSV ({_REMEDY})")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _lines(path: Path) -> list[tuple[int, str]]:
    """Numbered lines without comments and without empty ones."""
    bare = ((i, line.split("#")[0].strip()) for i, line in enumerate(_decode(path).splitlines(), start=1))
    lines = [(i, line) for i, line in bare if line]
    if not lines:
        raise DataError(f"{path} is empty: {_REMEDY}")
    return lines


def _frame(path: Path, lines: list[tuple[int, str]]) -> pd.DataFrame:
    """The cells as text, indexed by line number."""
    import pandas as pd

    first = lines[-1][1]
    separator = next((s for s in ";\t," if s in first), None)
    if separator == ";" and "," in first and "." not in first:  # decimal commas
        lines = [(i, line.replace(",", ".")) for i, line in lines]
    split = [re.split(r"\s+", line) if separator is None else line.split(separator) for _, line in lines]
    width = len(split[0])
    for (number, _), cells in zip(lines, split, strict=True):
        if len(cells) != width:
            raise DataError(
                f"{path}, line {number}: expected {width} columns as in line {lines[0][0]}, "
                f"found {len(cells)}: correct or remove that line"
            )
    text = "\n".join("\t".join(cell.strip() for cell in cells) for cells in split)
    frame = pd.read_csv(io.StringIO(text), sep="\t", header=None, dtype=str, keep_default_na=False)
    return frame.set_index(pd.Index([number for number, _ in lines]))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _column(header: str) -> tuple[str, str | None]:
    """What a header's word means: ("wavelength", unit or None), ("n", None), ("k", None), or ("", None)."""
    words = [word for word in re.split(r"[\s_()\[\]/,.]+", header.strip().strip('"').lower()) if word]
    if not words:
        return "", None
    if words in (["n"], ["k"]):
        return words[0], None
    if words[0] in {"energy", "photon", "ev", "e"} and words[-1] == "ev":
        return "wavelength", "eV"
    if words[0] in _WAVELENGTH and len(words) <= 2:
        unit = _UNITS.get(words[-1]) if len(words) == 2 else None
        return ("wavelength", unit) if unit or len(words) == 1 else ("", None)
    if len(words) == 1 and words[0] in _UNITS and words[0] not in "aå":
        return "wavelength", _UNITS[words[0]]
    return "", None


def _by_header(path: Path, line: int, header: list[str]) -> tuple[dict[str, int], str | None]:
    """Where wavelength, n and k are, and the unit that the header gives."""
    places: dict[str, int] = {}
    unit = None
    for place, word in enumerate(header):
        what, found = _column(word)
        if what in places:
            raise DataError(f"{path}, line {line}: two columns are called {what}: keep one, or {_REMEDY}")
        if what:
            places[what] = place
            unit = found if what == "wavelength" else unit
    for what in ("wavelength", "n"):
        if what not in places:
            raise DataError(
                f"{path}, line {line}: expected a column for {what}, found {', '.join(header)}: {_REMEDY}"
            )
    return places, unit


def _numbers(path: Path, frame: pd.DataFrame, place: int, name: str) -> np.ndarray:
    import pandas as pd

    values = pd.to_numeric(frame[place], errors="coerce").to_numpy(dtype=float)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        cell = frame[place].iloc[bad[0]]
        raise DataError(
            f"{path}, line {frame.index[bad[0]]}, column {name}: expected a number, "
            f"found {cell!r}: correct or remove that line"
        )
    return values


def _check(path: Path, lines: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    limits = {
        "wavelength": (lambda x: x > 0, "above 0", "correct it"),
        "n": (lambda x: x > 0, "above 0", "correct it"),
        "k": (lambda x: x >= -NOISE_IN_K, "0 or above", "absorption is n + ik with k ≥ 0, so turn its sign"),
    }
    for name, values in columns.items():
        test, expected, remedy = limits[name]
        bad = np.flatnonzero(~test(values))
        if bad.size:
            raise DataError(
                f"{path}, line {lines[bad[0]]}, column {name}: expected a number {expected}, "
                f"found {values[bad[0]]:g}: {remedy}"
            )
    steps = np.diff(columns["wavelength"])
    if not steps.size:
        raise DataError(f"{path}: expected at least two wavelengths, found one: {_REMEDY}, one row each")
    turn = np.flatnonzero(steps * np.sign(steps[0]) <= 0)
    if turn.size:
        raise DataError(
            f"{path}, line {lines[turn[0] + 1]}, column wavelength: expected wavelengths that only rise "
            f"or only fall, found {columns['wavelength'][turn[0] + 1]:g} after "
            f"{columns['wavelength'][turn[0]]:g}: sort the rows and remove repeated ones"
        )


def _unit(path: Path, unit: str | None, values: np.ndarray) -> str:
    if unit is None and values.max() < 100:
        raise DataError(
            f"{path}: wavelengths up to {values.max():g} without a unit look like µm, where nm is expected: "
            "name the column wavelength_um or wavelength_nm"
        )
    return unit or "nm"


def read_table(path: str | Path) -> Contents:
    """Read an n,k table; k is optional. Raises DataError: one sentence with file, line and remedy."""
    path = Path(path)
    frame = _frame(path, _lines(path))
    header = [str(cell) for cell in frame.iloc[0]]
    if any(_is_number(cell) for cell in header):
        if not 2 <= len(header) <= 3:
            raise DataError(
                f"{path}, line {frame.index[0]}: expected 2 or 3 columns without a header, "
                f"found {len(header)}: {_REMEDY}, with that header"
            )
        places, unit = dict(zip(("wavelength", "n", "k"), range(len(header)), strict=False)), None
    else:
        places, unit = _by_header(path, int(frame.index[0]), header)
        frame = frame.iloc[1:]
    if not len(frame):
        raise DataError(f"{path} has a header and no rows: {_REMEDY}")
    columns = {name: _numbers(path, frame, place, name) for name, place in places.items()}
    _check(path, frame.index.to_numpy(), columns)
    unit = _unit(path, unit, columns["wavelength"])
    found = table(np.round(_IN_NM[unit](columns["wavelength"]), 9), columns["n"], columns.get("k"))
    return Contents(found.dispersion, (found.low, found.high), "k" in columns)
