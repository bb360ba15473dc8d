"""Material files of Sentech's SpectraRay: `Units=`, then rows between "Begin of array" and "End of array".

The rows hold the axis, ε₁ and ε₂. `Units=Wavelength` is in nm and `Units=Energy` in eV, as in the reader of
pyElli, unless the line names a unit; `n` and `k` in that line make the columns n and k.
"""

from __future__ import annotations

import re

from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError
from pellicle.materials.files.optical_constants import MaterialFile, OpticalConstants, material_file
from pellicle.materials.files.text import MaterialText, read_rows

_AXES = {"wavelength": "nm", "energy": "eV", "photon energy": "eV", "wavenumber": "cm-1"}


def read(text: MaterialText) -> MaterialFile | None:
    """Read a table of SpectraRay; None for another file.

    Raises DataError for an axis of unknown unit, for a table without end, and for faulty rows.
    """
    plain = [line.text.lower() for line in text.lines]
    if "begin of array" not in plain:
        return None
    begin = plain.index("begin of array")
    if "end of array" not in plain[begin:]:
        raise DataError(f"{text.path}: is cut off before its line 'End of array'; export it again")
    stated = next((line.partition("=")[2] for line in plain[:begin] if re.match(r"units\s*=", line)), None)
    if stated is None:
        raise DataError(f"{text.path}: has no line 'Units=' above its rows, as Units=Wavelength,nm; add it")
    axis, *words = (word.strip() for word in re.split(r"[,;]", stated))
    unit = next((known for word in words if (known := wavelength_unit(word))), _AXES.get(axis))
    if unit is None:
        raise DataError(
            f"{text.path}: is against {axis!r} of unknown unit; write 'Units=Wavelength,nm' or "
            "'Units=Energy,eV'"
        )
    dielectric = not {"n", "k"} <= set(words)
    names = (axis, "eps1", "eps2") if dielectric else (axis, "n", "k")
    lines = text.lines[begin + 1 : begin + plain[begin:].index("end of array")]
    rows = read_rows(text.path, lines, names)
    columns = [rows.columns[name] for name in names]
    constants = OpticalConstants(
        text.path, columns[0], unit, columns[1], columns[2], dielectric, names, rows.where
    )
    return material_file(constants, "SpectraRay material file")
