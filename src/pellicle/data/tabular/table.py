"""Tables of numbers in files, before their columns are interpreted.

Large tables of plain rows are read as a block instead of line by line: the head of the file decides on the
layout as for any file, and the rows are given to a parser as they are. Whatever is unusual, errors included,
is left to the reader of lines, which names line and column.
"""

import io
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pellicle.data.tabular.cells import ArrayCells, TextCells
from pellicle.data.tabular.layout import Layout, find_layout
from pellicle.data.tabular.text import TextFile, read_bytes, text_file

SMALLEST = 2**20
"""Bytes below which the lines of a file are read one by one, in a few hundredths of a second."""
_HEAD = 2**14
_WORTH_IMPORTING = 2**26
"""Bytes from which importing pandas takes less time than it saves: it parses three times as fast as NumPy."""


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
        """Return `where` of one column as a function of the row, or of the position in `rows` (N,)."""
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


def bulk_layout(
    content: bytes, head: Callable[[bytes], TextFile], find: Callable[[TextFile], Layout | None]
) -> Layout | None:
    """Return the layout of a large file of plain rows with its numbers, None for any other file.

    `head` splits the beginning of the content into lines, `find` finds their layout, or None.
    """
    if len(content) < SMALLEST:
        return None
    end = content.rfind(b"\n", 0, _HEAD) + 1
    if not end:
        return None
    try:
        layout = find(head(content[:end]))
    except ValueError:
        return None
    if layout is None:
        return None
    cells = layout.cells
    if isinstance(cells, ArrayCells) or cells.raw_width != cells.width:
        return None
    first = int(cells.lines[0])
    start = 0
    for _ in range(first - 1):
        start = content.index(b"\n", start) + 1
    try:
        columns = _parsed(content, start, cells.delimiter, cells.decimal)
    except (ValueError, OverflowError):
        return None
    if len(columns) != cells.width or not all(np.isfinite(column).all() for column in columns):
        return None
    lines = np.arange(first, first + len(columns[0]))
    return replace(layout, cells=ArrayCells(columns, lines, cells.notes))


def _parsed(content: bytes, start: int, delimiter: str, decimal: str) -> tuple[np.ndarray, ...]:
    """The columns of the rows from byte `start` on. Raises ValueError for a cell that is no number."""
    if "pandas" in sys.modules or len(content) > _WORTH_IMPORTING:
        try:
            import pandas
        except ImportError:
            pass
        else:
            rows = io.BytesIO(content)  # shares the memory
            rows.seek(start)
            separator = r"\s+" if delimiter == " " else delimiter
            frame = pandas.read_csv(
                rows,
                sep=separator,
                header=None,
                decimal=decimal,
                dtype=np.float64,
                engine="c",
                skip_blank_lines=False,  # they are NaN
            )
            return tuple(frame[name].to_numpy() for name in frame)
    text = content[start:].replace(b",", b".") if decimal == "," else content[start:]
    blank = None if delimiter == " " else delimiter
    rows = np.loadtxt(io.StringIO(text.decode()), delimiter=blank, comments=None, ndmin=2)
    if len(rows) != text.count(b"\n") + (not text.endswith(b"\n")):
        raise ValueError("blank lines are passed over, which shifts the numbers of the others")
    return tuple(rows.T)
