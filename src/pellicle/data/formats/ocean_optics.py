"""Text files of Ocean Optics (Ocean Insight): OceanView, SpectraSuite, OOIBase32 and Jaz.

Lines of `keyword: value`, then `>>>>>Begin ... Data<<<<<`, rows of wavelength in nm and value, and sometimes
`>>>>>End ...`. Jaz writes the columns W, D, S, R and P: wavelength, dark, sample, reference and processed
value. Few of the programs write what the processed value is. Layouts of lightr's and photobiologyInOut's
readers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath

from pellicle.data.formats.instrument_rows import (
    Rows,
    all_cells,
    counted,
    decimal_mark,
    delimiter_of,
    facts,
)
from pellicle.data.tabular.columns import UNSTATED
from pellicle.data.tabular.declarations import declarations
from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.errors import DataError

BEGIN = re.compile(r">{3,}\s*Begin.*Data", re.IGNORECASE)
END = re.compile(r">{3,}\s*End", re.IGNORECASE)
_JAZ = {"W": "wavelength (nm)", "D": "dark counts", "S": "sample counts", "R": "reference counts"}
_PROCESSED = "P"
_OOIBASE = {".transmission": "T", ".reflection": "R", ".absorbance": "absorbance", ".scope": "scope"}
"""Quantity by the end of the name that OOIBase32 gives to its files."""
_MOST_HEADING = 200
_MOST_COLUMNS = 8  # beyond this, rows are spectra of a series


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the spectrum, or None for another format.

    Raises DataError for a series of spectra, or an axis that is no wavelength.
    """
    lines, path = file.lines, file.path
    begin = next((i for i, line in enumerate(lines[:_MOST_HEADING]) if BEGIN.match(line.text)), None)
    if begin is None:
        return None
    above = lines[:begin]
    end = next((i for i in range(begin, len(lines)) if END.match(lines[i].text)), len(lines))
    rows: Rows = [(line, _cells(line)) for line in lines[begin + 1 : end]]
    if not rows:
        raise DataError(f"{path}: has no rows below {lines[begin].text!r}; export it again")
    _check_axis(above, path)
    header = None if is_number(rows[0][1][0], ",") else rows.pop(0)[1]
    if not rows or (header is None and len(rows[0][1]) > _MOST_COLUMNS):
        what = "is a series of spectra in rows" if rows else "has a header but no rows"
        raise DataError(f"{path}: {what}; export one spectrum in two columns")
    quantity = _quantity(above, path)
    if header is None:
        names = ["wavelength (nm)", quantity, *["_"] * (len(rows[0][1]) - 2)][: max(2, len(rows[0][1]))]
    else:
        names = [_JAZ.get(name, quantity if name == _PROCESSED else name) for name in header]
        names = _without_idle(names, rows, quantity)
    stated = [line.text.partition(":")[2] for line in above if line.text.startswith("Number of Pixels")]
    return [
        plain_columns(
            names,
            rows,
            ["read as an Ocean Optics text file", *counted(rows, stated, path)],
            facts=facts("Ocean Optics text", above, **_settings(above)),
            decimal=decimal_mark(rows),
        )
    ]


def _cells(line: Line) -> list[str]:
    return all_cells(line.text, delimiter_of(line.text) if "\t" in line.text or ";" in line.text else " ")


def _check_axis(above: Sequence[Line], path: str) -> None:
    """Raise DataError for an axis of pixels or Raman shifts."""
    for line in above:
        key, _, value = line.text.partition(":")
        if (
            re.fullmatch(r"x[ _-]?axis mode", key.strip(), re.IGNORECASE)
            and "wavelength" not in value.lower()
        ):
            raise DataError(
                f"{path}: line {line.number} states the axis {value.strip()!r}; export it with wavelengths"
            )


def _quantity(above: Sequence[Line], path: str) -> str:
    """Column name of the processed value, with its unit where the file states it."""
    declared = declarations(above).signal
    by_name = _OOIBASE.get(PurePath(path).suffix.lower())
    if above and "irradiance" in above[0].text.lower():
        return "irradiance"
    if declared is None:
        return by_name if by_name in ("absorbance", "scope") else f"{by_name or 'processed'} ({UNSTATED})"
    column = declared.column
    if column.role == "foreign" or column.unit:
        return "irradiance" if column.role == "foreign" else column.name
    return f"{column.role} ({UNSTATED})"


def _without_idle(names: list[str], rows: Rows, quantity: str) -> list[str]:
    """The names without a processed value that only repeats the counts of the sample."""
    if quantity in names and "sample counts" in names:
        processed, sample = names.index(quantity), names.index("sample counts")
        if all(cells[processed : processed + 1] == cells[sample : sample + 1] for _, cells in rows):
            return [*names[:processed], "_", *names[processed + 1 :]]
    return names


def _settings(above: Sequence[Line]) -> dict[str, str]:
    """Integration time and instrument, whose keywords differ between the programs."""
    found = {}
    for line in above:
        key, _, value = line.text.partition(":")
        if unit := re.fullmatch(r"Integration Time \((\w+)\)", key.strip()):
            found["integration_time"] = f"{value.split('Scans')[0].split('(')[0].strip()} {unit[1]}"
        elif re.fullmatch(r"Spectrometers?( Serial Number)?", key.strip()):
            found.setdefault("instrument", value.strip())
    return found
