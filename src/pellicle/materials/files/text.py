"""Lines and rows of numbers of a material file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pellicle.data.tabular.text import decoded, foreign_format, is_number, open_binary
from pellicle.errors import DataError

_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
LARGEST = 64 * 2**20
"""Largest material file, in bytes: a million rows."""


class Line(NamedTuple):
    """A line that is neither blank nor a `#` comment: its number from 1, and its text before any `#`."""

    number: int
    text: str


@dataclass(frozen=True)
class MaterialText:
    """Text of a material file, and its lines."""

    path: str
    text: str
    lines: tuple[Line, ...]

    @property
    def suffix(self) -> str:
        """Suffix of the file in lower case, as `.mat`."""
        return Path(self.path).suffix.lower()


@dataclass(frozen=True)
class Rows:
    """Columns of numbers by name, and the source line of each row."""

    path: str
    lines: Sequence[int]
    columns: dict[str, np.ndarray]

    def where(self, row: int, name: str) -> str:
        """Return file, line and column of a number, for a message."""
        return f"{self.path}: line {self.lines[row]}, column {name!r}"


def read_lines(path: str | Path) -> MaterialText:
    """Read a text file: UTF-8, UTF-16 or Latin-1.

    Raises DataError for a file that is missing, empty, too large or not a text.
    """
    with open_binary(path) as file:
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise DataError(f"{path}: is larger than {LARGEST >> 20} MB, which is no table of optical constants")
    if content.startswith(b"MATLAB "):
        raise DataError(f"{path}: is a MATLAB file; save its table as text with the header wavelength_nm,n,k")
    if advice := foreign_format(content):
        raise DataError(f"{path}: is {advice}")
    text = decoded(content).rstrip("\x1a")
    if _CONTROL.search(text):
        raise DataError(f"{path}: is a binary file; export it as text (CSV) first")
    if not text.strip():
        raise DataError(f"{path}: is empty; expected rows of wavelength, n and k")
    plain = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    numbered = (Line(i, line.partition("#")[0].strip()) for i, line in enumerate(plain, start=1))
    return MaterialText(str(path), "\n".join(plain), tuple(line for line in numbered if line.text))


def cells(text: str) -> list[str]:
    """Split a row at blanks, tabs and semicolons, else at commas; a decimal comma becomes a point."""
    found = re.split(r"[\s;]+", text.strip().strip(";").strip())
    if len(found) == 1:
        return [cell.strip() for cell in text.rstrip(",").split(",")]
    return [cell.removesuffix(",").replace(",", ".") for cell in found]


def is_row(text: str) -> bool:
    """Return True for a line of two or more numbers and nothing else."""
    found = cells(text)
    return len(found) >= 2 and all(is_number(cell) for cell in found)


def read_rows(path: str, lines: Sequence[Line], names: Sequence[str], optional: int = 0) -> Rows:
    """Read lines as rows of the columns `names`, of which all rows may lack the last `optional`.

    Raises DataError for no rows, for a row of another length, and for a cell that is no finite number.
    """
    if not lines:
        raise DataError(f"{path}: ends without a row of {', '.join(names)}; export it again")
    width = len(cells(lines[0].text))
    if not len(names) - optional <= width <= len(names):
        raise DataError(
            f"{path}: line {lines[0].number} has {width} values where {', '.join(names)} are expected; "
            "correct that line"
        )
    table = np.empty((len(lines), width))
    for i, (number, text) in enumerate(lines):
        row = cells(text)
        if len(row) != width:
            raise DataError(
                f"{path}: line {number} has {len(row)} value{'s' * (len(row) != 1)} where {width} are "
                "expected; correct or delete that line"
            )
        for j, cell in enumerate(row):
            if not is_number(cell) or not np.isfinite(value := float(cell)):
                raise DataError(
                    f"{path}: line {number}, column {names[j]!r}: expected a finite number but found "
                    f"{cell!r}; correct or delete that row"
                )
            table[i, j] = value
    return Rows(path, [line.number for line in lines], dict(zip(names, table.T, strict=False)))
