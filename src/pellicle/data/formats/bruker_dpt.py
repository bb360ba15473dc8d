"""Data point tables (`.dpt`) of Bruker's OPUS: two columns of numbers that name neither axis nor quantity."""

from __future__ import annotations

from pathlib import PurePath

from pellicle.data.formats.instrument_rows import all_cells, decimal_mark, delimiter_of
from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import TextFile, is_number


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the spectrum, whose units are then asked for; None for another format."""
    if PurePath(file.path).suffix.lower() != ".dpt" or file.comments:
        return None
    delimiter = delimiter_of(file.lines[0].text)
    rows = [(line, all_cells(line.bare, delimiter)) for line in file.lines]
    if not all(len(cells) == 2 and is_number(cells[0], ",") for _, cells in rows):
        return None
    names = ["wavelength (unit not stated)", "processed (unit not stated)"]
    decimal = "." if delimiter == "," else decimal_mark(rows)
    return [
        plain_columns(
            names,
            rows,
            ["read as a Bruker data point table"],
            facts=[("format", "Bruker dpt")],
            decimal=decimal,
        )
    ]
