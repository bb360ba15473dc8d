"""Text files of StellarNet's SpectraWiz (`.TRM`, `.ABS`, `.SSM`, `.IRR`).

Lines that begin with a quotation mark, the first of which names the file (`"File: ...TRM"`), then rows of
wavelength in nm and value. The file's own suffix states the quantity: `TRM` is a transmittance or reflectance
in percent, `SSM` counts. The layout is that of readers of SpectraWiz files.
"""

from __future__ import annotations

import re

from pellicle.data.formats.instrument_rows import Rows, decimal_mark, facts
from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import TextFile
from pellicle.errors import DataError

_FILE = re.compile(r'"\s*File\s*:\s*(?P<name>.*?)\.(?P<suffix>TRM|ABS|SSM|IRR|EPP)\b', re.IGNORECASE)
_QUANTITIES = {"TRM": "processed (%)", "ABS": "absorbance", "IRR": "irradiance"}


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the spectrum, or None for another format. Raises DataError where it has no rows."""
    lines = file.lines
    named = _FILE.match(lines[0].text)
    if named is None:
        return None
    heading = [line for line in lines if line.text.startswith('"')]
    rows: Rows = [(line, line.bare.replace(";", " ").split()) for line in lines if line not in heading]
    if not rows:
        raise DataError(f"{file.path}: has no rows below its heading; export it again")
    quantity = _QUANTITIES.get(named["suffix"].upper(), "scope")
    found = facts("StellarNet SpectraWiz text", heading, sample=re.split(r"[\\/]", named["name"])[-1])
    notes = ["read as a StellarNet text file"]
    return [
        plain_columns(["wavelength (nm)", quantity], rows, notes, facts=found, decimal=decimal_mark(rows))
    ]
