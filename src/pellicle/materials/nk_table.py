"""n,k tables of one's own: a text file with a wavelength, n and, if known, k.

Whatever `pellicle.data` reads: commas, semicolons, tabs or blanks, `#` comments. With a header, columns
are found by name (`wavelength_nm`, `wl_um`, `lambda [µm]`, `energy_ev`; `n`; `k`, optional); without
one they are wavelength in nm, n, k.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pellicle.data.tabular.columns import Column, recognise_all
from pellicle.data.tabular.table import Table, read_table
from pellicle.data.tabular.units import to_nm
from pellicle.errors import DataError
from pellicle.materials.page import NOISE_IN_K, Contents, table

SHORTEST_ASSUMED = 30.0
"""Wavelengths that all lie below this (nm), in a file that gives no unit, are more likely µm or eV."""

_REMEDY = "write the table as wavelength_nm,n,k with that header"
_LIMITS = {
    "wavelength": (0.0, "above 0", "correct or delete that row"),
    "n": (0.0, "above 0", "correct or delete that row"),
    "k": (-NOISE_IN_K, "0 or above", "absorption is n + ik with k ≥ 0 here, so turn its sign"),
}


def read_nk(path: str | Path) -> Contents:
    """The dispersion in an n,k table, its range (nm) and whether it has k.

    Raises DataError, one sentence with file, line, column and remedy.
    """
    found = read_table(path)
    columns = _columns(found)
    names = list(columns)
    values = dict(zip(names, found.numbers([columns[name].position for name in names]), strict=True))
    for name in names:
        _check_limits(found, columns[name], name, values[name])
    _check_order(found, columns["wavelength"], values["wavelength"])
    nm = to_nm(values["wavelength"], _unit(found, columns["wavelength"], values["wavelength"]))
    made = table(np.round(nm, 9), values["n"], values.get("k"))
    return Contents(made.dispersion, (made.low, made.high), "k" in values)


def _columns(found: Table) -> dict[str, Column]:
    """The columns for wavelength, n and, if there, k."""
    names = found.layout.names
    if names is None:
        return _by_position(found)
    columns: dict[str, Column] = {}
    for column in recognise_all(names):
        plain = column.name.strip().lower()
        what = plain if plain in ("n", "k") else column.role
        if what in columns and what in _LIMITS:
            raise DataError(f"{found.path}: two columns are named {what}; rename one, or {_REMEDY}")
        columns[what] = column
    for what in ("wavelength", "n"):
        if what not in columns:
            raise DataError(
                f"{found.path}: expected a column named {what}, found {', '.join(names)}; {_REMEDY}"
            )
    return {what: columns[what] for what in _LIMITS if what in columns}


def _by_position(found: Table) -> dict[str, Column]:
    if found.layout.notes:  # lines were passed over to get at the numbers
        raise DataError(
            f"{found.path}: expected a header right above the rows, found none above line "
            f"{found.lines[0]}; {_REMEDY}, other lines marked with #"
        )
    if found.layout.width not in (2, 3):
        raise DataError(
            f"{found.path}: expected 2 or 3 columns where there is no header, found "
            f"{found.layout.width}; {_REMEDY}"
        )
    return {what: Column(i, "", what) for i, what in enumerate(list(_LIMITS)[: found.layout.width])}


def _unit(found: Table, column: Column, values: np.ndarray) -> str:
    if column.unknown_unit:
        raise DataError(
            f"{found.path}: {found.label(column.position)} is in an unknown unit "
            f"{column.unknown_unit!r}; convert it to nm and {_REMEDY}"
        )
    if column.unit is None and values.max() < SHORTEST_ASSUMED:
        raise DataError(
            f"{found.path}: {found.label(column.position)} runs from {values.min():g} to {values.max():g} "
            "without a unit, which is no wavelength in nm; name it wavelength_um, wavelength_nm or energy_eV"
        )
    return column.unit or "nm"


def _check_limits(found: Table, column: Column, what: str, values: np.ndarray) -> None:
    limit, expected, remedy = _LIMITS[what]
    wrong = np.flatnonzero(values < limit if what == "k" else values <= limit)
    if wrong.size:
        row = int(wrong[0])
        raise DataError(
            f"{found.where(row, column.position)}: expected {what} {expected}, "
            f"found {values[row]:g}; {remedy}"
        )


def _check_order(found: Table, column: Column, values: np.ndarray) -> None:
    steps = np.diff(values)
    if not steps.size:
        raise DataError(f"{found.path}: expected at least two rows, found one; add the others")
    wrong = np.flatnonzero(steps * np.sign(steps[0]) <= 0)
    if wrong.size:
        row = int(wrong[0]) + 1
        raise DataError(
            f"{found.where(row, column.position)}: expected wavelengths that only rise or only fall, found "
            f"{values[row]:g} after {values[row - 1]:g}; sort the rows and delete repeated ones"
        )
