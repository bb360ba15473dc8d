"""Text files of Woollam's WVASE and CompleteEASE.

Lines of heading (a title, `VASEmethod[...]`, `Original[...]`), a line with the unit of the axis (`nm`,
`Angstroms`, `eV`), then rows of wavelength, angle of incidence, Ψ, Δ and usually the errors of both.
CompleteEASE puts `E` before such rows, and other labels (`dpolE`, `Rpp`, `uT`, ...) before other
quantities. The layout is that of files of both programs.
"""

from __future__ import annotations

from collections.abc import Sequence

from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

METHOD = "VASEmethod["
LABEL = "E"  # rows of Ψ and Δ
_MOST_HEADING = 50  # lines that are searched for the unit
_COLUMNS = ("angle_deg", "psi_deg", "delta_deg", "sigma_psi", "sigma_delta")


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the rows of Ψ and Δ, or None for another format.

    Raises DataError where the file has none, or tan Ψ and cos Δ.
    """
    lines, path = file.lines, file.path
    at = _unit_line(lines)
    if at is None:
        return None
    rows = [(line, line.bare.split()) for line in lines[at + 1 :]]
    labelled = any(cells[0] == LABEL for _, cells in rows)
    if not labelled and not any(line.text.startswith(METHOD) for line in lines[:at]):
        return None
    _refuse_tan_cos(lines[at], path)
    kept, others = _separate(rows)
    widths = {len(cells) for _, cells in kept}
    if not kept or widths not in ({4}, {6}):
        labels = f" (found {', '.join(others)})" if others else ""
        raise DataError(
            f"{path}: looks like a Woollam file, but its rows are not wavelength, angle, psi, delta and "
            f"their errors{labels}; export psi and delta as text"
        )
    names = (f"wavelength ({wavelength_unit(lines[at].text.split()[0])})", *_COLUMNS[: widths.pop() - 1])
    notes = ["read as a Woollam (WVASE, CompleteEASE) text file"]
    if len(names) == 6 and all(is_number(x) and float(x) == 0 for _, cells in kept for x in cells[4:]):
        names, kept = names[:4], [(line, cells[:4]) for line, cells in kept]  # as simulations are written
        notes.append("errors that are all zero ignored")
    if others:
        notes.append(f"rows of other quantities ignored: {', '.join(others)}")
    return [plain_columns(names, kept, notes)]


def _unit_line(lines: Sequence[Line]) -> int | None:
    """Index of the line with nothing but the axis's unit, above rows of numbers."""
    for i, line in enumerate(lines[: min(_MOST_HEADING, len(lines) - 1)]):
        words, below = line.text.split(), lines[i + 1].bare.split()
        alone = len(words) == 1 or words[1].upper() == "TRIG"
        if alone and wavelength_unit(words[0]) and len(below) >= 4 and is_number(below[1]):
            return i
    return None


def _refuse_tan_cos(line: Line, path: str) -> None:
    if len(line.text.split()) > 1:
        raise DataError(
            f"{path}: line {line.number} states that the rows are tan(psi) and cos(delta), which lack the "
            "sign of delta; export psi and delta in degrees"
        )


def _separate(
    rows: Sequence[tuple[Line, list[str]]],
) -> tuple[list[tuple[Line, list[str]]], list[str]]:
    """The rows of Ψ and Δ without their label, and the labels of the others."""
    kept, others = [], {}
    for line, cells in rows:
        if cells[0] == LABEL:
            kept.append((line, cells[1:]))
        elif cells[0][0].isalpha() and not is_number(cells[0]):
            others[cells[0]] = None
        else:
            kept.append((line, cells))
    return kept, list(others)
