"""Selection of the columns to read: by the caller's names, by the header, or by position."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from pellicle.data.tabular.columns import Column, parse_columns, recognise_all
from pellicle.data.tabular.declarations import Declared
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError

SIGNALS = ("R", "T")
"""Signals of one column; psi-delta has two."""

_EITHER_SIGNAL = '`signal="R"` or `signal="T"`'


@dataclass(frozen=True)
class SpectrumColumns:
    """Columns to read, and sentences on the choice."""

    wavelength: Column
    signal: Column
    sigma: Column | None
    angle: Column | None
    notes: tuple[str, ...]


def signal_columns(
    table: Table, columns: str | Sequence[str] | None, signal: str | None, polarisation: str | None
) -> list[SpectrumColumns]:
    """Find the reflectances and transmittances of a table; arguments as in `read_spectra`.

    Several are returned where the arguments do not tell them apart. Raises UsageError or DataError where
    there is none, with the argument that settles it.
    """
    named = named_columns(table, columns)
    if named is None:
        if signal is None:
            raise UsageError(
                f"{table.path}: has no header, so say what its second column is with {_EITHER_SIGNAL}"
            )
        return [_by_position(table, signal)]
    return [
        _with_wavelength(table, named, column)
        for column in _signals(table, named, signal, polarisation, by_caller=columns is not None)
    ]


def counts_columns(table: Table, columns: str | Sequence[str] | None) -> SpectrumColumns:
    """Choose the columns of raw counts: the wavelength and the one other column, whatever its name."""
    named = named_columns(table, columns)
    if named is None:
        return _by_position(table, "counts")
    counts = [c for c in named if c.role not in ("wavelength", "sigma", "angle") and c.name not in ("_", "")]
    if len(counts) != 1:
        raise UsageError(
            f"{table.path}: expected one column of counts beside the wavelength, found "
            f'{listed(counts) or "none"}; choose one, as in `columns=["wavelength", "counts"]`'
        )
    return _with_wavelength(table, named, counts[0])


def named_columns(table: Table, columns: str | Sequence[str] | None) -> tuple[Column, ...] | None:
    """Return the columns by the caller's names, or by the header and what the file declares; None without.

    Raises DataError where the file contradicts itself.
    """
    if columns is not None:
        return parse_columns(columns, table.path, table.layout.width)
    names, declared = table.layout.names, table.layout.declared
    if names is None:
        return _declared_columns(table)
    lowered = [name.lower() for name in names]
    twice = next((name for i, name in enumerate(names) if name and name.lower() in lowered[:i]), None)
    if twice is not None:
        raise DataError(
            f"{table.path}: the header names {twice!r} twice; rename one, or name the columns with `columns`"
        )
    found = recognise_all(names)
    signals = [column for column in found if column.role in SIGNALS]
    unnamed = () if signals else [c for c in found if c.role in ("other", "intensity", "counts") and c.name]
    return tuple(_with_declared(table, column, declared, column in unnamed) for column in found)


def _declared_columns(table: Table) -> tuple[Column, ...] | None:
    """The columns of a table without a header, whose quantity the file declares above it; None otherwise."""
    declared = table.layout.declared
    if declared.signal is None or table.layout.width not in (2, 3):
        return None
    signal = declared.signal.column
    axis = declared.axis.column.unit if declared.axis else None
    label = f"declared {signal.name}"
    columns = [Column(0, "column 1", "wavelength", axis), dataclasses.replace(signal, position=1, name=label)]
    return (*columns, *([Column(2, "column 3", "sigma")] if table.layout.width == 3 else []))


def _with_declared(table: Table, column: Column, declared: Declared, unnamed: bool) -> Column:
    """A column of the header with the role and the unit that the file declares. Raises DataError."""
    statement = declared.axis if column.role == "wavelength" else declared.signal
    if statement is None or not (unnamed or column.role in ("wavelength", *SIGNALS)):
        return column
    stated = statement.column
    roles = (column.role, stated.role) if not unnamed else (stated.role,) * 2
    units = {column.unit, stated.unit} - {None}
    if roles[0] != roles[1] or len(units) > 1:
        raise DataError(
            f"{table.path}: line {statement.line} declares {stated.name!r}, which contradicts "
            f"{table.label(column.position)}; correct the file, or name its columns with `columns`"
        )
    if column.unit is None and stated.unit:
        column = dataclasses.replace(column, unit=stated.unit, unknown_unit=None)
    return dataclasses.replace(column, role=roles[1])


def _by_position(table: Table, role: str) -> SpectrumColumns:
    width = table.layout.width
    if width > 4:
        raise UsageError(
            f"{table.path}: has {width} columns and no header; name them in order, as in "
            '`columns=["wavelength", "R", "_", "sigma"]`'
        )
    sigma = Column(2, "", "sigma") if width > 2 and role != "counts" else None
    notes = [f"no header: column 1 read as the wavelength, column 2 as {role}"]
    if sigma:
        notes.append("column 3 read as sigma, the standard deviation of the signal")
    if width > 3:
        notes.append("column 4 (by custom the error of the wavelength) ignored")
    return SpectrumColumns(Column(0, "", "wavelength"), Column(1, "", role), sigma, None, tuple(notes))


def _with_wavelength(table: Table, columns: Sequence[Column], signal: Column) -> SpectrumColumns:
    wavelength, angle = wavelength_and_angle(table, columns, '`columns=["wavelength", "R"]`')
    sigma = only(table, columns, "sigma")
    used = {c.position for c in (wavelength, signal, sigma, angle) if c}
    ignored = [c for c in columns if c.position not in used and c.name not in ("_", "")]
    notes = [f"{listed([wavelength])} read as the wavelength, {listed([signal])} as the signal"]
    if sigma:
        notes.append(f"{listed([sigma])} read as the standard deviation of the signal")
    if angle:
        notes.append(f"{listed([angle])} read as the angle of incidence in degrees")
    if ignored:
        notes.append(f"ignored: {listed(ignored)}")
    return SpectrumColumns(wavelength, signal, sigma, angle, tuple(notes))


def wavelength_and_angle(
    table: Table, columns: Sequence[Column], example: str
) -> tuple[Column, Column | None]:
    """Return the columns of the wavelength and, if present, of the angle of incidence. Raises DataError."""
    wavelength, angle = only(table, columns, "wavelength"), only(table, columns, "angle")
    if wavelength is None:
        raise DataError(
            f"{table.path}: no column is a wavelength, energy or wavenumber among {listed(columns)}; "
            f"name the columns in order, as in {example}"
        )
    if angle and angle.unknown_unit:
        raise DataError(
            f"{table.path}: {table.label(angle.position)} is in {angle.unknown_unit!r}; "
            "write angles in degrees"
        )
    return wavelength, angle


def only(table: Table, columns: Sequence[Column], role: str) -> Column | None:
    """Return the one column of a role, or None. Raises DataError for several."""
    matching = [c for c in columns if c.role == role]
    if len(matching) > 1:
        raise DataError(
            f"{table.path}: {listed(matching)} could each be the {role}; choose one with `columns`, "
            "_ for the others"
        )
    return matching[0] if matching else None


def _signals(
    table: Table,
    columns: Sequence[Column],
    signal: str | None,
    polarisation: str | None,
    by_caller: bool,
) -> list[Column]:
    """The columns that may be meant. Raises UsageError or DataError where none is."""
    foreign = next((c for c in columns if c.role == "foreign"), None)
    if foreign is not None:
        raise DataError(
            f"{table.path}: declares {foreign.name.removeprefix('declared ')!r}, which is neither a "
            "reflectance nor a transmittance; export one of these, or raw counts with `reference`"
        )
    measured = [c for c in columns if c.role in SIGNALS]
    absorbed = [c for c in measured if c.role == "T" and c.unit == "absorbance"]
    if signal == "R" and measured and measured == absorbed and not by_caller:
        raise UsageError(
            f"{table.path}: {listed(measured)} is an absorbance, read as T = 10^-A, which contradicts "
            '`signal="R"`; leave that out, or if it is log(1/R), say so with '
            f'`columns="{_renamed(columns, absorbed[0])}"`'
        )
    measured = [c for c in measured if signal in (None, c.role)]
    if not measured:
        return _unnamed_signals(table, columns, signal)
    wanted = [c for c in measured if polarisation and (c.polarisation or "unpolarised") == polarisation]
    measured = wanted or measured
    stated = {c.polarisation for c in measured}
    if polarisation and None not in stated and len(stated) == 1 and stated != {polarisation}:
        raise UsageError(
            f"{table.path}: {listed(measured)} is measured in {measured[0].polarisation} light, which "
            f'contradicts `polarisation="{polarisation}"`; leave that out'
        )
    return measured


def _renamed(columns: Sequence[Column], column: Column) -> str:
    """Names for the argument `columns` with which a column of absorbance is log(1/R)."""
    words = {"wavelength": "wavelength", "sigma": "sigma", "angle": "angle"}
    return ",".join("log(1/R)" if c is column else words.get(c.role, "_") for c in columns)


def _unnamed_signals(table: Table, columns: Sequence[Column], signal: str | None) -> list[Column]:
    """An intensity, or columns whose names state no quantity, where the caller states it."""
    intensity = only(table, columns, "intensity")
    if intensity and signal is None:
        raise UsageError(
            f"{table.path}: {listed([intensity])} is uncalibrated; state the signal with {_EITHER_SIGNAL}"
        )
    if intensity:
        return [intensity]
    roles = {c.role for c in columns}
    if other := roles & set(SIGNALS):
        raise UsageError(
            f'{table.path}: has {other.pop()}, which contradicts `signal="{signal}"`; correct that'
        )
    if {"psi", "delta"} & roles:
        raise UsageError(
            f'{table.path}: has psi and delta, which contradicts `signal="{signal}"`; leave that out'
        )
    unnamed = [c for c in columns if c.role == "other" and c.name not in ("_", "")]
    if signal is not None and unnamed and "wavelength" in roles:
        return [dataclasses.replace(c, role=signal) for c in unnamed]
    if unnamed and "wavelength" in roles:
        raise UsageError(
            f"{table.path}: {listed(unnamed)} state no quantity; say what they are with {_EITHER_SIGNAL}, or "
            'name the columns in order, as in `columns=["wavelength", "R"]`'
        )
    raise DataError(
        f"{table.path}: no column is a signal (R, T, Rs, Rp, Ts, Tp, absorbance or intensity) among "
        f'{listed(columns)}; name the columns in order, as in `columns=["wavelength", "R"]`'
    )


def listed(columns: Sequence[Column]) -> str:
    """Return the names of columns, for a message."""
    return ", ".join(repr(c.name) for c in columns)
