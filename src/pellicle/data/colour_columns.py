"""Columns of colours in text files: which three are a colour, and their table of numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pellicle.data.tabular.layout import plain_columns
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import Line, TextFile, is_number, split
from pellicle.errors import DataError, UsageError

_SETS = {
    "rgb": (("r", "red"), ("g", "green"), ("b", "blue")),
    "xyz": (("X",), ("Y",), ("Z",)),
    "xyY": (("x",), ("y",), ("Y",)),
    "lab": (("L*", "L", "l*"), ("a*", "a"), ("b*", "b")),
}
"""Names of the channels of each set; case matters where it tells X, Y, Z from x, y, Y."""
_UNITS = {"%": "percent", "percent": "percent", "8 bit": "8-bit", "8-bit": "8-bit", "8bit": "8-bit"}
EXAMPLE = '`columns=["angle_deg", "R", "G", "B"]`'


def is_colour_header(names: Sequence[str]) -> bool:
    """Return True for a header that names three channels of a colour, and no wavelength or direction."""
    plain = {name.strip().lower().split("_")[0].split(" ")[0] for name in names}
    foreign = plain & {"wavelength", "wl", "lambda", "energy", "wavenumber", "frequency", "theta", "phi"}
    return not foreign and bool(channel_sets(names))


def first_cells(file: TextFile) -> tuple[list[str], str]:
    """Return the cells of the first line and its delimiter, with which they name a colour if any does."""
    first = file.lines[0].text
    delimiter = max("\t;, ", key=lambda mark: (bool(channel_sets(split(first, mark))), first.count(mark)))
    return split(first, delimiter), delimiter


def named_cells(
    file: TextFile, columns: str | Sequence[str] | None = None
) -> tuple[list[str], list[Line], list[list[str]], str]:
    """Return the column names, the rows with their cells, and the delimiter of a file of colours.

    `columns` names the columns in order, in place of the header. Rows are filled up with empty cells.

    **Raises:** UsageError without a header, DataError without rows and for a row of too many cells.
    """
    names, delimiter = first_cells(file)
    headed = not any(is_number(cell, ",") for cell in names)
    if columns is not None:
        given = columns.split(",") if isinstance(columns, str) else columns
        names = [name.strip() for name in given]
    elif not headed:
        raise UsageError(f"{file.path}: has no header, so name its columns, as in {EXAMPLE}")
    rows = list(file.lines[headed:])
    if not rows:
        raise DataError(
            f"{file.path}: has no row of colours below its header; expected rows as 0.41,0.35,0.22"
        )
    cells = [split(line.bare, delimiter) for line in rows]
    for line, row in zip(rows, cells, strict=True):
        if len(row) > len(names):
            raise DataError(
                f"{file.path}: line {line.number} has {len(row)} values where {len(names)} columns are named;"
                " correct that line"
            )
    return names, rows, [[*row, *[""] * (len(names) - len(row))] for row in cells], delimiter


def colour_table(
    file: TextFile,
    names: Sequence[str],
    rows: Sequence[Line],
    cells: Sequence[Sequence[str]],
    decimal_comma: bool,
) -> Table:
    """Return the table of cells that `named_cells` has found."""
    decimal = "," if decimal_comma else "."
    layout = plain_columns(names, list(zip(rows, cells, strict=True)), [], decimal=decimal)
    return Table(file.path, file.sha256, layout)


def bare_name(name: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, and the unit."""
    plain = name.strip()
    for mark, unit in _UNITS.items():
        for written in (f"({mark})", f"[{mark}]", f"_{mark.replace(' ', '_')}", f" {mark}"):
            if plain.lower().endswith(written):
                return plain[: -len(written)].strip(), unit
    return re.sub(r"[\s_]*[(\[]?(deg|degrees|°)[)\]]?$", "", plain), None


def channel_sets(names: Sequence[str]) -> dict[str, list[int]]:
    """Return the positions of the channels of every set that the names have: rgb, xyz, xyY and lab."""
    found = {}
    for kind, channels in _SETS.items():
        bare = [bare_name(name)[0] for name in names]
        own = [name.lower() for name in bare] if kind == "rgb" else bare
        at = [next((i for i, name in enumerate(own) if name in known), -1) for known in channels]
        if min(at) >= 0:
            found[kind] = at
    return found
