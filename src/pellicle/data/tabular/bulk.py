"""Large tables of plain rows, read as a block instead of line by line.

The head of the file decides on the layout as for any file, and the rows are given to a parser as they are.
Whatever is unusual, errors included, is left to the reader of lines, which names line and column.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pellicle.data.tabular.cells import ArrayCells
from pellicle.data.tabular.layout import Layout
from pellicle.data.tabular.text import TextFile

SMALLEST = 2**20
"""Bytes below which the lines of a file are read one by one, in a few hundredths of a second."""
_HEAD = 2**14
_WORTH_IMPORTING = 2**26
"""Bytes from which importing pandas takes less time than it saves: it parses three times as fast as NumPy."""


def bulk_layout(
    content: bytes, head: Callable[[bytes], TextFile], find: Callable[[TextFile], Layout | None]
) -> Layout | None:
    """Return the layout of a large file of plain rows with its numbers, None for any other file.

    `head` splits the beginning of the content into lines, `find` finds their layout, or None.
    """
    if len(content) < SMALLEST:
        return None
    end = content.rfind(b"\n", 0, _HEAD) + 1
    if not end:
        return None
    try:
        layout = find(head(content[:end]))
    except ValueError:
        return None
    if layout is None:
        return None
    cells = layout.cells
    if isinstance(cells, ArrayCells) or cells.raw_width != cells.width:
        return None
    first = int(cells.lines[0])
    start = 0
    for _ in range(first - 1):
        start = content.index(b"\n", start) + 1
    try:
        columns = _parsed(content, start, cells.delimiter, cells.decimal)
    except (ValueError, OverflowError):
        return None
    if len(columns) != cells.width or not all(np.isfinite(column).all() for column in columns):
        return None
    lines = np.arange(first, first + len(columns[0]))
    return replace(layout, cells=ArrayCells(columns, lines, cells.notes))


def _parsed(content: bytes, start: int, delimiter: str, decimal: str) -> tuple[np.ndarray, ...]:
    """The columns of the rows from byte `start` on. Raises ValueError for a cell that is no number."""
    if "pandas" in sys.modules or len(content) > _WORTH_IMPORTING:
        try:
            import pandas
        except ImportError:
            pass
        else:
            rows = io.BytesIO(content)  # shares the memory
            rows.seek(start)
            separator = r"\s+" if delimiter == " " else delimiter
            frame = pandas.read_csv(
                rows,
                sep=separator,
                header=None,
                decimal=decimal,
                dtype=np.float64,
                engine="c",
                skip_blank_lines=False,  # they are NaN
            )
            return tuple(frame[name].to_numpy() for name in frame)
    text = content[start:].replace(b",", b".") if decimal == "," else content[start:]
    blank = None if delimiter == " " else delimiter
    rows = np.loadtxt(io.StringIO(text.decode()), delimiter=blank, comments=None, ndmin=2)
    if len(rows) != text.count(b"\n") + (not text.endswith(b"\n")):
        raise ValueError("blank lines are passed over, which shifts the numbers of the others")
    return tuple(rows.T)
