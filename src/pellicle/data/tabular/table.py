"""Tables of numbers before their columns are interpreted, and what the lines above their rows declare.

Cells are text that is read column by column, or arrays. `numpy.loadtxt` reads the numbers of a text. Only a
text on which it fails is read cell by cell, to name the faulty line and column. Of the lines above the rows
only those of a keyword and a value count, as `Y-axis mode: %T` or `##XUNITS=1/CM`; free text does not.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pellicle.data.tabular.columns import Column, recognise
from pellicle.data.tabular.text import Line, is_number, split
from pellicle.errors import DataError

SELECTED = "\x1f"
"""Delimiter of cells that a reader has selected: the unit separator of ASCII, which no text has."""
DELIMITERS = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}

_SHEET_ERROR = re.compile(r"#(?:[A-Z]+/0!|N/A|N/V|NV|[A-ZÄÖÜ]+[!?])", re.IGNORECASE)
"""An error in a cell of a spreadsheet, such as #DIV/0!, #N/A or #WERT!, which begins like a comment."""

Place = Callable[[int, int], str]
"""File, line and column of a cell, by its row and column, for a message."""

_ENTRY = re.compile(r"[#\s\"']*(?P<key>[^=:;,\t]{1,40}?)[\"']?\s*(?:[=:]|[\t;,])\s*(?P<value>.*?)[\s\"';,]*")
_DECLARES_AXIS = re.compile(
    r"(x[ _-]?(axis|unit|label|title)s?([ _-]?(mode|unit|label|title|type)s?)?"
    r"|(wavelength|axis|abscissa|spectral)[ _-]?(unit|type|mode|scale)s?)"
)
_SIGNAL = re.compile(
    r"(y[ _-]?(axis|unit|label|title)s?([ _-]?(mode|unit|label|title|type)s?)?"
    r"|(data|measurement|measuring|photometric|ordinate|display|acquisition)[ _-]?(mode|type|unit|scale)s?"
    r"|ordinate|quantity|technique|signal([ _-](type|unit))?|(spectrum|spectral)[ _-]type|measured quantity)"
)
_ANGLE = re.compile(
    r"(angle|(angle of|incidence|incident) (incidence|angle)|aoi|einfallswinkel)"
    r"( ?[(\[]?(deg(rees?)?|°)[)\]]?)?"
)
_DEGREES = re.compile(r"(\d+(?:[.,]\d+)?)\s*(?:°|deg(?:rees?)?\.?)?")
_POLARISATION = re.compile(r"polari[sz](ation|er)( (state|mode|position))?")
_POLARISED = {
    "s": re.compile(r"(s|te)([ -]?(pol.*|wave|light))?"),
    "p": re.compile(r"(p|tm)([ -]?(pol.*|wave|light))?"),
    "unpolarised": re.compile(r"none|random|un-?polari[sz]ed|non-?polari[sz]ed"),
}
_FACTS = {
    "instrument": r"instrument( (name|model|type|serial.*))?|spectrometers?( (name|model|type))?|model"
    r"|origin|spectrometer/data system",
    "date": r"date( (and|/) ?time)?|(acquired|measured|created)( (on|at))?|(measurement|acquisition) date"
    r"|time ?stamp|longdate|date of measurement",
    "delta": r"delta",  # "folded into 0 to 180 degrees"
    "light": r"light",  # "transmitted" of psi and delta
    "sample": r"sample( (name|id|description))?|title|spectrum name",
}
_FOREIGN = re.compile(
    r"(kubelka|k/s\b|f\(r\)|irradiance|radiance|raman|fluorescence|emission|phosphorescence|power|"
    r"counts?\b|scope|raw|single beam|interferogram|intensity)",
    re.IGNORECASE,
)
"""Quantities that are neither a reflectance nor a transmittance."""
_NO_WAVELENGTH = re.compile(
    r"(raman|pixel|channel|points?\b|index|time|temperature|position|angle|seconds?\b)",
    re.IGNORECASE,
)
"""Axes that are no wavelength, energy or wavenumber."""


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
        numbers: list[list[float]] = []
        faulty: list[tuple[int, int, str]] = []  # row, position and text of the first bad cell of a row
        for row, line in enumerate(self.rows):
            cells = split(line.bare, self.delimiter)
            if len(cells) > self.width and not faulty:
                hint = "; a decimal comma looks like this" if self.delimiter == "," else ""
                raise DataError(
                    f"{path}: line {line.number} has {len(cells)} values where {self.width} are expected; "
                    f"correct that line{hint}"
                )
            texts = [cells[position] if position < len(cells) else "" for position in positions]
            numbers.append(
                [float(x.replace(",", ".")) if is_number(x, self.decimal) else np.nan for x in texts]
            )
            wrong = np.flatnonzero(~np.isfinite(numbers[-1]))
            faulty += [(row, positions[i], texts[i]) for i in wrong[:1]]
        if not faulty:
            return [np.array(column) for column in zip(*numbers, strict=True)]
        row, position, cell = faulty[0]
        line, remedies = self.rows[row], ("correct or delete that row", "correct or delete those rows")
        if not cell and (error := _SHEET_ERROR.search(line.text.removeprefix(line.bare))):
            cell = error[0]
        fault = f": expected a number but found {cell!r}"
        if not cell:
            fault = " is empty"
            remedies = ("fill it in or delete that row", "fill them in or delete those rows")
        elif is_number(cell, self.decimal):
            fault = f": {cell} is not a finite number"
            remedies = ("delete that row or put # before it", "delete those rows or put # before them")
        count = len(faulty) - 1
        more = f", and {count} more row{'s have' if count > 1 else ' has'} no number" if count else ""
        raise DataError(f"{where(row, position)}{fault}{more}; {remedies[count > 0]}")


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


@dataclass(frozen=True)
class Statement:
    """A declared axis or quantity: the column that its words describe, and the line that declares it.

    For a quantity that is neither R nor T the column has the role "foreign".
    """

    column: Column
    line: int


@dataclass(frozen=True)
class Declared:
    """Axis, signal, angle of incidence (degrees), polarisation and facts (pairs of a key and a value) that a
    file declares; None where it does not."""

    axis: Statement | None = None
    signal: Statement | None = None
    facts: tuple[tuple[str, str], ...] = ()
    angle: float | None = None
    polarisation: str | None = None


NOTHING_DECLARED = Declared()


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
        path = f"{self.path}: " if self.path else ""
        return f"{path}{self.place(row)}, {self.label(position)}"

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


def declarations(lines: Sequence[Line]) -> Declared:
    """Return what the lines above the rows of a table declare; the first line of a kind counts.

    >>> declarations([Line(1, "Y-axis mode: %T", "")]).signal.column.unit
    'percent'
    """
    axis = signal = angle = polarisation = None
    facts: dict[str, str] = {}
    for line in lines:
        entry = _ENTRY.fullmatch(line.text)
        if entry is None or not entry["value"]:
            continue
        key, value = entry["key"].strip().lower(), entry["value"]
        column = recognise(value)
        if _DECLARES_AXIS.fullmatch(key) and column.role == "wavelength" and column.unit:
            axis = axis or Statement(column, line.number)
        elif _DECLARES_AXIS.fullmatch(key) and _NO_WAVELENGTH.match(value):
            axis = axis or Statement(Column(0, value, "wavelength", unknown_unit=value), line.number)
        elif _SIGNAL.fullmatch(key) and column.role in ("R", "T"):
            signal = signal or Statement(column, line.number)
        elif _SIGNAL.fullmatch(key) and (column.role == "foreign" or _FOREIGN.match(value)):
            signal = signal or Statement(Column(0, value, "foreign"), line.number)
        elif _ANGLE.fullmatch(key) and (degrees := _DEGREES.fullmatch(value)):
            angle = float(degrees[1].replace(",", ".")) if angle is None else angle
        elif _POLARISATION.fullmatch(key):
            stated = (name for name, words in _POLARISED.items() if words.fullmatch(value.lower()))
            polarisation = polarisation or next(stated, None)
        else:
            fact = next((name for name, words in _FACTS.items() if re.fullmatch(words, key)), None)
            if fact:
                facts.setdefault(fact, value)
    return Declared(axis, signal, tuple(facts.items()), angle, polarisation)
