"""Selection of the columns to read: by the caller's names, by the header, or by position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pellicle.data.tabular.columns import Column, parse_columns, recognise_all
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


def spectrum_columns(
    table: Table, columns: str | Sequence[str] | None, signal: str | None, polarisation: str | None
) -> SpectrumColumns:
    """Choose the columns of a reflectance or transmittance; arguments as in `read_spectrum`.

    Raises UsageError or DataError where the choice is ambiguous, with the argument that settles it.
    """
    named = named_columns(table, columns)
    if named is None:
        if signal is None:
            raise UsageError(
                f"{table.path}: has no header, so say what its second column is with {_EITHER_SIGNAL}"
            )
        return _by_position(table, signal)
    return _with_wavelength(table, named, _signal_column(table, named, signal, polarisation))


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
    """Return the columns by the caller's names or the header; None without either."""
    if columns is not None:
        return parse_columns(columns, table.path, table.layout.width)
    names = table.layout.names
    if names is None:
        return None
    lowered = [name.lower() for name in names]
    twice = next((name for i, name in enumerate(names) if name and name.lower() in lowered[:i]), None)
    if twice is not None:
        raise DataError(
            f"{table.path}: the header names {twice!r} twice; rename one, or name the columns with `columns`"
        )
    return recognise_all(names)


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


def _signal_column(
    table: Table, columns: Sequence[Column], signal: str | None, polarisation: str | None
) -> Column:
    measured = [c for c in columns if c.role in SIGNALS and signal in (None, c.role)]
    quantities = {c.role for c in measured}
    if len(quantities) > 1:
        raise UsageError(f"{table.path}: has both R and T; choose one with {_EITHER_SIGNAL}")
    if not measured:
        return _intensity_column(table, columns, signal)
    if len(measured) > 1:
        wanted = [c for c in measured if polarisation and (c.polarisation or "unpolarised") == polarisation]
        if not wanted and len({c.polarisation for c in measured}) > 1:
            raise UsageError(
                f'{table.path}: has {listed(measured)}; choose one with `polarisation="s"`, '
                '`polarisation="p"` or `polarisation="unpolarised"`'
            )
        measured = wanted or measured
    if len(measured) > 1:
        raise DataError(
            f"{table.path}: {listed(measured)} could each be the signal; choose one with `columns`, "
            "_ for the others"
        )
    if polarisation and measured[0].polarisation and measured[0].polarisation != polarisation:
        raise UsageError(
            f"{table.path}: {listed(measured)} is measured in {measured[0].polarisation} light, which "
            f'contradicts `polarisation="{polarisation}"`; leave that out'
        )
    return measured[0]


def _intensity_column(table: Table, columns: Sequence[Column], signal: str | None) -> Column:
    intensity = only(table, columns, "intensity")
    if intensity and signal is None:
        raise UsageError(
            f"{table.path}: {listed([intensity])} is uncalibrated; state the signal with {_EITHER_SIGNAL}"
        )
    if intensity:
        return intensity
    roles = {c.role for c in columns}
    if other := roles & {"R", "T"}:
        raise UsageError(
            f'{table.path}: has {other.pop()}, which contradicts `signal="{signal}"`; correct that'
        )
    if {"psi", "delta"} & roles:
        raise UsageError(
            f'{table.path}: has psi and delta, which contradicts `signal="{signal}"`; leave that out'
        )
    raise DataError(
        f"{table.path}: no column is a signal (R, T, Rs, Rp, Ts, Tp or intensity) among {listed(columns)}; "
        'name the columns in order, as in `columns=["wavelength", "R"]`'
    )


def listed(columns: Sequence[Column]) -> str:
    """Return the names of columns, for a message."""
    return ", ".join(repr(c.name) for c in columns)
