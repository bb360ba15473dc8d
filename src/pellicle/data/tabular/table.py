"""Tables of numbers before their columns are interpreted: text that is read column by column, or arrays.

`numpy.loadtxt` reads the numbers of a text. Only a text on which it fails is read cell by cell, to name the
faulty line and column.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pellicle.data.tabular.columns import NOTHING_DECLARED, Declared
from pellicle.data.tabular.text import Line, is_number, split
from pellicle.errors import DataError

SELECTED = "\x1f"
"""Delimiter of cells that a reader has selected: the unit separator of ASCII, which no text has."""
DELIMITERS = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}

_SHEET_ERROR = re.compile(r"#(?:[A-Z]+/0!|N/A|N/V|NV|[A-ZÄÖÜ]+[!?])", re.IGNORECASE)
"""An error in a cell of a spreadsheet, such as #DIV/0!, #N/A or #WERT!, which begins like a comment."""

Place = Callable[[int, int], str]
"""File, line and column of a cell, by its row and column, for a message."""


@dataclass(frozen=True, eq=False)
class TextCells:
    """Rows of text with their delimiter and decimal mark.

    `raw_width` also counts empty cells at the end of a row, after a closing delimiter.
    """

    delimiter: str
    decimal: str
    width: int
    raw_width: int
    rows: Sequence[Line]

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence on how the cells are written."""
        notes = [f"columns separated by {DELIMITERS[self.delimiter]}"] if self.delimiter in DELIMITERS else []
        notes += ["decimal commas"] if self.decimal == "," else []
        return (", ".join(notes),) if notes else ()

    @cached_property
    def lines(self) -> np.ndarray:
        """Source line of each row."""
        return np.array([line.number for line in self.rows], dtype=np.int64)

    def __len__(self) -> int:
        return len(self.rows)

    def numbers(self, positions: Sequence[int], path: str, where: Place) -> list[np.ndarray]:
        """Read the columns at `positions`, float64 and finite. Raises DataError for the first bad cell."""
        delimiter = None if self.delimiter == " " else self.delimiter
        rows = [line.bare for line in self.rows]
        if any(len(row.split(delimiter)) > self.raw_width for row in rows):
            return self._by_cell(positions, path, where)
        if self.decimal == ",":
            rows = [row.replace(",", ".") for row in rows]
        try:
            options = {"delimiter": delimiter, "comments": None, "quotechar": '"', "ndmin": 2}
            columns = np.loadtxt(rows, usecols=positions, **options).T
        except ValueError:  # a cell that is empty, missing or no number
            return self._by_cell(positions, path, where)
        if columns.shape[1] == len(rows) and np.isfinite(columns).all():
            return [np.ascontiguousarray(column) for column in columns]
        return self._by_cell(positions, path, where)

    def _by_cell(self, positions: Sequence[int], path: str, where: Place) -> list[np.ndarray]:
        """As `numbers`, cell by cell: names the first bad cell, and how many rows have one."""
        columns: list[list[float]] = [[] for _ in positions]

        def faulty_after(row: int) -> int:
            return sum(not self._complete(line, positions) for line in self.rows[row + 1 :])

        for row, line in enumerate(self.rows):
            cells = split(line.bare, self.delimiter)
            if len(cells) > self.width:
                hint = "; a decimal comma looks like this" if self.delimiter == "," else ""
                raise DataError(
                    f"{path}: line {line.number} has {len(cells)} values where {self.width} are expected; "
                    f"correct that line{hint}"
                )
            for column, position in zip(columns, positions, strict=True):
                cell = cells[position] if position < len(cells) else ""
                if not cell and (error := _SHEET_ERROR.search(line.text.removeprefix(line.bare))):
                    cell = error[0]
                column.append(self._number(cell, where(row, position), lambda row=row: faulty_after(row)))
        return [np.array(column) for column in columns]

    def _number(self, cell: str, where: str, others: Callable[[], int]) -> float:
        if not cell:
            fault, remedies = (
                " is empty",
                ("fill it in or delete that row", "fill them in or delete those rows"),
            )
        elif not is_number(cell, self.decimal):
            fault = f": expected a number but found {cell!r}"
            remedies = ("correct or delete that row", "correct or delete those rows")
        elif np.isfinite(value := float(cell.replace(",", "."))):
            return value
        else:
            fault = f": {cell} is not a finite number"
            remedies = ("delete that row or put # before it", "delete those rows or put # before them")
        count = others()
        more = f", and {count} more row{'s have' if count > 1 else ' has'} no number" if count else ""
        raise DataError(f"{where}{fault}{more}; {remedies[count > 0]}")

    def _complete(self, line: Line, positions: Sequence[int]) -> bool:
        cells = split(line.bare, self.delimiter)
        numbers = [cells[position] if position < len(cells) else "" for position in positions]
        return all(
            is_number(cell, self.decimal) and np.isfinite(float(cell.replace(",", "."))) for cell in numbers
        )


@dataclass(frozen=True, eq=False)
class ArrayCells:
    """Columns of numbers, float64, all of one length; rows of a binary file have no source lines."""

    columns: tuple[np.ndarray, ...]
    lines: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.columns[0])

    def numbers(self, positions: Sequence[int], path: str, where: Place) -> list[np.ndarray]:
        """Return the columns at `positions`. Raises DataError for a number that is not finite."""
        columns = [self.columns[position] for position in positions]
        for position, column in zip(positions, columns, strict=True):
            if not np.isfinite(column).all():
                row = int(np.argmin(np.isfinite(column)))
                raise DataError(
                    f"{where(row, position)}: {column[row]} is not a finite number; export it again"
                )
        return columns


@dataclass(frozen=True, eq=False)
class Table:
    """A table of a file: the names of its columns or None, their number, and its cells.

    `remarks` are sentences on how it was found. `name` identifies it among the spectra of a file ("" where
    the file has one), `declared` is what the file says of it.
    """

    names: tuple[str, ...] | None
    width: int
    cells: TextCells | ArrayCells
    remarks: tuple[str, ...]
    name: str = ""
    declared: Declared = NOTHING_DECLARED
    path: str = ""
    sha256: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how the file was read."""
        return (*self.remarks, *self.cells.notes)

    @property
    def lines(self) -> np.ndarray | None:
        """Source line of each row, None for a binary file."""
        return self.cells.lines

    @property
    def text(self) -> TextCells:
        """Cells of a text file. Raises TypeError for a binary one."""
        if isinstance(self.cells, TextCells):
            return self.cells
        raise TypeError(f"{self.path} is no text")

    def __len__(self) -> int:
        return len(self.cells)

    def label(self, position: int) -> str:
        """Return a column for a message: its name, or without one its number from 1."""
        names = self.names or ()
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
        return self.cells.numbers(positions, self.path, self.where)


def plain_columns(
    names: Sequence[str],
    rows: Sequence[tuple[Line, Sequence[str]]],
    notes: Sequence[str],
    *,
    name: str = "",
    facts: Sequence[tuple[str, str]] = (),
    decimal: str = ".",
) -> Table:
    """Return the table of cells that a reader has selected, with the lines they came from.

    `names` state quantity and unit as a header does; `facts` as in `Declared`.
    """
    width = len(names)
    selected = [Line(line.number, line.text, SELECTED.join(cells)) for line, cells in rows]
    cells = TextCells(SELECTED, decimal, width, width, selected)
    return Table(tuple(names), width, cells, tuple(notes), name, Declared(facts=tuple(facts)))


def array_columns(
    names: Sequence[str],
    columns: Sequence[np.ndarray],
    notes: Sequence[str],
    *,
    name: str = "",
    facts: Sequence[tuple[str, str]] = (),
) -> Table:
    """Return the table of columns (points,) of a binary file; names as in `plain_columns`."""
    cells = ArrayCells(tuple(np.asarray(column, dtype=np.float64) for column in columns))
    return Table(tuple(names), len(names), cells, tuple(notes), name, Declared(facts=tuple(facts)))
