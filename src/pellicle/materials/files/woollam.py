"""Material files of WVASE and CompleteEASE (`.mat`): title, unit and kind of the columns, then rows.

    Silicon
    nm
    NK
    300  5.02  4.14

The unit is nm, eV, Angstroms, microns or 1/cm. NK stands for n and k, E1E2 (or EPS) for the dielectric
function. Regress Pro writes the same layout. The title may have several lines, and a line may give the number
of rows.
"""

from __future__ import annotations

import re

from pellicle.data.tabular.columns import recognise_all
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError
from pellicle.materials.files.optical_constants import MaterialFile, OpticalConstants, material_file
from pellicle.materials.files.text import MaterialText, cells, is_row, read_rows

_NK = ("n", "nk", "n&k", "nandk", "n+ik")
_DIELECTRIC = ("e", "e1e2", "e1&e2", "eps", "eps1eps2", "epsilon", "epsilon1epsilon2", "ε1ε2")
_DIELECTRIC_BY_WORD = {word: word in _DIELECTRIC for word in (*_NK, *_DIELECTRIC)}
_AXES = {"eV": "energy", "cm-1": "wavenumber", "THz": "frequency"}
_EXAMPLE = (
    "name the material on line 1, the unit (nm, eV) on line 2 and NK or E1E2 on line 3, then give the rows"
)


def read(text: MaterialText) -> MaterialFile | None:
    """Read a file whose lines above the rows state unit and kind, or any `.mat` file; None for another one.

    Raises DataError for a `.mat` file that does not state both, and for faulty rows.
    """
    unit = dielectric = count = None
    title, rows_from = [], 0
    for i, line in enumerate(text.lines):
        words = re.findall(r"[^\s,;/]+", line.text.lower())
        stated = _stated(words) if i else None  # the first line is the title, whatever it says
        if stated is not None:
            unit, dielectric = stated[0] or unit, dielectric if stated[1] is None else stated[1]
        elif len(words) == 1 and words[0].isascii() and words[0].isdigit():
            count = int(words[0])
        elif is_row(line.text) or (unit is not None and dielectric is not None):
            break
        else:
            title.append(line.text)
        rows_from = i + 1
    if text.suffix != ".mat" and (unit is None or dielectric is None):
        return None
    if unit is None and any(column.role == "wavelength" for column in recognise_all(cells(" ".join(title)))):
        return None  # a plain table with names of columns
    if unit is None or dielectric is None:
        missing = "the unit of its first column" if unit is None else "whether its columns are NK or E1E2"
        raise DataError(f"{text.path}: does not state {missing} above its rows; {_EXAMPLE}")
    names = (_AXES.get(unit, "wavelength"), *(("eps1", "eps2") if dielectric else ("n", "k")))
    rows = read_rows(text.path, text.lines[rows_from:], names, optional=0 if dielectric else 1)
    if count is not None and count != len(rows.lines):
        raise DataError(
            f"{text.path}: announces {count} rows but has {len(rows.lines)}; it is cut off, so export "
            "it again"
        )
    axis, first, second = (rows.columns.get(name) for name in names)
    assert axis is not None
    assert first is not None
    constants = OpticalConstants(text.path, axis, unit, first, second, dielectric, names, rows.where)
    return material_file(constants, "WVASE or CompleteEASE material file", " ".join(title))


def _stated(words: list[str]) -> tuple[str | None, bool | None] | None:
    """Unit and kind that a line states, either None if absent; None for a line of anything else."""
    for i in range(len(words) + 1):
        unit = wavelength_unit("/".join(words[:i])) if i and words[:i] != ["a"] else None
        kind = _DIELECTRIC_BY_WORD.get("".join(words[i:]))
        if (not i or unit is not None) and (i == len(words) or kind is not None):
            return unit, kind
    return None
