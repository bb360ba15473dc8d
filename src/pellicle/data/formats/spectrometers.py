"""Text files of spectrometers: Avantes, Ocean Optics, StellarNet, PerkinElmer PEDS, JASCO, Bruker."""

import re
from collections.abc import Sequence
from pathlib import PurePath

from pellicle.data.formats.exports import Rows, all_cells, counted, delimiter_of, export, facts, keyword
from pellicle.data.tabular.columns import UNSTATED, recognise
from pellicle.data.tabular.table import Table, declarations
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.data.tabular.units import wavelength_unit
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
_X_AXIS = re.compile(r"x[ _-]?axis mode", re.IGNORECASE)
_JAZ = {"W": "wavelength (nm)", "D": "dark counts", "S": "sample counts", "R": "reference counts"}
_PROCESSED = "P"
_OOIBASE = {".transmission": "T", ".reflection": "R", ".absorbance": "absorbance", ".scope": "scope"}
"""Quantity by the end of the name that OOIBase32 gives to its files."""
_MOST_COLUMNS = 8  # beyond this, rows are spectra of a series

_STELLARNET_FILE = re.compile(
    r'"\s*File\s*:\s*(?P<name>.*?)\.(?P<suffix>TRM|ABS|SSM|IRR|EPP)\b', re.IGNORECASE
)
_STELLARNET = {"TRM": "processed (%)", "ABS": "absorbance", "IRR": "irradiance"}

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
        raise DataError(f"has no rows below the units on line {lines[below].number}; export it again")
    above, settings = lines[: below - 1], {}
    for line in above:
        key, value = keyword(line)
        if key.startswith("Integration time"):
            unit = _UNIT.search(key)
            settings["integration_time"] = " ".join(value.split()) + (f" {unit['unit']}" if unit else "")
        elif "spectrometer" in key:
            settings["instrument"] = value
        elif ":" not in line.text and line is above[0]:
            settings["sample"] = line.text
    return [export("Avantes AvaSoft text", columns, rows, facts=facts(above, **settings))]


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


def ocean_optics(file: TextFile) -> list[Table] | None:
    """Return the spectrum of OceanView, SpectraSuite, OOIBase32 or Jaz, or None for another format.

    Lines of `keyword: value`, then `>>>>>Begin ... Data<<<<<`, rows of wavelength in nm and value, and
    sometimes `>>>>>End ...`. Jaz writes the columns W, D, S, R and P: wavelength, dark, sample, reference and
    processed value. Few of the programs write what the processed value is. Layouts of lightr's and
    photobiologyInOut's readers.

    Raises DataError for a series of spectra, or an axis that is no wavelength.
    """
    lines = file.lines
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
        raise DataError(f"has no rows below {lines[begin].text!r}; export it again")
    for line in above:
        key, value = keyword(line)
        if _X_AXIS.fullmatch(key) and "wavelength" not in value.lower():  # pixels or Raman shifts
            raise DataError(f"line {line.number} states the axis {value!r}; export it with wavelengths")
    header = None if is_number(rows[0][1][0], ",") else rows.pop(0)[1]
    if not rows or (header is None and len(rows[0][1]) > _MOST_COLUMNS):
        what = "is a series of spectra in rows" if rows else "has a header but no rows"
        raise DataError(f"{what}; export one spectrum in two columns")
    quantity = _ocean_quantity(above, file.path)
    if header is None:
        names = ["wavelength (nm)", quantity, *["_"] * (len(rows[0][1]) - 2)][: max(2, len(rows[0][1]))]
    else:
        names = [_JAZ.get(name, quantity if name == _PROCESSED else name) for name in header]
        if quantity in names and "sample counts" in names:
            # a processed value that only repeats the counts of the sample
            processed, sample = names.index(quantity), names.index("sample counts")
            if all(cells[processed : processed + 1] == cells[sample : sample + 1] for _, cells in rows):
                names[processed] = "_"
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
    named = _STELLARNET_FILE.match(file.lines[0].text)
    if named is None:
        return None
    heading = [line for line in file.lines if line.text.startswith('"')]
    rows = [(line, line.bare.replace(";", " ").split()) for line in file.lines if line not in heading]
    if not rows:
        raise DataError("has no rows below its heading; export it again")
    names = ["wavelength (nm)", _STELLARNET.get(named["suffix"].upper(), "scope")]
    sample = re.split(r"[\\/]", named["name"])[-1]
    return [export("StellarNet SpectraWiz text", names, rows, facts=facts(heading, sample=sample))]


def perkin_elmer(file: TextFile) -> list[Table] | None:
    """Return the spectrum of UV WinLab, format PEDS (`.asc`), or None for another format.

    The first line is `PE UV ... ASCII PEDS 4.00` (`PE IR` for infrared instruments). Below the keyword `#GR`
    stand the unit of the axis, that of the ordinate, a factor, an offset, start, step and number of points;
    below `#DATA` the rows. The layout is that of the test files of nomad-measurements.

    Raises DataError where it lacks the block `#GR` or rows, or has another axis or quantity.
    """
    first = file.lines[0].text
    if not first.startswith("PE ") or "PEDS" not in first:
        return None
    keywords = {comment.text.strip(): comment.number for comment in file.comments}
    if not {"GR", "DATA"} <= set(keywords):
        raise DataError("lacks the block #GR or #DATA of a PerkinElmer file; export it again")
    scale = [line for line in file.lines if keywords["GR"] < line.number < keywords["DATA"]]
    rows: Rows = [(line, line.bare.split()) for line in file.lines if line.number > keywords["DATA"]]
    if len(scale) < 2 or not rows:
        raise DataError("has no rows below #DATA, or no units below #GR; export it again")
    for line, usual in zip(scale[2:4], _UNSCALED, strict=False):
        if not is_number(line.text) or float(line.text) != usual:
            raise DataError(
                f"line {line.number} scales the ordinate ({line.text!r}, where {usual:g} "
                "is usual), which programs treat differently; export it again without"
            )
    axis, ordinate = scale[:2]
    unit = wavelength_unit(axis.text)
    if unit is None:
        raise DataError(
            f"line {axis.number} gives the unit of the axis as {axis.text!r}; export it in nm or cm-1"
        )
    word = ordinate.text.strip()
    # another quantity is refused where it is read
    names = [f"wavelength ({unit})", _PEDS.get(word.upper()) or f"single beam ({word})"]
    stated = [
        (_FACTS_BY_LINE[line.number], line.text) for line in file.lines[:20] if line.number in _FACTS_BY_LINE
    ]
    notes = counted(rows, [line.text.strip() for line in scale[_POINTS : _POINTS + 1]])
    return [export("PerkinElmer PEDS text", names, rows, facts=stated, notes=notes)]


def jasco(file: TextFile) -> list[Table] | None:
    """Return the spectrum of Spectra Manager, or None for another format.

    Lines of a keyword and a value (`TITLE`, `DATA TYPE`, `ORIGIN`, `XUNITS`, `YUNITS`, ..., as in JCAMP-DX
    but without `##`), the line `XYDATA`, rows, then sections such as `##### Extended Information` or
    `[Measurement Information]`. The keywords are those of the readers that other projects publish.

    Raises DataError where it has no rows, no unit of the axis or several values at each wavelength.
    """
    lines = file.lines
    heading = (i for i, line in enumerate(lines[:_MOST_HEADING]) if line.text.upper().startswith("XYDATA"))
    begin = next(heading, None)
    if begin is None or lines[0].text.startswith("##"):
        return None
    entries = [all_cells(line.text) for line in lines[:begin]]
    header = {key.upper(): " ".join(value for value in values if value) for key, *values in entries}
    if not {"TITLE", "DATA TYPE", "XUNITS"} <= set(header):
        return None
    below, rows = lines[begin + 1 :], []
    end = min((c.number for c in file.comments if below and c.number > below[0].number), default=None)
    for i, line in enumerate(below):  # up to a blank line, a section in brackets or a line of `#`
        blank = i > 0 and line.number > below[i - 1].number + 1
        if blank or _SECTION.match(line.text) or (end is not None and line.number > end):
            break
        rows.append((line, [cell for cell in all_cells(line.bare) if cell]))
    if not rows:
        raise DataError(f"has no rows below XYDATA on line {lines[begin].number}; export it again")
    if len(all_cells(lines[begin].text)) > 2:
        raise DataError("has spectra at several temperatures or times; export one of them")
    unit = wavelength_unit(header["XUNITS"]) or recognise(header["XUNITS"]).unit
    if unit is None:
        raise DataError(f"states XUNITS {header['XUNITS']!r}; export it along nm, eV or cm-1")
    names = [f"wavelength ({unit})", _jasco_quantity(header.get("YUNITS", ""))]
    names += [header.get(f"YUNITS{i}") or "_" for i in range(2, max(2, len(rows[0][1])))]
    stated = [(fact, header.get(key, "")) for key, fact in _JASCO_FACTS.items()]
    notes = counted(rows, [header.get("NPOINTS", "")])
    return [export("JASCO text", names, rows, facts=stated, notes=notes)]


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
