"""Text files of JASCO's Spectra Manager.

Lines of a keyword and a value (`TITLE`, `DATA TYPE`, `ORIGIN`, `XUNITS`, `YUNITS`, ..., as in JCAMP-DX but
without `##`), the line `XYDATA`, rows, then sections such as `##### Extended Information` or
`[Measurement Information]`. The keywords are those of the readers that other projects publish.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from pellicle.data.formats.instrument_rows import Rows, all_cells, counted, decimal_mark, delimiter_of
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

_QUANTITIES = {
    "ABSORBANCE": "absorbance",
    "ABS": "absorbance",
    "TRANSMITTANCE": "T (unit not stated)",
    "%T": "T (%)",
    "REFLECTANCE": "R (unit not stated)",
    "%R": "R (%)",
}
_FACTS = {"SPECTROMETER/DATA SYSTEM": "instrument", "DATE": "date", "TITLE": "sample"}
_MOST_HEADING = 200
_SECTION = re.compile(r"\[.*\]|#####.*")


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the spectrum, or None for another format.

    Raises DataError where it has no rows, no unit of the axis or several values at each wavelength.
    """
    lines, path = file.lines, file.path
    at = next(
        (i for i, line in enumerate(lines[:_MOST_HEADING]) if line.text.upper().startswith("XYDATA")), None
    )
    if at is None or lines[0].text.startswith("##"):
        return None
    header = dict(_entry(line) for line in lines[:at])
    if not {"TITLE", "DATA TYPE", "XUNITS"} <= set(header):
        return None
    rows = _rows(lines[at + 1 :], file.comments)
    if not rows:
        raise DataError(f"{path}: has no rows below XYDATA on line {lines[at].number}; export it again")
    if len(all_cells(lines[at].text, delimiter_of(lines[at].text))) > 2:
        raise DataError(f"{path}: has spectra at several temperatures or times; export one of them")
    unit = wavelength_unit(header["XUNITS"]) or recognise(header["XUNITS"]).unit
    if unit is None:
        raise DataError(f"{path}: states XUNITS {header['XUNITS']!r}; export it along nm, eV or cm-1")
    names = [f"wavelength ({unit})", _quantity(header.get("YUNITS", ""))]
    names += [header.get(f"YUNITS{i}") or "_" for i in range(2, max(2, len(rows[0][1])))]
    found = [("format", "JASCO text")]
    found += [(fact, header[key]) for key, fact in _FACTS.items() if header.get(key)]
    notes = ["read as a JASCO text file", *counted(rows, [header.get("NPOINTS", "")], path)]
    return [plain_columns(names, rows, notes, facts=found, decimal=decimal_mark(rows))]


def _entry(line: Line) -> tuple[str, str]:
    """Keyword and value of a line."""
    key, *values = all_cells(line.text, delimiter_of(line.text))
    return key.upper(), " ".join(value for value in values if value)


def _rows(lines: Sequence[Line], comments: Sequence[Line]) -> Rows:
    """The rows up to a blank line, a section in brackets or a line of `#`."""
    end = min(
        (comment.number for comment in comments if lines and comment.number > lines[0].number), default=None
    )
    rows: Rows = []
    for i, line in enumerate(lines):
        blank = i > 0 and line.number > lines[i - 1].number + 1
        if blank or _SECTION.match(line.text) or (end is not None and line.number > end):
            break
        rows.append((line, [cell for cell in all_cells(line.bare, delimiter_of(line.bare)) if cell]))
    return rows


def _quantity(text: str) -> str:
    """Column name of the ordinate."""
    plain = " ".join(text.upper().split())
    if plain in _QUANTITIES:
        return _QUANTITIES[plain]
    column = recognise(text)
    if column.role in ("R", "T") and (column.unit or column.unknown_unit):
        return text
    return text if column.role == "foreign" else f"{text or 'ordinate'} (unit not stated)"
