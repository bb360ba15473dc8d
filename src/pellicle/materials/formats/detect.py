"""Detection of the format of a material file by its content, and the files of programs.

The programs are IMD, Sentech's SpectraRay, SOPRA, and Woollam's WVASE and CompleteEASE.
Each function returns None for a file of another format, and raises DataError for faulty rows, without the
name of the file.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pellicle.data.tabular.columns import recognise_all
from pellicle.data.tabular.text import Line, in_file, read_bytes
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError
from pellicle.materials.formats import complete_ease, plain_table, refractiveindex_info, regress_pro
from pellicle.materials.formats import optical_constants as optical

_SPECTRARAY_AXES = {"wavelength": "nm", "energy": "eV", "photon energy": "eV", "wavenumber": "cm-1"}

_SOPRA_UNITS = {"1": "eV", "2": "um", "3": "cm-1", "4": "nm"}
_SOPRA = "SOPRA material file"

_NK = ("n", "nk", "n&k", "nandk", "n+ik")
_DIELECTRIC = ("e", "e1e2", "e1&e2", "eps", "eps1eps2", "epsilon", "epsilon1epsilon2", "ε1ε2")
_DIELECTRIC_BY_WORD = {word: word in _DIELECTRIC for word in (*_NK, *_DIELECTRIC)}
_WOOLLAM_AXES = {"eV": "energy", "cm-1": "wavenumber", "THz": "frequency"}
_WOOLLAM_EXAMPLE = (
    "name the material on line 1, the unit (nm, eV) on line 2 and NK or E1E2 on line 3, then give the rows"
)


def imd(text: optical.MaterialText) -> optical.MaterialFile | None:
    """Read an `.nk` file of IMD and of the CXRO collection: comments that begin with `;`, then Å, n and k.

    An `.nk` file of bare numbers, whose unit is unknown, is refused.
    """
    if text.suffix != ".nk" or not text.lines:
        return None
    if optical.is_row(text.lines[0].text):
        raise DataError(
            "does not state the unit of its first column: put a line above its rows, "
            "`; n,k of ...` for Å as in files of IMD, or `wavelength_nm,n,k`"
        )
    if not text.lines[0].text.startswith(";"):
        return None
    lines = [line for line in text.lines if not line.text.startswith(";")]
    rows = optical.read_rows(lines, ("wavelength", "n", "k"))
    return optical.material_file(
        optical.constants_of(rows, "A"), "IMD material file", text.lines[0].text.strip("; ")
    )


def spectraray(text: optical.MaterialText) -> optical.MaterialFile | None:
    """Read a file of SpectraRay: `Units=`, then rows between "Begin of array" and "End of array".

    The rows hold the axis, ε₁ and ε₂. `Units=Wavelength` is in nm and `Units=Energy` in eV, as in the reader
    of pyElli, unless the line names a unit; `n` and `k` in that line make the columns n and k. An axis of
    unknown unit and a table without end are refused.
    """
    plain = [line.text.lower() for line in text.lines]
    if "begin of array" not in plain:
        return None
    begin = plain.index("begin of array")
    if "end of array" not in plain[begin:]:
        raise DataError("is cut off before its line 'End of array'; export it again")
    stated = next((line.partition("=")[2] for line in plain[:begin] if re.match(r"units\s*=", line)), None)
    if stated is None:
        raise DataError("has no line 'Units=' above its rows, as Units=Wavelength,nm; add it")
    axis, *words = (word.strip() for word in re.split(r"[,;]", stated))
    unit = next((known for word in words if (known := wavelength_unit(word))), _SPECTRARAY_AXES.get(axis))
    if unit is None:
        raise DataError(
            f"is against {axis!r} of unknown unit; write 'Units=Wavelength,nm' or 'Units=Energy,eV'"
        )
    dielectric = not {"n", "k"} <= set(words)
    lines = text.lines[begin + 1 : begin + plain[begin:].index("end of array")]
    rows = optical.read_rows(lines, (axis, "eps1", "eps2") if dielectric else (axis, "n", "k"))
    return optical.material_file(optical.constants_of(rows, unit, dielectric), "SpectraRay material file")


def sopra_grid(text: optical.MaterialText) -> optical.MaterialFile | None:
    """Read an `.nk` file of the SOPRA database, an even grid.

    It begins with the number of its unit (1 eV, 2 µm, 3 1/cm, 4 nm), first and last point, and the number of
    intervals; the other lines hold n and k. A file that has not as many rows as that is refused.
    """
    if text.suffix != ".nk" or not text.lines or not optical.is_row(text.lines[0].text):
        return None
    head = optical.cells(text.lines[0].text)
    if len(head) != 4 or head[0] not in _SOPRA_UNITS or not re.fullmatch(r"\d{1,7}", head[3]):
        return None
    intervals = int(head[3])
    rows = optical.read_rows(text.lines[1:], ("n", "k"))
    if len(rows) != intervals + 1:
        raise DataError(
            f"announces {intervals} intervals, which are {intervals + 1} rows, but has "
            f"{len(rows)}; it is cut off, so fetch it again"
        )
    ends = float(head[1]), float(head[2])
    if not np.isfinite(ends).all():
        raise DataError(f"line {text.lines[0].number} gives no finite range of its axis")
    axis = np.linspace(*ends, intervals + 1)
    return optical.material_file(optical.constants_of(rows, _SOPRA_UNITS[head[0]], axis=axis), _SOPRA)


def sopra_records(text: optical.MaterialText) -> optical.MaterialFile | None:
    """Read a `.MAT` file of the SOPRA database: records `DATA1*<row>*<nm>*<n>*<k>*$`.

    A file that has not as many records as it announces is refused.
    """
    if not any(line.text.startswith("DATA1*") for line in text.lines):
        return None
    records = [(line, line.text.split("*")) for line in text.lines]
    data = [Line(line.number, " ".join(parts[2:5]), "") for line, parts in records if parts[0] == "DATA1"]
    announced = next((parts[1] for _, parts in records if parts[0] == "POINTS" and len(parts) > 1), None)
    if announced is not None and announced.strip() != str(len(data)):
        raise DataError(f"announces {announced} rows but has {len(data)}; it is cut off, so fetch it again")
    rows = optical.read_rows(data, ("wavelength", "n", "k"))
    comments = " ".join(parts[1].strip() for _, parts in records if parts[0] == "COMMENT" and len(parts) > 1)
    return optical.material_file(optical.constants_of(rows, "nm"), _SOPRA)._replace(comments=comments)


def woollam(text: optical.MaterialText) -> optical.MaterialFile | None:
    """Read a file of WVASE or CompleteEASE (`.mat`): title, unit and kind of the columns, then rows.

        Silicon
        nm
        NK
        300  5.02  4.14

    The unit is nm, eV, Angstroms, microns or 1/cm. NK stands for n and k, E1E2 (or EPS) for the dielectric
    function. Regress Pro writes the same layout. The title may have several lines, and a line may give the
    number of rows. Any file is read whose lines above the rows state unit and kind; a `.mat` file that does
    not state both is refused.
    """
    unit = dielectric = count = None
    title, first_row = [], 0
    for i, line in enumerate(text.lines):
        words = re.findall(r"[^\s,;/]+", line.text.lower())
        # the first line is the title, whatever it says, and may be blank
        stated = _unit_and_kind(words) if line.number > 1 else None
        if stated is not None:
            unit, dielectric = stated[0] or unit, dielectric if stated[1] is None else stated[1]
        elif len(words) == 1 and words[0].isascii() and words[0].isdigit():
            count = int(words[0])
        elif optical.is_row(line.text) or (unit is not None and dielectric is not None):
            break
        else:
            title.append(line.text)
        first_row = i + 1
    if text.suffix != ".mat" and (unit is None or dielectric is None):
        return None
    if unit is None and any(
        column.role == "wavelength" for column in recognise_all(optical.cells(" ".join(title)))
    ):
        return None  # a plain table with names of columns
    if unit is None or dielectric is None:
        missing = "the unit of its first column" if unit is None else "whether its columns are NK or E1E2"
        raise DataError(f"does not state {missing} above its rows; {_WOOLLAM_EXAMPLE}")
    names = (_WOOLLAM_AXES.get(unit, "wavelength"), *(("eps1", "eps2") if dielectric else ("n", "k")))
    rows = optical.read_rows(text.lines[first_row:], names, optional=0 if dielectric else 1)
    if count is not None and count != len(rows):
        raise DataError(f"announces {count} rows but has {len(rows)}; it is cut off, so export it again")
    kind = "WVASE or CompleteEASE material file"
    return optical.material_file(optical.constants_of(rows, unit, dielectric), kind, " ".join(title))


def _unit_and_kind(words: list[str]) -> tuple[str | None, bool | None] | None:
    """Unit and kind that a line states, either None if absent; None for a line of anything else."""
    for i in range(len(words) + 1):
        unit = wavelength_unit("/".join(words[:i])) if i and words[:i] != ["a"] else None
        kind = _DIELECTRIC_BY_WORD.get("".join(words[i:]))
        if (not i or unit is not None) and (i == len(words) or kind is not None):
            return unit, kind
    return None


SUFFIXES = {".csv", ".txt", ".tsv", ".dat", ".nk", ".mat", ".yml", ".yaml"}
"""Suffixes of files of optical constants: a name with one of them is a path."""

_MODELS = {".mod": complete_ease.table, ".sesnap": complete_ease.table, ".rcp": regress_pro.table}
"""Suffixes of models of other programs, of which `FILE#NAME` is the table of one medium."""


def file_of(word: str) -> str:
    """The path that a word names if it names a file: without `#NAME`, a medium in a model file."""
    path, mark, _ = word.partition("#")
    return path if mark and Path(path).suffix.lower() in _MODELS else word


def names_file(word: str) -> bool:
    """True for a word that is a path of optical constants, by its suffix."""
    return file_of(word) != word or Path(word).suffix.lower() in SUFFIXES


READERS: tuple[Callable[[optical.MaterialText], optical.MaterialFile | None], ...] = (
    *(refractiveindex_info.read_yaml, refractiveindex_info.read_table, spectraray),
    *(sopra_records, sopra_grid, imd, woollam),
)


def read_material_file(path: str | Path) -> optical.MaterialFile:
    """Read n and k, or a dielectric function, from a file.

    **Arguments**: `path`, a file of WVASE, CompleteEASE, SpectraRay, SOPRA or IMD, a download of
    refractiveindex.info, a plain table, or `MODEL.mod#NAME`, the table of a medium in a model of CompleteEASE
    or Regress Pro; see `docs/reference/materials.md`.

    **Returns** the dispersion with its range (nm), and what was understood of the file.

    **Raises** DataError, one sentence with file, line, column and remedy.
    """
    if (model := file_of(str(path))) != str(path):
        content, _ = read_bytes(model)
        with in_file(model):
            return _MODELS[Path(model).suffix.lower()](content, str(path)[len(model) + 1 :])
    text = optical.read_text(path)
    with in_file(path):
        return next((file for reader in READERS if (file := reader(text))), None) or plain_table.read(text)
