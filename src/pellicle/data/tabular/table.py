"""The numbers of a text file, before anything is known of their meaning.

One pass over the lines finds the layout, pandas reads the numbers, and only a file that fails is
gone through cell by cell to name the line and column at fault.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import StringIO

import numpy as np

from pellicle.data.tabular.layout import DELIMITERS, Layout, find_layout
from pellicle.data.tabular.text import Line, content_lines, is_number, read_text, split
from pellicle.errors import DataError


@dataclass(frozen=True, eq=False)
class Table:
    """A file's layout with its path, SHA-256 and comments; `lines` is the source line of each row."""

    path: str
    sha256: str
    layout: Layout
    lines: np.ndarray
    comments: Sequence[Line] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was found."""
        comma = ", decimal commas" if self.layout.decimal == "," else ""
        return (*self.layout.notes, f"columns separated by {DELIMITERS[self.layout.delimiter]}{comma}")

    def label(self, position: int) -> str:
        """A column for a message: its name if it has one, else its number from 1."""
        names = self.layout.names or ()
        name = names[position] if position < len(names) else ""
        return f"column {name!r}" if name else f"column {position + 1}"

    def where(self, row: int, position: int) -> str:
        """File, line and column for a message about one cell."""
        return f"{self.path}: line {self.lines[row]}, {self.label(position)}"

    def numbers(self, positions: Sequence[int]) -> list[np.ndarray]:
        """The columns at `positions`, float64 and finite. Raises DataError naming the first bad cell."""
        import pandas as pd  # takes 0.3 s to import, and only a reader needs it

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)  # the first row is too long
                frame = pd.read_csv(
                    StringIO("\n".join(line.bare for line in self.layout.rows)),
                    sep=r"\s+" if self.layout.delimiter == " " else self.layout.delimiter,
                    header=None,
                    names=list(range(self.layout.raw_width)),
                    index_col=False,
                    decimal=self.layout.decimal,
                    skipinitialspace=True,
                    skip_blank_lines=False,
                    low_memory=False,
                )
        except (
            ValueError,
            pd.errors.ParserWarning,
        ):  # a ParserError is a ValueError: a later row is too long
            return self._numbers_by_cell(positions)
        found = [frame[position].to_numpy() for position in positions]
        if len(frame) == len(self.lines) and all(_is_finite(values) for values in found):
            return [values.astype(np.float64) for values in found]
        return self._numbers_by_cell(positions)

    def _numbers_by_cell(self, positions: Sequence[int]) -> list[np.ndarray]:
        found: list[list[float]] = [[] for _ in positions]
        for row, line in enumerate(self.layout.rows):
            cells = split(line.bare, self.layout.delimiter)
            if len(cells) > self.layout.width:
                hint = "; a decimal comma looks like this" if self.layout.delimiter == "," else ""
                raise DataError(
                    f"{self.path}: line {line.number} has {len(cells)} values where {self.layout.width} "
                    f"are expected; correct that line{hint}"
                )
            for column, position in zip(found, positions, strict=True):
                column.append(self._number(cells[position] if position < len(cells) else "", row, position))
        return [np.array(column) for column in found]

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


def _is_finite(values: np.ndarray) -> bool:
    return values.dtype.kind in "fiu" and bool(np.isfinite(values).all())


Finder = Callable[[Sequence[Line], Sequence[Line], str], Layout | None]


def read_table(path: str | os.PathLike[str], export: Finder | None = None) -> Table:
    """Layout of the text file at `path`; no cell is read yet.

    `export` is asked first: it returns the layout of a format of its own, or None.
    Raises DataError for a file that cannot be read or holds no rows of numbers.
    """
    text, digest = read_text(path)
    lines, comments = content_lines(text)
    if not lines:
        raise DataError(f"{path}: holds only comments; expected rows of numbers")
    known = export(lines, comments, str(path)) if export else None
    layout = known or find_layout(lines, comments, str(path))
    return Table(str(path), digest, layout, np.array([line.number for line in layout.rows]), comments)
