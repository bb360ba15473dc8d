"""Text files of fibre spectrometers: Avantes, Ocean Optics (Ocean Insight) and StellarNet."""

import re
from collections.abc import Sequence
from pathlib import PurePath

from pellicle.data.formats.exports import Rows, all_cells, counted, delimiter_of, export, facts, keyword
from pellicle.data.tabular.columns import UNSTATED, declarations, recognise
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.errors import DataError

_UNIT = re.compile(r"\[(?P<unit>[^\]]*)\]")
_COUNTS = {
    "sample counts": r"sam|mess|prob|mues|muest|camp|échant|echant|monster",
    "dark counts": r"dar|dun|noir|obsc|oscur|donker|buio",
    "reference counts": r"r[eé]f(?!le)",
}
"""Beginnings of the names of Avantes' counts, in the languages of the program."""
_MOST_UNITS = 40
"""Lines that are searched for Avantes' units."""

BEGIN = re.compile(r">{3,}\s*Begin.*Data", re.IGNORECASE)
END = re.compile(r">{3,}\s*End", re.IGNORECASE)
_AXIS = re.compile(r"x[ _-]?axis mode", re.IGNORECASE)
_JAZ = {"W": "wavelength (nm)", "D": "dark counts", "S": "sample counts", "R": "reference counts"}
_PROCESSED = "P"
_OOIBASE = {".transmission": "T", ".reflection": "R", ".absorbance": "absorbance", ".scope": "scope"}
"""Quantity by the end of the name that OOIBase32 gives to its files."""
_MOST_HEADING = 200
_MOST_COLUMNS = 8  # beyond this, rows are spectra of a series

_FILE = re.compile(r'"\s*File\s*:\s*(?P<name>.*?)\.(?P<suffix>TRM|ABS|SSM|IRR|EPP)\b', re.IGNORECASE)
_STELLARNET = {"TRM": "processed (%)", "ABS": "absorbance", "IRR": "irradiance"}


def avantes(file: TextFile) -> list[Table] | None:
    """Return the spectrum of AvaSoft 6 to 8 (`.ttt`, `.trt`, `.txt`), or None for another format.

    Lines of settings, a line of names separated by semicolons, a line of their units in brackets, then rows:
    the wavelength, counts of the sample, the dark and the reference in an order that differs between
    versions, and the quantity that was measured. The layout is that of lightr's test files.

    Raises DataError where it has no rows.
    """
    lines = file.lines
    below = next((i for i in range(1, min(_MOST_UNITS, len(lines))) if _is_units(lines[i])), None)
    if below is None:
        return None
    names, units = (all_cells(lines[i].text, ";") for i in (below - 1, below))
    names = [name for name in names if name]
    if len(names) < 2 or len(names) + 1 < len(units):
        return None
    units += [""] * (len(names) - len(units))
    columns = [
        _avantes_column(name, unit, first=i == 0)
        for i, (name, unit) in enumerate(zip(names, units, strict=False))
    ]
    rows = [(line, all_cells(line.bare, ";")) for line in lines[below + 1 :]]
    # a closing delimiter leaves an empty cell
    rows = [(line, cells[:-1] if cells[len(columns) :] == [""] else cells) for line, cells in rows]
    if not rows:
        raise DataError(
            f"{file.path}: has no rows below the units on line {lines[below].number}; export it again"
        )
    above = lines[: below - 1]
    return [export("Avantes AvaSoft text", columns, rows, facts=facts(above, **_avantes_settings(above)))]


def _is_units(line: Line) -> bool:
    """Return True for `[nm] ;[counts] ;...`."""
    cells = [cell for cell in all_cells(line.text, ";") if cell]
    bracketed = len(cells) > 1 and all(map(_UNIT.fullmatch, cells))
    return bracketed and recognise(cells[0].strip("[]")).role == "wavelength"


def _avantes_column(name: str, unit: str, *, first: bool) -> str:
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
    return f"{role} ({plain or UNSTATED})" if role in ("R", "T") else name


def _avantes_settings(above: Sequence[Line]) -> dict[str, str]:
    """Integration time, instrument, and the comment that the first line holds."""
    settings = {}
    for line in above:
        key, value = keyword(line)
        if key.startswith("Integration time"):
            unit = _UNIT.search(key)
            settings["integration_time"] = " ".join(value.split()) + (f" {unit['unit']}" if unit else "")
        elif "spectrometer" in key:
            settings["instrument"] = value
        elif ":" not in line.text and line is above[0]:
            settings["sample"] = line.text
    return settings


def ocean_optics(file: TextFile) -> list[Table] | None:
    """Return the spectrum of OceanView, SpectraSuite, OOIBase32 or Jaz, or None for another format.

    Lines of `keyword: value`, then `>>>>>Begin ... Data<<<<<`, rows of wavelength in nm and value, and
    sometimes `>>>>>End ...`. Jaz writes the columns W, D, S, R and P: wavelength, dark, sample, reference and
    processed value. Few of the programs write what the processed value is. Layouts of lightr's and
    photobiologyInOut's readers.

    Raises DataError for a series of spectra, or an axis that is no wavelength.
    """
    lines, path = file.lines, file.path
    begin = next((i for i, line in enumerate(lines[:_MOST_HEADING]) if BEGIN.match(line.text)), None)
    if begin is None:
        return None
    above = lines[:begin]
    end = next((i for i in range(begin, len(lines)) if END.match(lines[i].text)), len(lines))
    rows: Rows = []
    for line in lines[begin + 1 : end]:
        delimiter = delimiter_of(line.text)
        rows.append((line, all_cells(line.text, " " if delimiter == "," else delimiter)))
    if not rows:
        raise DataError(f"{path}: has no rows below {lines[begin].text!r}; export it again")
    for line in above:
        key, value = keyword(line)
        if _AXIS.fullmatch(key) and "wavelength" not in value.lower():  # pixels or Raman shifts
            raise DataError(
                f"{path}: line {line.number} states the axis {value!r}; export it with wavelengths"
            )
    header = None if is_number(rows[0][1][0], ",") else rows.pop(0)[1]
    if not rows or (header is None and len(rows[0][1]) > _MOST_COLUMNS):
        what = "is a series of spectra in rows" if rows else "has a header but no rows"
        raise DataError(f"{path}: {what}; export one spectrum in two columns")
    quantity = _ocean_quantity(above, path)
    if header is None:
        names = ["wavelength (nm)", quantity, *["_"] * (len(rows[0][1]) - 2)][: max(2, len(rows[0][1]))]
    else:
        names = [_JAZ.get(name, quantity if name == _PROCESSED else name) for name in header]
        names = _without_idle(names, rows, quantity)
    stated = [value for key, value in map(keyword, above) if key.startswith("Number of Pixels")]
    stated_facts = facts(above, **_ocean_settings(above))
    return [export("Ocean Optics text", names, rows, facts=stated_facts, notes=counted(rows, stated))]


def _ocean_quantity(above: Sequence[Line], path: str) -> str:
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


def _ocean_settings(above: Sequence[Line]) -> dict[str, str]:
    """Integration time and instrument, whose keywords differ between the programs."""
    settings = {}
    for key, value in map(keyword, above):
        if unit := re.fullmatch(r"Integration Time \((\w+)\)", key):
            settings["integration_time"] = f"{value.split('Scans')[0].split('(')[0].strip()} {unit[1]}"
        elif re.fullmatch(r"Spectrometers?( Serial Number)?", key):
            settings.setdefault("instrument", value)
    return settings


def stellarnet(file: TextFile) -> list[Table] | None:
    """Return the spectrum of SpectraWiz (`.TRM`, `.ABS`, `.SSM`, `.IRR`), or None for another format.

    Lines that begin with a quotation mark, the first of which names the file (`"File: ...TRM"`), then rows of
    wavelength in nm and value. The file's own suffix states the quantity: `TRM` is a transmittance or
    reflectance in percent, `SSM` counts. The layout is that of readers of SpectraWiz files.

    Raises DataError where it has no rows.
    """
    named = _FILE.match(file.lines[0].text)
    if named is None:
        return None
    heading = [line for line in file.lines if line.text.startswith('"')]
    rows = [(line, line.bare.replace(";", " ").split()) for line in file.lines if line not in heading]
    if not rows:
        raise DataError(f"{file.path}: has no rows below its heading; export it again")
    names = ["wavelength (nm)", _STELLARNET.get(named["suffix"].upper(), "scope")]
    sample = re.split(r"[\\/]", named["name"])[-1]
    return [export("StellarNet SpectraWiz text", names, rows, facts=facts(heading, sample=sample))]
