"""Files of several tables below each other, each with a title and the same line of column names.

Thermo's INSIGHT and other programs that measure a batch write them: title, date, names, rows, and again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from pellicle.data.formats.instrument_rows import all_cells, delimiter_of
from pellicle.data.tabular.columns import is_header
from pellicle.data.tabular.layout import Layout, find_layout
from pellicle.data.tabular.text import Line, TextFile, is_number


def layouts(file: TextFile) -> list[Layout] | None:
    """Return one layout for each table, or None where the names are not repeated."""
    lines = file.lines
    first = next((line for line in lines[:40] if _names(line)), None)
    headers = [i for i, line in enumerate(lines) if first is not None and line.text == first.text]
    if len(headers) < 2:
        return None
    starts = [_title(lines, header, after) for header, after in zip(headers, [-1, *headers], strict=False)]
    found = []
    for i, (start, header) in enumerate(zip(starts, headers, strict=True)):
        stop = starts[i + 1] if i + 1 < len(starts) else len(lines)
        layout = find_layout(TextFile(file.path, file.sha256, lines[start:stop]))
        title = lines[start].text.strip('"') if start < header else f"table {i + 1}"
        note = f"table {i + 1} of {len(headers)} in the file"
        found.append(dataclasses.replace(layout, name=title, notes=(note, *layout.notes)))
    return found


def _names(line: Line) -> bool:
    return is_header(all_cells(line.text, delimiter_of(line.text)))


def _title(lines: Sequence[Line], header: int, after: int) -> int:
    """Index of the first line above a header that is no row of the table before, whose header is `after`."""
    start = header
    while start > after + 1 and not _is_row(lines[start - 1]):
        start -= 1
    return start


def _is_row(line: Line) -> bool:
    cells = all_cells(line.text, delimiter_of(line.text))[:2]
    return len(cells) == 2 and all(is_number(cell, ",") for cell in cells)
