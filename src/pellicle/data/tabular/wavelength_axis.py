"""The wavelength axis of a file: its unit settled, converted to nm, and checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellicle.data.tabular.column_selection import Chosen
from pellicle.data.tabular.columns import Column
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.units import WAVELENGTH_UNITS, to_nm, wavelength_unit
from pellicle.errors import DataError, UsageError

#: Below this (nm) an axis whose unit nobody stated is more likely in µm or eV.
SHORTEST_ASSUMED = 30.0


def axis_unit(table: Table, column: Column, flag: str | None) -> str | None:
    """Unit of the wavelength column from its name or from `--wavelength-unit`; None if neither says.

    Raises UsageError if the flag is no unit or contradicts the name, DataError if the name's unit
    is unknown and there is no flag.
    """
    asked = wavelength_unit(flag) if flag is not None else None
    if flag is not None and asked is None:
        raise UsageError(f"--wavelength-unit {flag!r} is unknown; use one of {', '.join(WAVELENGTH_UNITS)}")
    if column.unknown_unit and asked is None:
        raise DataError(
            f"{table.path}: {table.label(column.position)} is in an unknown unit {column.unknown_unit!r}; "
            f"convert it or state one of {', '.join(WAVELENGTH_UNITS)} with --wavelength-unit"
        )
    if asked and column.unit and asked != column.unit:
        raise UsageError(
            f"{table.path}: {table.label(column.position)} is in {column.unit} but --wavelength-unit "
            f"says {asked}; leave the flag out, or name the columns anew with --columns"
        )
    return column.unit or asked


def axis_note(unit: str | None) -> str:
    """Sentence on the unit in which the wavelengths were read."""
    return f"wavelength unit: {unit}" if unit else "wavelength unit: nm, assumed"


def read_columns(
    table: Table, chosen: Chosen, unit: str | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Wavelength (nm), signal, sigma and angle (degrees) in file order; None for what is not there.

    As `read_axis`.
    """
    others = [chosen.signal, *([chosen.sigma] if chosen.sigma else [])]
    wavelength, angle, read = read_axis(table, chosen.wavelength, chosen.angle, others, unit)
    return wavelength, read[0], read[1] if chosen.sigma else None, angle


def read_axis(
    table: Table, wavelength: Column, angle: Column | None, others: Sequence[Column], unit: str | None
) -> tuple[np.ndarray, np.ndarray | None, list[np.ndarray]]:
    """Wavelength (nm), angle (degrees; None if there is no such column) and other columns, in file order.

    `unit` is what `axis_unit` settled; None means nm, assumed. Raises DataError for a cell that is
    no finite number, an impossible wavelength or angle, or an axis that is not strictly monotone
    within one angle.
    """
    present = [wavelength, *others, *([angle] if angle else [])]
    values, *read = table.numbers([column.position for column in present])
    angles = read.pop() if angle else None
    if angle and angles is not None:
        _refuse(table, angle, angles, (angles < 0) | (angles >= 90), "is not from 0 to below 90 degrees")
    _refuse(table, wavelength, values, values <= 0, "is not above zero")
    if unit is None and values.max() < SHORTEST_ASSUMED:
        raise DataError(
            f"{table.path}: {table.label(wavelength.position)} runs from {values.min():g} to "
            f"{values.max():g}, which looks unlike nm; state its unit with --wavelength-unit um, eV or nm"
        )
    groups = np.zeros(values.size) if angles is None else angles
    for group in np.unique(groups):
        _check_monotone(table, wavelength, values, np.flatnonzero(groups == group))
    return to_nm(values, unit or "nm"), angles, read


def _refuse(table: Table, column: Column, values: np.ndarray, wrong: np.ndarray, why: str) -> None:
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.where(row, column.position)}: {values[row]:g} {why}; correct or delete that row"
        )


def _check_monotone(table: Table, column: Column, values: np.ndarray, rows: np.ndarray) -> None:
    steps = np.diff(values[rows])
    direction = np.sign(np.sum(np.sign(steps))) or 1.0
    wrong = np.flatnonzero(np.sign(steps) != direction)
    if wrong.size:
        here, before = int(rows[wrong[0] + 1]), int(rows[wrong[0]])
        verb = "repeats" if values[here] == values[before] else "turns back after"
        raise DataError(
            f"{table.where(here, column.position)}: {values[here]:.10g} {verb} {values[before]:.10g} of line "
            f"{table.lines[before]}; within one angle wavelengths must rise or fall strictly, so delete or "
            "correct one of the rows"
        )
