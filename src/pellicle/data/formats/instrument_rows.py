"""Rows and facts as instruments write them: decimal marks, cells, and pairs of a keyword and a value."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from typing import TypeAlias

from pellicle.data.tabular.declarations import declarations
from pellicle.data.tabular.text import Line, is_number

Rows: TypeAlias = list[tuple[Line, list[str]]]

_DELIMITERS = ("\t", ";", ",")


def decimal_mark(rows: Rows) -> str:
    """Return the decimal mark of the rows, which are no longer separated by commas."""
    return "," if any(is_number(cell, ",") and "," in cell for _, cells in rows for cell in cells) else "."


def delimiter_of(text: str) -> str:
    """Return the tab, semicolon or comma that separates the cells of a line, a blank without one."""
    return next((delimiter for delimiter in _DELIMITERS if delimiter in text), " ")


def all_cells(text: str, delimiter: str) -> list[str]:
    """Split a line into cells, keeping empty ones, without quotes and blanks around them."""
    if '"' in text and delimiter != " ":
        cells = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))
    else:
        cells = text.split(None if delimiter == " " else delimiter)
    return [cell.strip().strip('"').strip() for cell in cells]


def facts(kind: str, lines: Sequence[Line], **known: str) -> tuple[tuple[str, str], ...]:
    """Return the name of the format, if any, `known` facts, and what the lines declare."""
    found = {key: value for key, value in {"format": kind, **known}.items() if value}
    for key, value in declarations(lines).facts:
        found.setdefault(key, value)
    return tuple(found.items())


def counted(rows: Rows, stated: Iterable[str], path: str) -> list[str]:
    """Return a note where a file has fewer rows than the first number among `stated` says."""
    number = next((text for text in stated if text.strip().isdigit()), None)
    if number is None or len(rows) >= int(number):
        return []
    return [f"states {int(number)} points but has {len(rows)}: it may have been cut off"]
