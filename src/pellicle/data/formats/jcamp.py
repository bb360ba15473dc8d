"""JCAMP-DX files (`.jdx`, `.dx`): spectra in blocks of labelled records, `##LABEL= value`.

A block begins with `##TITLE=`; a LINK file holds several, an NTUPLES block several pages. Axis and quantity
are `##XUNITS=` and `##YUNITS=`. The table is `(X++(Y..Y))`, at even steps from FIRSTX to LASTX, or
`(XY..XY)`. Some programs write decimal commas. **Source**: JCAMP-DX 4.24 and 5.01, http://www.jcamp-dx.org.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from pellicle.data.formats.exports import Curve, axis_column, export, first_stated, readable, signal_column
from pellicle.data.formats.jcamp_values import Point, ordinates, plain_numbers
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import Line, TextFile
from pellicle.errors import DataError

_RECORD = re.compile(r"(?P<label>[^=]{0,80})=(?P<value>.*)", re.DOTALL)
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?\d+,\d+")
_LIMITS = ("FIRSTX", "LASTX", "DELTAX", "XFACTOR", "YFACTOR", "FIRSTY")
_TABLES = ("XYDATA", "XYPOINTS", "DATATABLE")
_HEAD = 60  # lines that are searched for ##JCAMP-DX=
_FACTS = {
    "instrument": ("SPECTROMETERDATASYSTEM", "INSTRUMENTALPARAMETERS", "ORIGIN"),
    "date": ("LONGDATE", "DATE"),
    "sample": ("SAMPLEDESCRIPTION", "NAMES", "TITLE"),
}
MOST_POINTS = 10_000_000
"""Largest NPOINTS that is accepted; instruments write some 10⁴."""


@dataclass(frozen=True)
class Rows:
    """Rows of a table without comments, its form, as `(X++(Y..Y))`, and the line that declares it."""

    form: str
    line: Line
    rows: list[tuple[Line, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Scales:
    """Abscissa and factors of a table: None where the block does not state them."""

    first: float | None
    last: float | None
    step: float | None
    points: int | None
    x_factor: float
    y_factor: float
    decimal: str


@dataclass(frozen=True)
class _Block:
    """Records and tables between `##TITLE=` and `##END=`; each record keeps its line."""

    records: dict[str, tuple[str, Line]] = field(default_factory=dict)
    tables: list[Rows] = field(default_factory=list)

    def text(self, label: str, place: int | None = None) -> str:
        """Return the value of a record, of NTUPLES that of the variable at a place; empty without one."""
        text = self.records[label][0] if label in self.records else ""
        parts = [text] if place is None else [part.strip() for part in text.split(",")]
        return parts[place or 0] if (place or 0) < len(parts) else ""


def read(file: TextFile) -> list[Table] | None:
    """Return the spectra of a JCAMP-DX file, or None for another format.

    Raises DataError for a table that contradicts the records above it, and for one without spectra.
    """
    heads = [_label(comment.text) for comment in file.comments if comment.number <= _HEAD]
    if "JCAMPDX" not in heads and not {"TITLE", "XUNITS", "YUNITS"} <= set(heads):
        return None
    blocks = _blocks(file)
    curves = [curve for block in blocks for curve in _curves(block)]
    if not curves:
        raise DataError(
            "is a JCAMP-DX file without a table of a spectrum (XYDATA or XYPOINTS); export it as CSV"
        )
    return readable(curves)


def _label(text: str) -> str:
    """The label of a record without blanks, `-`, `/` and `_`, which do not distinguish labels."""
    match = _RECORD.match(text)
    return re.sub(r"[\s/_-]", "", match["label"]).upper() if match else ""


def _blocks(file: TextFile) -> list[_Block]:
    blocks = [_Block()]
    label, table = "", None
    for line in file.all_lines:
        text = line.text.partition("$$")[0]
        match = _RECORD.match(text) if not line.bare else None
        if match is None:
            if not text.strip() or not line.bare:
                continue
            if table is not None:
                table.rows.append((line, text))
            elif label and label in blocks[-1].records:
                value, start = blocks[-1].records[label]
                blocks[-1].records[label] = (f"{value} {text.strip()}".strip(), start)
            continue
        label, value = _label(text), match["value"].strip()
        table = None
        if label == "TITLE":
            blocks.append(_Block())
        if label in _TABLES:
            table = Rows(value, line)
            blocks[-1].tables.append(table)
        else:
            blocks[-1].records.setdefault(label, (value, line))
        if label == "PAGE":
            blocks[-1].records["PAGE"] = (value, line)
    return blocks


def _curves(block: _Block) -> Iterator[Curve]:
    """The curve of each table of a block."""
    paged = "NTUPLES" in block.records
    for table in block.tables:
        axis, quantity, place, other = block.text("XUNITS"), block.text("YUNITS"), None, None
        labels = ("FIRSTX", "LASTX", "DELTAX", "NPOINTS", "XFACTOR", "YFACTOR")
        if paged:
            # a page of NTUPLES; one whose variables are not X and one Y is left out
            form = re.match(r"\(\s*(\w)\s*\+\+\s*\(\s*(\w)\.\.\2\s*\)\s*\)", table.form)
            symbols = [symbol.strip().upper() for symbol in block.text("SYMBOL").split(",")]
            if form is None or not {form[1].upper(), form[2].upper()} <= set(symbols):
                continue
            place, other = symbols.index(form[1].upper()), symbols.index(form[2].upper())
            axis = block.text("UNITS", place)
            quantity = block.text("UNITS", other) or block.text("VARNAME", other)
            labels = ("FIRST", "LAST", "", "VARDIM", "FACTOR", "FACTOR")
        first, last, step = (_number(block, label, place) for label in labels[:3])
        scales = Scales(
            first,
            last,
            step,
            _count(block, labels[3], other),
            _factor(block, labels[4], place),
            _factor(block, labels[5], other),
            "," if not paged and any(_COMMA.match(block.text(label)) for label in _LIMITS) else ".",
        )
        x, y = points_of(table, scales)
        names = (axis_column(axis) or axis, signal_column(quantity) or quantity)
        rows = [
            (line, [repr(float(abscissa)), repr(value)])
            for abscissa, (value, line) in zip(x, y, strict=True)
            if np.isfinite(value)
        ]
        unknown = len(y) - len(rows)
        if not rows:
            raise DataError(f"line {table.line.number} begins a table without points; the file is cut short")
        notes = [f"{unknown} points of unknown value (?) left out"] if unknown else []
        title, facts = block.text("TITLE"), first_stated(_FACTS, block.text)
        layout = export(
            "JCAMP-DX", names, rows, facts=facts, notes=notes, name=title or quantity, decimal="."
        )
        yield Curve(layout, axis, quantity, block.records.get("YUNITS", ("", table.line))[1].number)


def _number(block: _Block, label: str, place: int | None = None) -> float | None:
    """The number of a record, of a variable of NTUPLES that at its `place`; None where there is none."""
    text = block.text(label, place)
    if not text:
        return None
    line = block.records[label][1]
    if not _NUMBER.fullmatch(text):
        raise DataError(f"line {line.number}: {label} is {text[:40]!r}, not a number; correct it")
    value = float(text.replace(",", "."))
    if not np.isfinite(value):
        raise DataError(f"line {line.number}: {label} is not a finite number; correct it")
    return value


def _factor(block: _Block, label: str, place: int | None = None) -> float:
    value = _number(block, label, place)
    if value == 0:
        raise DataError(f"{label} is 0, which leaves no values; export it again")
    return 1.0 if value is None else value


def _count(block: _Block, label: str, place: int | None = None) -> int | None:
    value = _number(block, label, place)
    if value is None:
        return None
    if value != int(value) or not 1 <= value <= MOST_POINTS:
        raise DataError(
            f"line {block.records[label][1].number}: {label} is {value:g}, which is no number of "
            f"points from 1 to {MOST_POINTS}; export it again"
        )
    return int(value)


def points_of(table: Rows, scales: Scales) -> tuple[Sequence[float], Sequence[Point]]:
    """Abscissae and ordinates of a table. Raises DataError where they contradict the records."""
    form = re.sub(r"\s", "", table.form).upper()
    if form.startswith("(XY..XY)"):
        x, y = _pairs(table, scales)
    elif re.match(r"\(\w\+\+\(\w\.\.\w\)\)", form):
        x, y = _even(table, scales)
    else:
        raise DataError(
            f"line {table.line.number}: a table {table.form!r} is not read, only (X++(Y..Y)) and "
            "(XY..XY); export it as CSV"
        )
    return x, [(value * scales.y_factor, line) for value, line in y]


def _pairs(table: Rows, scales: Scales) -> tuple[list[float], list[Point]]:
    x: list[float] = []
    y: list[Point] = []
    for line, text in table.rows:
        numbers = plain_numbers(line, text, scales.decimal)
        if len(numbers) % 2:
            raise DataError(
                f"line {line.number} has {len(numbers)} numbers where pairs of x and y are expected; "
                "correct that line"
            )
        x += [value * scales.x_factor for value in numbers[::2]]
        y += [(value, line) for value in numbers[1::2]]
    _check_number(len(y), scales, table)
    step = abs(x[-1] - x[0]) / max(len(x) - 1, 1) if x else 0.0
    ends = ((scales.first, x[0], "FIRSTX"), (scales.last, x[-1], "LASTX")) if x else ()
    for stated, read, label in ends:
        if stated is not None and abs(stated - read) > step + 1e-3 * abs(read):
            raise DataError(
                f"{label} is {stated:g}, but the table has {read:g} there; check its decimal "
                "marks, or export it as CSV"
            )
    return x, y


def _even(table: Rows, scales: Scales) -> tuple[Sequence[float], list[Point]]:
    most = scales.points or MOST_POINTS
    y, starts = ordinates(table.rows, most, scales.decimal)
    _check_number(len(y), scales, table)
    if not y:
        return [], []
    first, last = scales.first, scales.last
    if first is None or (last is None and scales.step is None):
        raise DataError(
            f"line {table.line.number}: the table needs FIRSTX and LASTX above it, which give its "
            "axis; export it as CSV"
        )
    if last is None:
        last = first + (scales.step or 0.0) * (len(y) - 1)
    step = (last - first) / max(len(y) - 1, 1)
    if scales.step is not None and abs(abs(scales.step) - abs(step)) > 0.01 * abs(step):
        raise DataError(
            f"DELTAX is {scales.step:g}, but {len(y)} points from FIRSTX {first:g} to LASTX "
            f"{last:g} are {step:g} apart; export it again"
        )
    factor = scales.x_factor
    for (line, _), (abscissa, position) in zip(table.rows, starts, strict=True):
        expected = first + step * position
        room = 0.3 * abs(step) + abs(factor) + 1e-6 * abs(expected)
        # some programs write the abscissae of a table without the factor
        if min(abs(abscissa * factor - expected), abs(abscissa - expected)) > room:
            raise DataError(
                f"line {line.number} begins at {abscissa * factor:g}, where FIRSTX, LASTX and "
                f"NPOINTS put {expected:g}; points are missing or the records are wrong, so export it again"
            )
    return np.linspace(first, last, len(y)).tolist(), y


def _check_number(count: int, scales: Scales, table: Rows) -> None:
    if scales.points is not None and count != scales.points:
        raise DataError(
            f"the table from line {table.line.number} has {count} points where NPOINTS states "
            f"{scales.points}; the file is cut short or damaged, so export it again"
        )
