"""Shared parts of the readers of instruments' files: cells, facts, names of quantities, choice of spectra.

A format that stores several curves, such as a sample, a dark and a reference spectrum, gives a `Curve` for
each; `readable` keeps reflectances, transmittances and absorbances, and names what it leaves out.
"""

import csv
import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from pellicle.data.tabular.columns import Column, recognise
from pellicle.data.tabular.table import Statement, Table, declarations, plain_columns
from pellicle.data.tabular.text import Line, is_number
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

Rows: TypeAlias = list[tuple[Line, list[str]]]
"""Lines of a table with their cells."""
Facts: TypeAlias = Iterable[tuple[str, str]]

UNNAMED = "intensity"
"""Column name of a quantity that a file calls arbitrary: the user may state what it is."""
_NO_NAME = "ordinate"
_SPECTRAL = ("R", "T")
_NOT_STATED = "not stated"
_DELIMITERS = ("\t", ";", ",")
_MISSING = frozenset(("nan", "NaN", "NAN"))


def export(
    kind: str,
    names: Sequence[str],
    rows: Rows,
    *,
    facts: Facts = (),
    notes: Sequence[str] = (),
    name: str = "",
    decimal: str | None = None,
) -> Table:
    """Return the layout of a table of an export of the format `kind`, which its first note and fact name.

    `names` state quantity and unit as a header does. The decimal mark is that of the rows by default.
    """
    read_as = f"read as {'an' if kind[0] in 'AEIOU' else 'a'} {kind} file"
    stated = [("format", kind), *((key, value) for key, value in facts if value)]
    mark = decimal_mark(rows) if decimal is None else decimal
    return plain_columns(names, rows, [read_as, *notes], name=name, facts=stated, decimal=mark)


def decimal_mark(rows: Rows) -> str:
    """Return the decimal mark of the rows, which are no longer separated by commas."""
    return "," if any(is_number(cell, ",") and "," in cell for _, cells in rows for cell in cells) else "."


def delimiter_of(text: str) -> str:
    """Return the tab, semicolon or comma that separates the cells of a line, a blank without one."""
    return next((delimiter for delimiter in _DELIMITERS if delimiter in text), " ")


def all_cells(text: str, delimiter: str | None = None) -> list[str]:
    """Split a line into cells, keeping empty ones, without quotes and blanks around them.

    Without a `delimiter` it is that of the line.
    """
    delimiter = delimiter_of(text) if delimiter is None else delimiter
    if '"' in text and delimiter != " ":
        cells = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))
    else:
        cells = text.split(None if delimiter == " " else delimiter)
    return [cell.strip().strip('"').strip() for cell in cells]


def keyword(line: Line) -> tuple[str, str]:
    """Return keyword and value of a line `keyword: value`, the value empty without a colon."""
    key, _, value = line.text.partition(":")
    return key.strip(), value.strip()


def facts(lines: Sequence[Line], **known: str) -> list[tuple[str, str]]:
    """Return `known` facts that are not empty, and others that the lines declare."""
    stated = {key: value for key, value in known.items() if value}
    return [*stated.items(), *(fact for fact in declarations(lines).facts if fact[0] not in stated)]


def counted(rows: Rows, stated: Iterable[str]) -> list[str]:
    """Return a note where a file has fewer rows than the first number among `stated` says."""
    number = next((text for text in stated if text.strip().isdigit()), None)
    if number is None or len(rows) >= int(number):
        return []
    return [f"states {int(number)} points but has {len(rows)}: it may have been cut off"]


def measured(rows: Rows, positions: Iterable[int]) -> tuple[Rows, list[str]]:
    """Return the rows whose cells at `positions` are not written NaN, and a note on the others."""
    kept = [row for row in rows if _MISSING.isdisjoint(row[1][i] for i in positions)]
    missing = len(rows) - len(kept)
    return kept, [f"{missing} of {len(rows)} points, written NaN, left out"] if missing else []


def first_stated(wanted: Mapping[str, Iterable[str]], text: Callable[[str], Any]) -> list[tuple[str, str]]:
    """Return facts by the first of their names that a file has a `text` for."""
    values = {fact: next(filter(None, map(text, names)), "") for fact, names in wanted.items()}
    return [(fact, str(value)) for fact, value in values.items() if value]


def told_apart(names: Sequence[str]) -> list[str]:
    """Return the names, with a number behind those that are not the first of their kind."""
    return [
        name if name not in names[:i] else f"{name} ({names[:i].count(name) + 1})"
        for i, name in enumerate(names)
    ]


@dataclass(frozen=True)
class Curve:
    """One curve of a file: its layout, the names that the file gives to axis and quantity, and their line."""

    layout: Table
    axis: str
    quantity: str
    line: int = 0


def axis_column(text: str) -> str | None:
    """Return the column name of an axis such as `1/CM` or `Wavelength (nm)`; None for another quantity.

    An axis without a unit gets the unit "not stated", which is then asked for.

    >>> axis_column("NANOMETERS")
    'wavelength (nm)'
    """
    unit = wavelength_unit(text)
    column = recognise(text)
    if unit is None and column.role == "wavelength":
        unit = column.unit or column.unknown_unit or _NOT_STATED
    if unit is None and not text.strip():
        unit = _NOT_STATED
    return f"wavelength ({unit})" if unit else None


def signal_column(text: str) -> str | None:
    """Return the column name of a quantity such as `% TRANSMITTANCE`; None for one that is neither R nor T.

    What the user may state keeps its place: a percentage of an unnamed quantity, a relative intensity
    ("intensity"), and no name at all ("ordinate").

    >>> signal_column("Transmission (%)")
    'T (%)'
    """
    plain = re.sub(r"^percent\b|^per cent\b", "%", text.strip(), flags=re.IGNORECASE)
    plain = re.sub(r"\s+units?$", "", plain, flags=re.IGNORECASE)
    column = recognise(plain)
    if not plain:
        return _NO_NAME
    if column.role not in _SPECTRAL:
        if column.role == "other" and column.unit == "percent":
            return text
        return UNNAMED if column.role == "intensity" and "count" not in plain.lower() else None
    if column.unit == "absorbance":
        return "absorbance" if column.role == "T" else "log(1/R)"
    unit = {"percent": " (%)", "fraction": " (-)"}.get(column.unit or "", "")
    return f"{column.role}{column.polarisation or ''}{unit}" if not column.unknown_unit else text


def readable(curves: Sequence[Curve]) -> list[Table]:
    """Return the layouts of the curves that are spectra of R, T or absorbance, under different names.

    Where there is none, the quantity of the first is declared, and refused when it is read. Raises DataError
    for curves along another axis, such as time.
    """
    along = [curve for curve in curves if axis_column(curve.axis)]
    if not along:
        raise DataError(
            f"its axis is {curves[0].axis!r}, which is no wavelength, energy or wavenumber; export a "
            "spectrum as CSV"
        )
    named = [(curve, signal_column(curve.quantity)) for curve in along]
    kept = [curve for curve, name in named if name and name not in (UNNAMED, _NO_NAME)] or [
        c for c, name in named if name
    ]
    left_out = [curve.quantity for curve in curves if curve not in kept]
    if not kept:
        declared = Statement(Column(0, along[0].quantity, "foreign"), along[0].line)
        layout = along[0].layout
        return [dataclasses.replace(layout, declared=dataclasses.replace(layout.declared, signal=declared))]
    notes = (f"left out: {', '.join(map(repr, dict.fromkeys(left_out)))}",) if left_out else ()
    names = told_apart([curve.layout.name or curve.quantity for curve in kept]) if len(kept) > 1 else [""]
    return [
        dataclasses.replace(curve.layout, name=name, remarks=(*curve.layout.remarks, *notes))
        for curve, name in zip(kept, names, strict=True)
    ]
