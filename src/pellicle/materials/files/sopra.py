"""Files of the SOPRA database: `.nk`, an even grid, and `.MAT`, records separated by `*`.

An `.nk` file begins with the number of its unit (1 eV, 2 µm, 3 1/cm, 4 nm), first and last point, and the
number of intervals; the other lines hold n and k. A `.MAT` record is `DATA1*<row>*<nm>*<n>*<k>*$`.
"""

from __future__ import annotations

import re

import numpy as np

from pellicle.errors import DataError
from pellicle.materials.files.optical_constants import MaterialFile, OpticalConstants, material_file
from pellicle.materials.files.text import Line, MaterialText, cells, is_row, read_rows

_UNITS = {"1": "eV", "2": "um", "3": "cm-1", "4": "nm"}
_KIND = "SOPRA material file"


def read_grid(text: MaterialText) -> MaterialFile | None:
    """Read an `.nk` file of SOPRA; None for another file.

    Raises DataError for a file that has not as many rows as its first line announces, and for faulty rows.
    """
    if text.suffix != ".nk" or not text.lines or not is_row(text.lines[0].text):
        return None
    head = cells(text.lines[0].text)
    if len(head) != 4 or head[0] not in _UNITS or not re.fullmatch(r"\d{1,7}", head[3]):
        return None
    intervals = int(head[3])
    rows = read_rows(text.path, text.lines[1:], ("n", "k"))
    if len(rows.lines) != intervals + 1:
        raise DataError(
            f"{text.path}: announces {intervals} intervals, which are {intervals + 1} rows, but has "
            f"{len(rows.lines)}; it is cut off, so fetch it again"
        )
    ends = float(head[1]), float(head[2])
    if not np.isfinite(ends).all():
        raise DataError(f"{text.path}: line {text.lines[0].number} gives no finite range of its axis")
    axis = np.linspace(*ends, intervals + 1)
    names = ("axis", "n", "k")
    return material_file(
        OpticalConstants(
            text.path, axis, _UNITS[head[0]], rows.columns["n"], rows.columns["k"], False, names, rows.where
        ),
        _KIND,
    )


def read_records(text: MaterialText) -> MaterialFile | None:
    """Read a `.MAT` file of SOPRA; None for another file.

    Raises DataError for a file that has not as many records as it announces, and for faulty ones.
    """
    if not any(line.text.startswith("DATA1*") for line in text.lines):
        return None
    records = [(line, line.text.split("*")) for line in text.lines]
    data = [Line(line.number, " ".join(parts[2:5])) for line, parts in records if parts[0] == "DATA1"]
    announced = next((parts[1] for _, parts in records if parts[0] == "POINTS" and len(parts) > 1), None)
    if announced is not None and announced.strip() != str(len(data)):
        raise DataError(
            f"{text.path}: announces {announced} rows but has {len(data)}; it is cut off, so fetch it again"
        )
    names = ("wavelength", "n", "k")
    rows = read_rows(text.path, data, names)
    columns = [rows.columns[name] for name in names]
    comments = " ".join(parts[1].strip() for _, parts in records if parts[0] == "COMMENT" and len(parts) > 1)
    constants = OpticalConstants(
        text.path, columns[0], "nm", columns[1], columns[2], False, names, rows.where
    )
    return material_file(constants, _KIND)._replace(comments=comments)
