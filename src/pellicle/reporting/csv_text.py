"""Rendering of tables as CSV."""

import csv
import math
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from io import StringIO
from typing import Any

from pellicle.reporting.drawable import Table


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
