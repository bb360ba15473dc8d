"""Plain text for reports, at most 100 characters wide: blocks, wrapped text, aligned columns; and CSV."""

import csv
import math
import textwrap
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from io import StringIO
from typing import Any

from pellicle.reporting.drawable import Table

COLUMNS = 100
INDENT = "    "


def block(title: str, lines: Sequence[str]) -> str:
    """Format a titled part of a report."""
    return "\n".join([f"[[{title}]]", *lines]) + "\n"


def blocks_of(parts: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Format the titled parts of a report that have lines."""
    return "".join(block(title, lines) for title, lines in parts if lines)


def wrapped(text: str, first: str = "", rest: str = "") -> list[str]:
    """Wrap `text`; `first` precedes the first line and `rest` each other one."""
    return textwrap.wrap(
        text,
        COLUMNS,
        initial_indent=INDENT + first,
        subsequent_indent=INDENT + rest,
        break_on_hyphens=False,
        break_long_words=False,  # paths stay whole
    )


def facts(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Format labels and their texts side by side."""
    rows = list(rows)
    width = max((len(label) for label, _ in rows), default=0)
    return [line for label, text in rows for line in wrapped(text, f"{label:<{width}}  ", " " * (width + 2))]


def aligned(rows: Iterable[Sequence[str]], left: int | None = None) -> list[str]:
    """Format aligned columns; those from the `left`-th on are flush right."""
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if left is None or i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def table(rows: Iterable[Sequence[str]]) -> list[str]:
    """Format aligned columns; a row that is too long continues on the next line."""
    return [part for line in aligned(rows) for part in wrapped(line, "", INDENT)]


def described(title: str, rows: Iterable[tuple[str, str]], notes: Sequence[str]) -> str:
    """Format a title, labels and their texts without the empty ones, and notes on how a file was read."""
    read = [(" " if i else "read", note) for i, note in enumerate(notes)]
    return "\n".join([title, *facts([row for row in (*rows, *read) if row[1]]), ""])


def with_unit(text: str, unit: str) -> str:
    """`5.2 nm`, or the text alone of a number without unit."""
    return f"{text} {unit}" if unit else text


def csv_rows(names: Sequence[str], rows: Iterable[Sequence[Any]], comments: Sequence[str] = ()) -> str:
    """Format rows below the names of their columns as `csv_text` does."""
    columns = list(zip(*rows, strict=True)) or [()] * len(names)
    return csv_text(Table(dict(zip(names, columns, strict=True)), comments))


def csv_text(table: Table) -> str:
    """Format a table below its comments; numbers have ten digits, and those that are not finite are empty."""
    text = StringIO()
    for line in table.comments:
        text.write(f"# {line}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    for row in zip(*table.columns.values(), strict=True):
        writer.writerow([_cell(value) for value in row])
    return text.getvalue()


def written_by() -> str:
    """The comment that names this program."""
    return f"written by pellicle {version('pellicle')}"


def _cell(value: Any) -> str:
    if isinstance(value, str | bool):
        return str(value)
    return f"{float(value):.10g}" if value is not None and math.isfinite(value) else ""
