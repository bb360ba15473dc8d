"""Tables of numbers in files, before their columns are interpreted."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.tabular.cells import TextCells
from pellicle.data.tabular.layout import Layout, find_layout
from pellicle.data.tabular.text import read_bytes, text_file


@dataclass(frozen=True, eq=False)
class Table:
    """A layout with the path and SHA-256 of its file."""

    path: str
    sha256: str
    layout: Layout

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how the file was read."""
        return (*self.layout.notes, *self.layout.cells.notes)

    @property
    def lines(self) -> np.ndarray | None:
        """Source line of each row, None for a binary file."""
        return self.layout.cells.lines

    @property
    def text(self) -> TextCells:
        """Cells of a text file. Raises TypeError for a binary one."""
        if isinstance(self.layout.cells, TextCells):
            return self.layout.cells
        raise TypeError(f"{self.path} is no text")

    def source_lines(self, rows: np.ndarray) -> np.ndarray | None:
        """Return the source lines of these rows, None for a binary file."""
        return None if self.lines is None else self.lines[rows]

    def __len__(self) -> int:
        return len(self.layout.cells)

    def label(self, position: int) -> str:
        """Return a column for a message: its name, or without one its number from 1."""
        names = self.layout.names or ()
        name = names[position] if position < len(names) else ""
        return f"column {name!r}" if name else f"column {position + 1}"

    def place(self, row: int) -> str:
        """Return the line of a row, for a message; for a binary file its number from 1."""
        return f"point {row + 1}" if self.lines is None else f"line {self.lines[row]}"

    def where(self, row: int, position: int) -> str:
        """Return file, line and column of a cell, for a message."""
        return f"{self.path}: {self.place(row)}, {self.label(position)}"

    def places(self, position: int, rows: np.ndarray | None = None) -> Callable[[int], str]:
        """Return `where` of one column as a function of the row, or of the position in `rows`."""
        return lambda row: self.where(row if rows is None else int(rows[row]), position)

    def numbers(self, positions: Sequence[int]) -> list[np.ndarray]:
        """Read the columns at `positions`, float64 and finite. Raises DataError for the first bad cell."""
        return self.layout.cells.numbers(positions, self.path, self.where)


def read_table(path: str | os.PathLike[str]) -> Table:
    """Find the layout of a text file of one table; cells are read later.

    Raises DataError for a file that cannot be read or has no rows of numbers.
    """
    file = text_file(*read_bytes(path), path)
    return Table(file.path, file.sha256, find_layout(file))
