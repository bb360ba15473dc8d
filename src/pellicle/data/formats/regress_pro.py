"""Ellipsometry files of Regress Pro and ADAP: rows `SE wavelength alpha beta`.

The first line is `SE ALPHA BETA` or `SE PSI DELTA`; under the second the columns are tan Ψ and cos Δ. Lines
`AOI 71.5` and `A -25` may follow, the angles of incidence and of the fixed polariser in degrees; a negative A
turns the sign of β. Wavelengths are in nm. Reflectances of these programs are rows `uR`, as in Woollam's
files. The layout and the signs are those of Regress Pro's test files and of its source, `elliss.c`.
"""

from __future__ import annotations

from collections.abc import Sequence

from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.errors import DataError

LABEL = "SE"
ALPHA_BETA, TAN_COS = [LABEL, "ALPHA", "BETA"], [LABEL, "PSI", "DELTA"]
NOTE = "read as a Regress Pro (ADAP) file"


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the rows of α and β, or None for another format.

    Raises DataError for a row of another length, or none.
    """
    lines, path = file.lines, file.path
    heading = lines[0].text.split()
    if heading not in (ALPHA_BETA, TAN_COS):
        return None
    angles: dict[str, str] = {}
    rows = []
    for line in lines[1:]:
        label, *cells = line.bare.split() or [""]
        if label in ("AOI", "A") and len(cells) == 1 and is_number(cells[0]) and not rows:
            angles[label] = cells[0]
        elif label == LABEL and len(cells) == 3:
            rows.append((line, cells))
        else:
            raise DataError(
                f"{path}: line {line.number} is not {LABEL}, a wavelength and two values, as the rows of a "
                f"file of {' '.join(heading)} are; correct that line"
            )
    if not rows:
        raise DataError(f"{path}: has the heading {' '.join(heading)} but no rows; export it again")
    notes = [NOTE]
    if heading == TAN_COS:
        names = ("tan_psi", "cos_delta")
        notes.append("columns PSI and DELTA read as tan(psi) and cos(delta), which the program writes there")
    else:
        names = ("alpha", "beta")
        if "A" in angles:
            names, rows = (*names, "analyser_deg"), _with_analyser(rows, angles["A"])
    if "AOI" in angles:
        names, rows = (*names, "angle_deg"), [(line, [*cells, angles["AOI"]]) for line, cells in rows]
    names = ("wavelength (nm)", *names)
    return [plain_columns(names, rows, notes, facts=[("format", "Regress Pro text")])]


def _with_analyser(rows: Sequence[tuple[Line, list[str]]], analyser: str) -> list[tuple[Line, list[str]]]:
    """The rows with the angle of the fixed polariser, positive, and β to match."""
    own = f"{abs(float(analyser)):g}"
    if float(analyser) > 0:
        return [(line, [*cells, own]) for line, cells in rows]
    return [(line, [*cells[:2], _negated(cells[2]), own]) for line, cells in rows]


def _negated(cell: str) -> str:
    return cell[1:] if cell.startswith("-") else f"-{cell.removeprefix('+')}"
