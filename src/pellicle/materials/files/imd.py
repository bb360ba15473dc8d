"""`.nk` files of IMD and of the CXRO collection: comments that begin with `;`, then Å, n and k."""

from __future__ import annotations

from pellicle.errors import DataError
from pellicle.materials.files.optical_constants import MaterialFile, OpticalConstants, material_file
from pellicle.materials.files.text import MaterialText, is_row, read_rows


def read(text: MaterialText) -> MaterialFile | None:
    """Read an `.nk` file of IMD; None for another file.

    Raises DataError for an `.nk` file of bare numbers, whose unit is unknown, and for faulty rows.
    """
    if text.suffix != ".nk" or not text.lines:
        return None
    if is_row(text.lines[0].text):
        raise DataError(
            f"{text.path}: does not state the unit of its first column: put a line above its rows, "
            "`; n,k of ...` for Å as in files of IMD, or `wavelength_nm,n,k`"
        )
    if not text.lines[0].text.startswith(";"):
        return None
    names = ("wavelength", "n", "k")
    rows = read_rows(text.path, [line for line in text.lines if not line.text.startswith(";")], names)
    columns = [rows.columns[name] for name in names]
    constants = OpticalConstants(text.path, columns[0], "A", columns[1], columns[2], False, names, rows.where)
    return material_file(constants, "IMD material file", text.lines[0].text.strip("; "))
