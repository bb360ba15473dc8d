"""Text files of Avantes AvaSoft 6 to 8 (`.ttt`, `.trt`, `.txt`).

Lines of settings, a line of names separated by semicolons, a line of their units in brackets, then rows: the
wavelength, counts of the sample, the dark and the reference in an order that differs between versions, and
the quantity that was measured. The layout is that of lightr's test files.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from pellicle.data.formats.instrument_rows import Rows, all_cells, decimal_mark, facts
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile
from pellicle.errors import DataError

_UNIT = re.compile(r"\[(?P<unit>[^\]]*)\]")
_COUNTS = {
    "sample counts": r"sam|mess|prob|mues|muest|camp|échant|echant|monster",
    "dark counts": r"dar|dun|noir|obsc|oscur|donker|buio",
    "reference counts": r"r[eé]f(?!le)",
}
"""Beginnings of the names of the counts, in the languages of the program."""
_MOST_HEADING = 40


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the spectrum, or None for another format. Raises DataError where it has no rows."""
    lines = file.lines
    at = next((i for i in range(1, min(_MOST_HEADING, len(lines))) if _is_units(lines[i])), None)
    if at is None:
        return None
    names, units = (all_cells(lines[i].text, ";") for i in (at - 1, at))
    names = [name for name in names if name]
    if len(names) < 2 or len(names) + 1 < len(units):
        return None
    units += [""] * (len(names) - len(units))
    columns = [
        _column(name, unit, first=i == 0) for i, (name, unit) in enumerate(zip(names, units, strict=False))
    ]
    rows: Rows = [(line, _without_last(all_cells(line.bare, ";"), len(columns))) for line in lines[at + 1 :]]
    if not rows:
        raise DataError(
            f"{file.path}: has no rows below the units on line {lines[at].number}; export it again"
        )
    return [
        plain_columns(
            columns,
            rows,
            ["read as an Avantes AvaSoft text file"],
            facts=facts("Avantes AvaSoft text", lines[: at - 1], **_settings(lines[: at - 1])),
            decimal=decimal_mark(rows),
        )
    ]


def _is_units(line: Line) -> bool:
    """Return True for `[nm] ;[counts] ;...`."""
    cells = [cell for cell in all_cells(line.text, ";") if cell]
    return (
        len(cells) > 1
        and all(map(_UNIT.fullmatch, cells))
        and recognise(cells[0].strip("[]")).role == "wavelength"
    )


def _column(name: str, unit: str, *, first: bool) -> str:
    """Canonical name of a column."""
    plain = unit.strip("[]").strip().lower()
    if first:
        return f"wavelength ({plain})"
    for counts, beginning in _COUNTS.items():
        if re.match(beginning, name.lower()):
            return counts
    if "counts" in plain or "scope" in name.lower():
        return f"scope ({name})"
    if "watt" in plain or "irrad" in name.lower():
        return "irradiance"
    role = recognise(name).role
    if plain.startswith("%") and role in ("R", "T"):
        return f"{role} (%)"
    if recognise(name).unit == "absorbance" or "abs" in plain or plain in ("a.u.", "au"):
        return "absorbance"
    return f"{role} ({plain or 'unit not stated'})" if role in ("R", "T") else name


def _without_last(cells: list[str], width: int) -> list[str]:
    """The cells without an empty one behind a closing delimiter."""
    return cells[:width] if len(cells) == width + 1 and not cells[-1] else cells


def _settings(above: Sequence[Line]) -> dict[str, str]:
    """Integration time, instrument, and the comment that the first line holds."""
    found = {}
    for line in above:
        key, mark, value = line.text.partition(":")
        if key.startswith("Integration time"):
            unit = _UNIT.search(key)
            found["integration_time"] = " ".join(value.split()) + (f" {unit['unit']}" if unit else "")
        elif "spectrometer" in key:
            found["instrument"] = value.strip()
        elif not mark and line is above[0]:
            found["sample"] = line.text
    return found
