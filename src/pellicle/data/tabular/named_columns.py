"""Columns of a table by the caller's names, or by its header and what the file declares above it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from pellicle.data.tabular.column_names import COUNTERS
from pellicle.data.tabular.columns import SIGNALS, Column, listed, parse_columns, recognise, recognise_all
from pellicle.data.tabular.declarations import Declared
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError


def named_columns(table: Table, columns: str | Sequence[str] | None) -> tuple[Column, ...] | None:
    """Return the columns by the caller's names, or by the header and what the file declares; None without.

    Raises DataError where the file contradicts itself.
    """
    names, declared = table.layout.names, table.layout.declared
    if columns is not None:
        parsed = parse_columns(columns, table.path, table.layout.width)
        return tuple(_with_unit_of_file(table, column) for column in parsed)
    if names is None:
        return _declared_columns(table)
    found = recognise_all(names)
    # x, y and Y are three quantities, R and r one
    alike = [
        name if column.role == "other" else name.lower() for name, column in zip(names, found, strict=True)
    ]
    twice = next((name for i, name in enumerate(names) if name and alike[i] in alike[:i]), None)
    if twice is not None:
        raise DataError(
            f"{table.path}: the header names {twice!r} twice; rename one, or name the columns with `columns`"
        )
    signals = [column for column in found if column.role in SIGNALS]
    _refuse_optical_constants(table, found)
    open_roles = ("other", "intensity", "counts", "processed")
    free = [c for c in found if c.role in open_roles and c.name.strip().lower() not in ("", *COUNTERS)]
    foreign = declared.signal is not None and declared.signal.column.role == "foreign"
    processed = [] if foreign else [c for c in free if c.role == "processed"]
    unnamed = () if signals else processed or free
    return tuple(_with_declared(table, column, declared, column in unnamed) for column in found)


def first_column(table: Table) -> Column:
    """Return the wavelength of a table without a header, with the unit that the file declares."""
    declared = table.layout.declared.axis
    if declared is None:
        return Column(0, "", "wavelength")
    return dataclasses.replace(declared.column, position=0, name="")


def _refuse_optical_constants(table: Table, columns: Sequence[Column]) -> None:
    """Raise DataError for a table of n and k, or of a pseudo-dielectric function, which are not fitted."""
    names = {column.name.strip().lower() for column in columns if column.name}
    roles = {column.role for column in columns}
    if names & {"<e1>", "<eps1>", "<n>", "<ε1>"} and roles <= {"wavelength", "N", "other"}:
        raise DataError(
            f"{table.path}: contains the pseudo-dielectric function of a sample ({listed(columns)}); export "
            "psi and delta"
        )
    constants = any({a, b} <= names for a, b in (("n", "k"), ("n", "kappa"), ("e1", "e2"), ("eps1", "eps2")))
    if constants and roles <= {"wavelength", "N", "other"}:
        raise DataError(
            f"{table.path}: contains optical constants ({listed(columns)}), not a measured spectrum; give "
            "the file as `layer` or `substrate`"
        )


def _with_unit_of_file(table: Table, column: Column) -> Column:
    """A column of the caller's with the unit that the file states, where the caller's name states none.

    Raises UsageError where the file calls an absorbance what the caller calls a reflectance or transmittance.
    """
    if column.role not in ("wavelength", *SIGNALS) or column.unit or column.unknown_unit:
        return column
    names, declared = table.layout.names or (), table.layout.declared
    own = recognise(names[column.position]) if column.position < len(names) else None
    power = column.role in SIGNALS
    statement = declared.signal if power else declared.axis
    known = (*SIGNALS, "processed", "other") if power else ("wavelength",)
    stated = [own] if own and own.role in known else []
    stated += [statement.column] if statement else []
    found = next((one for one in stated if one.unit or one.unknown_unit), None)
    if found is None:
        return column
    if power and found.unit == "absorbance":
        raise UsageError(
            f"{table.path}: calls {found.name!r}, an absorbance, what `columns` calls {column.name!r}; name "
            f"it absorbance there, or {column.name}_fraction if it is none"
        )
    return dataclasses.replace(column, unit=found.unit, unknown_unit=found.unknown_unit)


def _declared_columns(table: Table) -> tuple[Column, ...] | None:
    """The columns of a table without a header, whose quantity the file declares above it; None otherwise."""
    declared = table.layout.declared
    if declared.signal is None or table.layout.width not in (2, 3):
        return None
    signal = declared.signal.column
    label = f"declared {signal.name}"
    columns = [
        dataclasses.replace(first_column(table), name="column 1"),
        dataclasses.replace(signal, position=1, name=label),
    ]
    return (*columns, *([Column(2, "column 3", "sigma")] if table.layout.width == 3 else []))


def _with_declared(table: Table, column: Column, declared: Declared, unnamed: bool) -> Column:
    """A column of the header with the role and the unit that the file declares. Raises DataError."""
    statement = declared.axis if column.role == "wavelength" else declared.signal
    if statement is None or not (unnamed or column.role in ("wavelength", *SIGNALS)):
        return column
    stated = statement.column
    roles = (column.role, stated.role) if not unnamed else (stated.role,) * 2
    units = {column.unit, stated.unit or stated.unknown_unit} - {None}
    if roles[0] != roles[1] or len(units) > 1:
        raise DataError(
            f"{table.path}: line {statement.line} declares {stated.name!r}, which contradicts "
            f"{table.label(column.position)}; correct the file, or name its columns with `columns`"
        )
    if column.unit is None and (stated.unit or stated.unknown_unit):
        column = dataclasses.replace(column, unit=stated.unit, unknown_unit=stated.unknown_unit)
    return dataclasses.replace(column, role=roles[1])
