"""Tables of numbers in text files, before their columns are interpreted.

One pass over the lines finds the layout and `numpy.loadtxt` reads the numbers. Only a file that fails is read
cell by cell, to name the faulty line and column.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.tabular.layout import DELIMITERS, Layout, find_layout
from pellicle.data.tabular.text import Line, content_lines, is_number, read_text, split
from pellicle.errors import DataError


@dataclass(frozen=True, eq=False)
class Table:
    """A file's layout with its path, SHA-256 and comments; `lines` are the source lines of the rows."""

    path: str
    sha256: str
    layout: Layout
    lines: np.ndarray
    comments: Sequence[Line] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how the file was read."""
        comma = ", decimal commas" if self.layout.decimal == "," else ""
        return (*self.layout.notes, f"columns separated by {DELIMITERS[self.layout.delimiter]}{comma}")

    def label(self, position: int) -> str:
        """Return a column for a message: its name, or without one its number from 1."""
        names = self.layout.names or ()
        name = names[position] if position < len(names) else ""
        return f"column {name!r}" if name else f"column {position + 1}"

    def where(self, row: int, position: int) -> str:
        """Return file, line and column of a cell, for a message."""
        return f"{self.path}: line {self.lines[row]}, {self.label(position)}"

    def places(self, position: int, rows: np.ndarray | None = None) -> Callable[[int], str]:
        """Return `where` of one column as a function of the row, or of the position in `rows`."""
        return lambda row: self.where(row if rows is None else int(rows[row]), position)

    def numbers(self, positions: Sequence[int]) -> list[np.ndarray]:
        """Read the columns at `positions`, float64 and finite. Raises DataError for the first bad cell."""
        delimiter = None if self.layout.delimiter == " " else self.layout.delimiter
        rows = [line.bare for line in self.layout.rows]
        if any(len(row.split(delimiter)) > self.layout.raw_width for row in rows):
            return self._numbers_by_cell(positions)
        if self.layout.decimal == ",":
            rows = [row.replace(",", ".") for row in rows]
        try:
            options = {"delimiter": delimiter, "comments": None, "quotechar": '"', "ndmin": 2}
            found = np.loadtxt(rows, usecols=positions, **options).T
        except ValueError:  # a cell that is empty, missing or no number
            return self._numbers_by_cell(positions)
        if found.shape[1] == len(rows) and np.isfinite(found).all():
            return [np.ascontiguousarray(column) for column in found]
        return self._numbers_by_cell(positions)

    def _numbers_by_cell(self, positions: Sequence[int]) -> list[np.ndarray]:
        columns: list[list[float]] = [[] for _ in positions]
        for row, line in enumerate(self.layout.rows):
            cells = split(line.bare, self.layout.delimiter)
            if len(cells) > self.layout.width:
                hint = "; a decimal comma looks like this" if self.layout.delimiter == "," else ""
                raise DataError(
                    f"{self.path}: line {line.number} has {len(cells)} values where {self.layout.width} "
                    f"are expected; correct that line{hint}"
                )
            for column, position in zip(columns, positions, strict=True):
                column.append(self._number(cells[position] if position < len(cells) else "", row, position))
        return [np.array(column) for column in columns]

    def _number(self, cell: str, row: int, position: int) -> float:
        where = self.where(row, position)
        if not cell:
            raise DataError(f"{where} is empty; fill it in or delete that row")
        if not is_number(cell, self.layout.decimal):
            raise DataError(f"{where}: expected a number but found {cell!r}; correct or delete that row")
        value = float(cell.replace(",", "."))
        if not np.isfinite(value):
            raise DataError(f"{where}: {cell} is not a finite number; delete that row or put # before it")
        return value


Finder = Callable[[Sequence[Line], Sequence[Line], str], Layout | None]


def read_table(path: str | os.PathLike[str], export: Finder | None = None) -> Table:
    """Find the layout of a text file; cells are read later.

    `export` is tried first: it returns the layout of an instrument's format, or None.
    Raises DataError for a file that cannot be read or has no rows of numbers.
    """
    text, digest = read_text(path)
    lines, comments = content_lines(text)
    if not lines:
        raise DataError(f"{path}: has only comments; expected rows of numbers")
    layout = export(lines, comments, str(path)) if export else None
    layout = layout or find_layout(lines, comments, str(path))
    return Table(str(path), digest, layout, np.array([line.number for line in layout.rows]), comments)
