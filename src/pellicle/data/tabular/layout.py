"""Table of a text file: delimiter, decimal mark, preamble, header and rows.

The preamble is any text before the first row of numbers; a line of column names may end it. Text between
rows is an error; a closing `>>>>>` line and text below a blank line that follows the rows are not.
"""

import io
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pellicle.data.tabular.columns import is_header, is_unit_row, recognise_all
from pellicle.data.tabular.table import DELIMITERS, SELECTED, ArrayCells, Table, TextCells, declarations
from pellicle.data.tabular.text import Line, TextFile, in_file, is_number, read_bytes, split, text_file
from pellicle.errors import DataError

_BLANK_NAMES = re.compile(r'"[^"]*"|[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?|\S+')
"""Names separated by blanks; `R (%)` and `"Wavelength nm."` are one name each."""
_COMMENT_MARKS = ("%", "!", "//", "*", ";")
"""Marks with which other programs begin a comment; `#` has been taken off before."""
_MARKER = ">>>>>"  # Ocean Optics puts such lines around the rows
_GROUPED = re.compile(r"\b\d{1,3}(?:\.\d{3})+,\d+\b(?=\s*[;\t])")
_COMMAS = ", or separate the columns with semicolons if their numbers have decimal commas"
_QUOTED_COMMA = re.compile(r'"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*"')
SMALLEST = 2**20
"""Bytes below which the lines of a file are read one by one, in a few hundredths of a second."""
_HEAD = 2**14
_WORTH_IMPORTING = 2**26
"""Bytes from which importing pandas takes less time than it saves: it parses three times as fast as NumPy."""
_SAMPLE = 60  # lines that vote on the dialect, spread over the file so that a preamble cannot outvote rows


def find_layout(file: TextFile) -> Table:
    """Find the layout of a file's lines. Raises DataError if no line has two numbers."""
    with in_file(file.path):
        return layout_of(file)


def layout_of(file: TextFile) -> Table:
    """Find the layout as `find_layout` does, with errors that do not name the file."""
    lines = _without_quotes(_without_empty_columns(file.lines))
    delimiter, decimal = _dialect(lines)
    first = _first_numeric(lines, delimiter, decimal)
    if first is None:
        last, hint = lines[-1], ""
        if re.search(r"\d\s*%", last.text):
            hint = "; leave the % signs out of the cells and put one into the header"
        elif re.match(r"\W*(\d{4}[-/]\d\d?[-/]|\d\d?[./]\d\d?[./])\d", last.text):
            hint = "; the first column has dates, not wavelengths"
        elif re.search(r"\d{1,3}[.,' ]\d{3}(?!\d)", last.text):
            hint = "; export numbers without thousands separators"
        raise DataError(
            f"line {last.number} ends the file without any row of two numbers; "
            f"expected rows of a wavelength and a value, as 550,0.21{hint}"
        )
    width = len(split(lines[first].bare, delimiter))
    start, header = _rows_begin(lines, first, width, delimiter, decimal)
    names, notes = _names(file, lines, start, header, delimiter, width), []
    if names and header is None:
        notes.append("column names taken from the comment above the first row")
    if names and width > len(names):
        raise DataError(
            f"line {lines[first].number} has {width} values but the header on line "
            f"{lines[header or 0].number} names {len(names)} columns; make them agree"
            f"{_COMMAS if delimiter == ',' and width <= 2 * len(names) else ''}"
        )
    skipped = start if header is None else header
    if skipped:
        notes.insert(0, f"{skipped} line{'s' * (skipped > 1)} of preamble skipped")
    end = max(_rows_end(lines, delimiter, decimal), first + 1)
    if end < len(lines):
        notes.append(f"text from line {lines[end].number} on, below the rows, skipped")
    rows = [line for line in lines[start:end] if not line.text.startswith(_MARKER)]
    if not rows:
        raise DataError("has no row of numbers below its header; expected rows as 550,0.21")
    trailing = len(lines[first].bare.split(delimiter)) if delimiter != " " else width
    above = [comment for comment in file.comments if comment.number < lines[start].number]
    declared = declarations([*above, *lines[:skipped], *lines[end:]])
    width = max(width, len(names or ()))
    cells = TextCells(delimiter, decimal, width, max(width, trailing), rows)
    named = tuple(names) if names else None
    return Table(named, width, cells, tuple(notes), "", declared, file.path, file.sha256)


def _without_empty_columns(lines: Sequence[Line]) -> Sequence[Line]:
    """Lines without the empty columns that a sheet may have to the left of its table."""
    while lines[0].text[0] in "\t;," and all(line.text.startswith(lines[0].text[0]) for line in lines):
        mark = lines[0].text[0]
        filled = [Line(line.number, line.text[1:], line.bare[1:]) for line in lines if line.text.strip(mark)]
        if not filled:
            return lines
        lines = filled
    return lines


def _without_quotes(lines: Sequence[Line]) -> Sequence[Line]:
    """Lines of cells as "550,5","0,21", which need no quotes with another mark between them."""
    if not any(_QUOTED_COMMA.search(line.text) for line in lines):
        return lines
    rows = [line for line in lines if _QUOTED_COMMA.search(line.text)]
    if any(";" in line.text or "\t" in line.text or len(split(line.bare, ",")) < 2 for line in rows):
        return lines
    return [
        Line(line.number, *(SELECTED.join(split(text, ",")) for text in (line.text, line.bare)))
        for line in lines
    ]


def _names(
    file: TextFile, lines: Sequence[Line], start: int, header: int | None, delimiter: str, width: int
) -> list[str] | None:
    """Names of the columns with the units of a row below, and samples of a line above where they repeat; or
    those in the last comment above the rows, as numpy.savetxt writes them."""
    if header is None:
        above = [comment for comment in file.comments if comment.number < lines[start].number]
        names = header_cells(above[-1].text, delimiter, width) if above else []
        return names if len(names) == width and is_header(names) else None
    names = header_cells(lines[header].text, delimiter, width)
    if header + 1 < start:
        units = [unit.strip("[]() ") for unit in split(lines[header + 1].text, delimiter)]
        units += [""] * (len(names) - len(units))
        names = [
            f"{name} ({unit})" if unit and f"({unit})" not in name else name
            for name, unit in zip(names, units, strict=False)
        ]
    samples = split(lines[header - 1].text, delimiter) if header else []
    if len(names) == len(samples) == len(set(samples)) and len(set(names)) < len(names):
        pairs = zip(samples, names, strict=True)
        names = [f"{sample} {name}" if names.count(name) > 1 else name for sample, name in pairs]
    return names


def _numbers_in(line: Line, delimiter: str, decimal: str = ",") -> tuple[int, int]:
    """Count the numbers and the cells of a line."""
    if line.text.startswith(_MARKER):
        return 0, 0
    decimal = "." if delimiter == "," else decimal
    cells = split(line.bare, delimiter)
    return sum(is_number(cell, decimal) for cell in cells), len(cells)


def _dialect(lines: Sequence[Line]) -> tuple[str, str]:
    """Delimiter with which most lines are all numbers (ties: tab, `;`, `,`, blank), and decimal mark."""
    sample = lines[:: max(1, len(lines) // _SAMPLE)]
    if any(SELECTED in line.bare for line in sample):
        return SELECTED, ","

    def votes(delimiter: str) -> tuple[int, int]:
        counted = [_numbers_in(line, delimiter) for line in sample]
        complete = sum(n == cells >= 2 for n, cells in counted)
        return complete, 0 if complete else sum(n >= 2 for n, cells in counted)  # "0.0 s" are not two cells

    delimiter = max(DELIMITERS, key=votes)
    grouped = next((match[0] for line in sample if (match := _GROUPED.search(line.text))), None)
    if grouped is not None:
        raise DataError(f"writes {grouped!r}; export numbers without thousands separators")
    if delimiter == ",":
        return delimiter, "."
    cells = [
        cell
        for line in sample
        if (counted := _numbers_in(line, delimiter))[0] == counted[1] >= 2
        for cell in split(line.bare, delimiter)
    ]
    comma = next((cell for cell in cells if "," in cell), None)
    point = next((cell for cell in cells if "." in cell), None)
    if comma and point:
        raise DataError(
            f"writes {comma!r} with a comma and {point!r} with a point, so the "
            "decimal mark is unclear; export it again with one of them and no thousands separators"
        )
    return delimiter, "," if comma else "."


def _first_numeric(lines: Sequence[Line], delimiter: str, decimal: str) -> int | None:
    """Index of the first line that is all numbers, else of the first with two numbers."""
    for complete in (True, False):
        for i, line in enumerate(lines):
            numbers, cells = _numbers_in(line, delimiter, decimal)
            if numbers >= 2 and (numbers == cells or not complete):
                return i
    return None


def _rows_begin(
    lines: Sequence[Line], first: int, width: int, delimiter: str, decimal: str
) -> tuple[int, int | None]:
    """Index of the first row and of the header line above it, or None.

    `first` is the first row without fault. Faulty rows may lie between it and the header; they are not
    preamble.
    """
    for header in range(first - 1, -1, -1):
        if is_header(header_cells(lines[header].text, delimiter, width)):
            units_below = header + 1 < first and is_unit_row(split(lines[header + 1].text, delimiter))
            return header + (2 if units_below else 1), header
    start, above = first, [split(line.bare, delimiter) for line in lines[:first]]
    while start and len(above[start - 1]) == width and is_number(above[start - 1][0], decimal):
        start -= 1  # a faulty row
    declared = declarations(lines[start - 1 : start])
    if start and not (lines[start - 1].text.startswith(_MARKER) or declared.axis or declared.signal):
        cells = split(lines[start - 1].text, delimiter)
        # two words of free text look like two names; only a known name tells them apart
        known = any(column.role != "other" for column in recognise_all(cells))
        words = delimiter == " " and (not known or cells[0].endswith(":"))
        if len(cells) >= width and not words and not any(is_number(cell, decimal) for cell in cells):
            names = split(lines[start - 2].text, delimiter) if start > 1 and is_unit_row(cells) else []
            named = len(names) == len(cells) and recognise_all(names)[0].role == "wavelength"
            return start, start - 2 if named else start - 1
    return start, None


def _rows_end(lines: Sequence[Line], delimiter: str, decimal: str) -> int:
    """Index of the first line of a trailer: below a blank line, or in brackets, and without rows after it."""
    last = len(lines) - 1
    while last and not is_number((split(lines[last].bare, delimiter) or [""])[0], decimal):
        last -= 1
    if last + 1 == len(lines):
        return len(lines)
    below = lines[last + 1]
    return last + 1 if below.number > lines[last].number + 1 or below.text[0] in "[<" else len(lines)


def header_cells(text: str, delimiter: str, width: int) -> list[str]:
    """Column names of a header line, whose delimiter may differ from that of the rows."""
    candidates = [
        [name.strip('"') for name in _BLANK_NAMES.findall(text)] if d == " " else split(text, d)
        for d in (delimiter, *DELIMITERS)
    ]
    words = candidates[-1]
    marked = bool(words) and words[0] in _COMMENT_MARKS
    if marked:
        candidates.append(words[1:])
    # names of several words, two blanks apart
    candidates.append(re.split(r"\s{2,}", text.removeprefix(words[0]).strip() if marked else text.strip()))
    return next((names for names in candidates if len(names) == width), candidates[0])


def read_table(path: str | os.PathLike[str]) -> Table:
    """Find the layout of a text file of one table; cells are read later.

    Raises DataError for a file that cannot be read or has no rows of numbers.
    """
    return find_layout(text_file(*read_bytes(path), path))


def bulk_layout(
    content: bytes, head: Callable[[bytes], TextFile], find: Callable[[TextFile], Table | None]
) -> Table | None:
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
