"""Text files of laboratory spectrometers: PerkinElmer PEDS, JASCO and Bruker's data point tables."""

import re
from collections.abc import Sequence
from pathlib import PurePath

from pellicle.data.formats.exports import Rows, all_cells, counted, delimiter_of, export
from pellicle.data.tabular.columns import UNSTATED, recognise
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

_UNSCALED = (1.0, 0.0)
"""Factor and offset of the ordinate of a PerkinElmer file."""
_POINTS = 6  # place of the number of points below #GR
_FACTS_BY_LINE = {4: "date", 9: "sample", 12: "instrument"}
"""Facts of a PerkinElmer file by the number of their line; lines may be blank."""

_QUANTITIES = {"ABS": "absorbance", "ABSORBANCE": "absorbance", "%T": "T (%)", "%R": "R (%)"}
_PEDS = _QUANTITIES | {"A": "absorbance", "T": "T (-)", "R": "R (-)"}
_JASCO = _QUANTITIES | {"TRANSMITTANCE": f"T ({UNSTATED})", "REFLECTANCE": f"R ({UNSTATED})"}
"""Column names of the quantities that the files state."""
_JASCO_FACTS = {"SPECTROMETER/DATA SYSTEM": "instrument", "DATE": "date", "TITLE": "sample"}
_MOST_HEADING = 200
_SECTION = re.compile(r"\[.*\]|#####.*")


def perkin_elmer(file: TextFile) -> list[Table] | None:
    """Return the spectrum of UV WinLab, format PEDS (`.asc`), or None for another format.

    The first line is `PE UV ... ASCII PEDS 4.00` (`PE IR` for infrared instruments). Below the keyword `#GR`
    stand the unit of the axis, that of the ordinate, a factor, an offset, start, step and number of points;
    below `#DATA` the rows. The layout is that of the test files of nomad-measurements.

    Raises DataError where it lacks the block `#GR` or rows, or has another axis or quantity.
    """
    path, first = file.path, file.lines[0].text
    if not first.startswith("PE ") or "PEDS" not in first:
        return None
    keywords = {comment.text.strip(): comment.number for comment in file.comments}
    if not {"GR", "DATA"} <= set(keywords):
        raise DataError(f"{path}: lacks the block #GR or #DATA of a PerkinElmer file; export it again")
    scale = [line for line in file.lines if keywords["GR"] < line.number < keywords["DATA"]]
    rows: Rows = [(line, line.bare.split()) for line in file.lines if line.number > keywords["DATA"]]
    if len(scale) < 2 or not rows:
        raise DataError(f"{path}: has no rows below #DATA, or no units below #GR; export it again")
    for line, usual in zip(scale[2:4], _UNSCALED, strict=False):
        if not is_number(line.text) or float(line.text) != usual:
            raise DataError(
                f"{path}: line {line.number} scales the ordinate ({line.text!r}, where {usual:g} "
                "is usual), which programs treat differently; export it again without"
            )
    axis, ordinate = scale[:2]
    unit = wavelength_unit(axis.text)
    if unit is None:
        raise DataError(
            f"{path}: line {axis.number} gives the unit of the axis as {axis.text!r}; export it in nm or cm-1"
        )
    word = ordinate.text.strip()
    # another quantity is refused where it is read
    names = [f"wavelength ({unit})", _PEDS.get(word.upper()) or f"single beam ({word})"]
    facts = [
        (_FACTS_BY_LINE[line.number], line.text) for line in file.lines[:20] if line.number in _FACTS_BY_LINE
    ]
    notes = counted(rows, [line.text.strip() for line in scale[_POINTS : _POINTS + 1]])
    return [export("PerkinElmer PEDS text", names, rows, facts=facts, notes=notes)]


def jasco(file: TextFile) -> list[Table] | None:
    """Return the spectrum of Spectra Manager, or None for another format.

    Lines of a keyword and a value (`TITLE`, `DATA TYPE`, `ORIGIN`, `XUNITS`, `YUNITS`, ..., as in JCAMP-DX
    but without `##`), the line `XYDATA`, rows, then sections such as `##### Extended Information` or
    `[Measurement Information]`. The keywords are those of the readers that other projects publish.

    Raises DataError where it has no rows, no unit of the axis or several values at each wavelength.
    """
    lines, path = file.lines, file.path
    heading = (i for i, line in enumerate(lines[:_MOST_HEADING]) if line.text.upper().startswith("XYDATA"))
    begin = next(heading, None)
    if begin is None or lines[0].text.startswith("##"):
        return None
    entries = [all_cells(line.text) for line in lines[:begin]]
    header = {key.upper(): " ".join(value for value in values if value) for key, *values in entries}
    if not {"TITLE", "DATA TYPE", "XUNITS"} <= set(header):
        return None
    rows = _rows_to_section(lines[begin + 1 :], file.comments)
    if not rows:
        raise DataError(f"{path}: has no rows below XYDATA on line {lines[begin].number}; export it again")
    if len(all_cells(lines[begin].text)) > 2:
        raise DataError(f"{path}: has spectra at several temperatures or times; export one of them")
    unit = wavelength_unit(header["XUNITS"]) or recognise(header["XUNITS"]).unit
    if unit is None:
        raise DataError(f"{path}: states XUNITS {header['XUNITS']!r}; export it along nm, eV or cm-1")
    names = [f"wavelength ({unit})", _jasco_quantity(header.get("YUNITS", ""))]
    names += [header.get(f"YUNITS{i}") or "_" for i in range(2, max(2, len(rows[0][1])))]
    facts = [(fact, header.get(key, "")) for key, fact in _JASCO_FACTS.items()]
    notes = counted(rows, [header.get("NPOINTS", "")])
    return [export("JASCO text", names, rows, facts=facts, notes=notes)]


def _rows_to_section(lines: Sequence[Line], comments: Sequence[Line]) -> Rows:
    """The rows up to a blank line, a section in brackets or a line of `#`."""
    below = [comment.number for comment in comments if lines and comment.number > lines[0].number]
    end = min(below, default=None)
    rows: Rows = []
    for i, line in enumerate(lines):
        blank = i > 0 and line.number > lines[i - 1].number + 1
        if blank or _SECTION.match(line.text) or (end is not None and line.number > end):
            break
        rows.append((line, [cell for cell in all_cells(line.bare) if cell]))
    return rows


def _jasco_quantity(text: str) -> str:
    """Column name of the ordinate."""
    plain = " ".join(text.upper().split())
    if plain in _JASCO:
        return _JASCO[plain]
    column = recognise(text)
    if column.role in ("R", "T") and (column.unit or column.unknown_unit):
        return text
    return text if column.role == "foreign" else f"{text or 'ordinate'} ({UNSTATED})"


def bruker_dpt(file: TextFile) -> list[Table] | None:
    """Return the spectrum of a data point table (`.dpt`) of OPUS, or None for another format.

    Its two columns of numbers name neither axis nor quantity, whose units are then asked for.
    """
    if PurePath(file.path).suffix.lower() != ".dpt" or file.comments:
        return None
    delimiter = delimiter_of(file.lines[0].text)
    rows = [(line, all_cells(line.bare, delimiter)) for line in file.lines]
    if not all(len(cells) == 2 and is_number(cells[0], ",") for _, cells in rows):
        return None
    names = [f"wavelength ({UNSTATED})", f"processed ({UNSTATED})"]
    return [export("Bruker dpt", names, rows, decimal="." if delimiter == "," else None)]
