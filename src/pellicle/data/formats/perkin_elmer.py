"""Text files (`.asc`) of PerkinElmer's UV WinLab, format PEDS.

The first line is `PE UV ... ASCII PEDS 4.00` (`PE IR` for infrared instruments). Below the keyword `#GR`
stand the unit of the axis, that of the ordinate, a factor, an offset, start, step and number of points; below
`#DATA` the rows. The layout is that of the test files of nomad-measurements.
"""

from __future__ import annotations

from pellicle.data.formats.instrument_rows import Rows, counted, decimal_mark
from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

_ORDINATES = {
    **dict.fromkeys(("A", "ABS", "ABSORBANCE"), "absorbance"),
    "%T": "T (%)",
    "T": "T (-)",
    "%R": "R (%)",
    "R": "R (-)",
}
_UNSCALED = (1.0, 0.0)
"""Factor and offset of the ordinate."""
_POINTS = 6  # place of the number of points below #GR
_FACTS = {4: "date", 9: "sample", 12: "instrument"}
"""Facts by the number of their line; lines may be blank."""


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the spectrum, or None for another format.

    Raises DataError where it lacks the block `#GR` or rows, or has another axis or quantity.
    """
    first = file.lines[0].text
    if not first.startswith("PE ") or "PEDS" not in first:
        return None
    keywords = {comment.text.strip(): comment.number for comment in file.comments}
    if not {"GR", "DATA"} <= set(keywords):
        raise DataError(f"{file.path}: lacks the block #GR or #DATA of a PerkinElmer file; export it again")
    scale = [line for line in file.lines if keywords["GR"] < line.number < keywords["DATA"]]
    rows: Rows = [(line, line.bare.split()) for line in file.lines if line.number > keywords["DATA"]]
    if len(scale) < 2 or not rows:
        raise DataError(f"{file.path}: has no rows below #DATA, or no units below #GR; export it again")
    for line, usual in zip(scale[2:4], _UNSCALED, strict=False):
        if not is_number(line.text) or float(line.text) != usual:
            raise DataError(
                f"{file.path}: line {line.number} scales the ordinate ({line.text!r}, where {usual:g} "
                "is usual), which programs treat differently; export it again without"
            )
    names = [_axis(scale[0], file.path), _ordinate(scale[1])]
    stated = [line.text.strip() for line in scale[_POINTS : _POINTS + 1]]
    found = [("format", "PerkinElmer PEDS text")]
    found += [(_FACTS[line.number], line.text) for line in file.lines[:20] if line.number in _FACTS]
    notes = ["read as a PerkinElmer text file", *counted(rows, stated, file.path)]
    return [plain_columns(names, rows, notes, facts=found, decimal=decimal_mark(rows))]


def _axis(line: Line, path: str) -> str:
    unit = wavelength_unit(line.text)
    if unit is None:
        raise DataError(
            f"{path}: line {line.number} gives the unit of the axis as {line.text!r}; export it in nm or cm-1"
        )
    return f"wavelength ({unit})"


def _ordinate(line: Line) -> str:
    """Column name of the ordinate; another quantity is refused where it is read."""
    return _ORDINATES.get(line.text.strip().upper()) or f"single beam ({line.text.strip()})"
