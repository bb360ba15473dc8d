"""Files of several tables: scans side by side, each with its own wavelengths, or tables below each other.

Agilent (Varian) Cary and Shimadzu UVProbe write a line with the name of each scan over its first column, a
line such as `Wavelength (nm),%T,Wavelength (nm),%T`, the rows, and Cary the method below a blank line.
Thermo's INSIGHT and other programs that measure a batch write title, date, names, rows, and again. The
layouts are those of public exports.
"""

import dataclasses
import re
from collections.abc import Sequence
from typing import NamedTuple

from pellicle.data.formats.exports import Rows, all_cells, decimal_mark, delimiter_of, facts, told_apart
from pellicle.data.tabular.columns import Column, is_header, recognise
from pellicle.data.tabular.layout import layout_of
from pellicle.data.tabular.table import Table, declarations, plain_columns
from pellicle.data.tabular.text import TextFile, is_number

_MOST_HEADING = 40
_BASELINE = re.compile(r"base ?line|(100|0) ?%? ?[TR]\b", re.IGNORECASE)
_COLLECTED = re.compile(r"Collection Time:\s*(.+)")
_INSTRUMENT = re.compile(r"Instrument(?: Name)?(?:\s{2,}|:\s*)(\S.*)")
_IGNORED = ("foreign", "other", "sigma")


class _Scan(NamedTuple):
    name: str
    columns: tuple[Column, ...]
    rows: Rows


def scans_side_by_side(file: TextFile) -> list[Table] | None:
    """Return one layout for each scan, without baselines, or None for another format."""
    lines = file.lines
    for header in range(min(_MOST_HEADING, len(lines))):
        for delimiter in ("\t", ";", ","):
            groups = _groups(all_cells(lines[header].text, delimiter))
            names = all_cells(lines[header - 1].text, delimiter) if header else []
            above = lines[header - 1].text  # over a single scan `sample 1,` or `"sample 1"`
            if len(names) == 1:
                named = len(above) > 2 and above[0] == above[-1] == '"'
            else:
                named = bool(names and names[0]) and not any(names[1:]) and not is_number(names[0], ",")
            if groups and (len(groups) > 1 or named):
                return _scans(file, header, delimiter, groups, names)
    return None


def numbered_columns(file: TextFile) -> list[Table] | None:
    """Return the table whose heads are a wavelength and numbers, as times of a series, or None for another.

    The rows below begin with numbers; a table whose rows begin with names has its wavelengths in the head.
    """
    for header, line in enumerate(file.lines[:_MOST_HEADING]):
        delimiter = delimiter_of(line.text)
        names = all_cells(line.text, delimiter)
        if len(names) < 3 or delimiter == " " or recognise(names[0]).role != "wavelength":
            continue
        rows = [(below, all_cells(below.bare, delimiter)) for below in file.lines[header + 1 :]]
        if not all(is_number(name, ",") for name in names[1:]) or not rows:
            continue
        if not all(is_number(cells[0], ",") and len(cells) == len(names) for _, cells in rows):
            continue
        mark = "." if delimiter == "," else decimal_mark(rows)
        return [plain_columns(names, rows, [f"{len(names) - 1} spectra, named by the head"], decimal=mark)]
    return None


def _groups(header: Sequence[str]) -> list[tuple[Column, ...]]:
    """Columns of each scan: an axis and what follows it; none for another line."""
    columns = [recognise(name, position) for position, name in enumerate(header)]
    if not columns or columns[0].role != "wavelength":
        return []
    begins = [i for i, column in enumerate(columns) if column.role == "wavelength"]
    ends = [*begins, len(columns)][1:]
    groups = [
        tuple(column for column in columns[begin:end] if column.name)
        for begin, end in zip(begins, ends, strict=True)
    ]
    return groups if all(len(group) > 1 for group in groups) else []


def _scans(
    file: TextFile, header: int, delimiter: str, groups: Sequence[tuple[Column, ...]], names: Sequence[str]
) -> list[Table] | None:
    body = [(line, all_cells(line.bare, delimiter)) for line in file.lines[header + 1 :]]
    end = _rows_end(body, groups)
    if not end:
        return None
    below = [line for line, _ in body[end:]]
    scans = []
    for group in groups:
        rows: Rows = []
        for line, cells in body[:end]:  # one scan may end before the others
            values = [cells[column.position] if column.position < len(cells) else "" for column in group]
            if any(values):
                rows.append((line, values))
        # the name is the cell over the columns, or that of the value
        over = [names[column.position] for column in group if column.position < len(names)]
        title = next((name for name in over if name and not is_number(name, ",")), "")
        if rows:
            scans.append(_Scan(re.sub(r"\s*-\s*RawData$", "", title) or group[1].name, group, rows))
    collected = [match[1].strip() for line in below if (match := _COLLECTED.search(line.text))]
    instrument = next((m[1].strip() for line in below if (m := _INSTRUMENT.match(line.text.strip()))), "")
    readable = [scan for scan in scans if any(column.role not in _IGNORED for column in scan.columns[1:])]
    kept = [scan for scan in readable if not _BASELINE.search(scan.name)] or scans
    left_out = [repr(scan.name) for scan in scans if scan not in kept]
    notes = [f"{len(scans)} scans side by side"] if len(scans) > 1 else []
    notes += [f"left out as baselines or other quantities: {', '.join(left_out)}"] if left_out else []
    notes += [f"text from line {below[0].number} on, below the rows, read as the method"] if below else []
    declared = declarations([*file.lines[:header], *file.comments])
    layouts = []
    for scan, name in zip(kept, told_apart([scan.name for scan in kept]), strict=True):
        index = scans.index(scan)
        date = collected[index] if len(collected) == len(scans) else ""
        title = scan.name if scan.name != scan.columns[1].name else ""
        known = {"instrument": instrument, "date": date, "sample": title}
        layout = plain_columns(
            [column.name for column in scan.columns],
            scan.rows,
            notes,
            name=name if len(kept) > 1 else "",
            facts=facts([*file.lines[:header], *below], **known),
            decimal="." if delimiter == "," else decimal_mark(scan.rows),
        )
        stated = dataclasses.replace(declared, facts=layout.declared.facts)
        layouts.append(dataclasses.replace(layout, declared=stated))
    return layouts


def _rows_end(body: Rows, groups: Sequence[tuple[Column, ...]]) -> int:
    """Number of lines up to the last row, or the faulty one that ends the file."""
    axes = [group[0].position for group in groups]

    def is_row(cells: Sequence[str], width: int) -> bool:
        parts = [cells[axis : axis + width] for axis in axes]
        return any(len(part) == width and all(is_number(cell, ",") for cell in part) for part in parts)

    last = next((i for i in range(len(body) - 1, -1, -1) if is_row(body[i][1], 2)), -1)
    while last >= 0 and last + 1 < len(body) and is_row(body[last + 1][1], 1):
        last += 1
    return last + 1


def stacked_tables(file: TextFile) -> list[Table] | None:
    """Return one layout for each table, or None where the names are not repeated."""
    lines = file.lines
    first = next((line for line in lines[:40] if is_header(all_cells(line.text))), None)
    headers = [i for i, line in enumerate(lines) if first is not None and line.text == first.text]
    if len(headers) < 2:
        return None
    starts = []
    for header, after in zip(headers, [-1, *headers], strict=False):
        start = header  # the first line above that is no row of the table before
        while start > after + 1 and not (
            len(cells := all_cells(lines[start - 1].text)[:2]) == 2
            and all(is_number(cell, ",") for cell in cells)
        ):
            start -= 1
        starts.append(start)
    layouts = []
    for i, (start, header) in enumerate(zip(starts, headers, strict=True)):
        stop = starts[i + 1] if i + 1 < len(starts) else len(lines)
        layout = layout_of(TextFile(file.path, file.sha256, lines[start:stop]))
        title = lines[start].text.strip('"') if start < header else f"table {i + 1}"
        note = f"table {i + 1} of {len(headers)} in the file"
        layouts.append(dataclasses.replace(layout, name=title, remarks=(note, *layout.remarks)))
    return layouts
