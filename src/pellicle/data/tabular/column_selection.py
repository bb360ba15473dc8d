"""Which columns of a file are read as what: by `--columns`, by header, or by position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pellicle.data.tabular.columns import Column, recognise_all, requested
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError

SIGNALS = ("R", "T")  # beside psi-delta, which is two columns
POLARISATIONS = ("s", "p", "unpolarised")


@dataclass(frozen=True)
class Chosen:
    """The columns to read, and sentences on what was decided."""

    wavelength: Column
    signal: Column
    sigma: Column | None
    angle: Column | None
    notes: tuple[str, ...]

    @property
    def present(self) -> list[Column]:
        """The columns that exist, wavelength and signal first."""
        return [c for c in (self.wavelength, self.signal, self.sigma, self.angle) if c is not None]


def choose_spectrum(
    table: Table, spec: str | Sequence[str] | None, signal: str | None, polarisation: str | None
) -> Chosen:
    """Columns of a reflectance or transmittance spectrum. Ambiguity raises and names the flag."""
    columns = named_columns(table, spec)
    if columns is None:
        if signal is None:
            raise UsageError(
                f"{table.path}: has no header, so say what its second column is with --signal R or --signal T"
            )
        return _by_position(table, signal)
    return _complete(table, columns, _signal_column(table, columns, signal, polarisation))


def choose_counts(table: Table, spec: str | Sequence[str] | None) -> Chosen:
    """Columns of raw counts: the wavelength and the one other column, whatever its name."""
    columns = named_columns(table, spec)
    if columns is None:
        return _by_position(table, "counts")
    others = [
        c for c in columns if c.role not in ("wavelength", "sigma", "angle") and c.name not in ("_", "")
    ]
    if len(others) != 1:
        raise UsageError(
            f"{table.path}: expected one column of counts beside the wavelength, found "
            f"{listed(others) or 'none'}; say which with --columns wavelength,counts"
        )
    return _complete(table, columns, others[0])


def named_columns(table: Table, spec: str | Sequence[str] | None) -> tuple[Column, ...] | None:
    """Columns by `--columns` or by the header; None if the file has no header and no flag."""
    if spec is not None:
        return requested(spec, table.path, table.layout.width)
    names = table.layout.names
    if names is None:
        return None
    lowered = [name.lower() for name in names]
    twice = next((name for i, name in enumerate(names) if name and name.lower() in lowered[:i]), None)
    if twice is not None:
        raise DataError(
            f"{table.path}: the header names {twice!r} twice; rename one, or say which with --columns"
        )
    return recognise_all(names)


def _by_position(table: Table, role: str) -> Chosen:
    width = table.layout.width
    if width > 4:
        raise UsageError(
            f"{table.path}: has {width} columns and no header; say what they are with --columns, "
            "e.g. --columns wavelength,R,_,sigma"
        )
    sigma = Column(2, "", "sigma") if width > 2 and role != "counts" else None
    said = [f"no header: column 1 read as the wavelength, column 2 as {role}"]
    if sigma:
        said.append("column 3 read as sigma, the standard deviation of the signal")
    if width > 3:
        said.append("column 4 (by custom the error of the wavelength) ignored")
    return Chosen(Column(0, "", "wavelength"), Column(1, "", role), sigma, None, tuple(said))


def _complete(table: Table, columns: Sequence[Column], signal: Column) -> Chosen:
    wavelength, angle = wavelength_and_angle(table, columns, "wavelength,R")
    sigma = only(table, columns, "sigma")
    used = {c.position for c in (wavelength, signal, sigma, angle) if c}
    ignored = [c for c in columns if c.position not in used and c.name not in ("_", "")]
    said = [f"{listed([wavelength])} read as the wavelength, {listed([signal])} as the signal"]
    if sigma:
        said.append(f"{listed([sigma])} read as the standard deviation of the signal")
    if angle:
        said.append(f"{listed([angle])} read as the angle of incidence in degrees")
    if ignored:
        said.append(f"ignored: {listed(ignored)}")
    return Chosen(wavelength, signal, sigma, angle, tuple(said))


def wavelength_and_angle(
    table: Table, columns: Sequence[Column], example: str
) -> tuple[Column, Column | None]:
    """The columns of the wavelength and, if there is one, of the angle of incidence. Raises DataError."""
    wavelength, angle = only(table, columns, "wavelength"), only(table, columns, "angle")
    if wavelength is None:
        raise DataError(
            f"{table.path}: no column is a wavelength, energy or wavenumber among {listed(columns)}; "
            f"name the columns in order with --columns, e.g. --columns {example}"
        )
    if angle and angle.unknown_unit:
        raise DataError(
            f"{table.path}: {table.label(angle.position)} is in {angle.unknown_unit!r}; "
            "write angles in degrees"
        )
    return wavelength, angle


def only(table: Table, columns: Sequence[Column], role: str) -> Column | None:
    """The one column of a role, or None. Raises DataError where several could be it."""
    found = [c for c in columns if c.role == role]
    if len(found) > 1:
        raise DataError(
            f"{table.path}: {listed(found)} could each be the {role}; say which with --columns, "
            "_ for the others"
        )
    return found[0] if found else None


def _signal_column(
    table: Table, columns: Sequence[Column], signal: str | None, polarisation: str | None
) -> Column:
    measured = [c for c in columns if c.role in SIGNALS and signal in (None, c.role)]
    quantities = {c.role for c in measured}
    if len(quantities) > 1:
        raise UsageError(f"{table.path}: holds both R and T; say which to read with --signal R or --signal T")
    if not measured:
        return _intensity_column(table, columns, signal)
    if len(measured) > 1:
        wanted = [c for c in measured if polarisation and (c.polarisation or "unpolarised") == polarisation]
        if not wanted and len({c.polarisation for c in measured}) > 1:
            raise UsageError(
                f"{table.path}: holds {listed(measured)}; say which to read with --polarisation s, "
                "--polarisation p or --polarisation unpolarised"
            )
        measured = wanted or measured
    if len(measured) > 1:
        raise DataError(
            f"{table.path}: {listed(measured)} could each be the signal; say which with --columns, "
            "_ for the others"
        )
    if polarisation and measured[0].polarisation and measured[0].polarisation != polarisation:
        raise UsageError(
            f"{table.path}: {listed(measured)} is measured in {measured[0].polarisation} light but "
            f"--polarisation says {polarisation}; leave the flag out"
        )
    return measured[0]


def _intensity_column(table: Table, columns: Sequence[Column], signal: str | None) -> Column:
    intensity = only(table, columns, "intensity")
    if intensity and signal is None:
        raise UsageError(
            f"{table.path}: {listed([intensity])} is uncalibrated; say what was measured with --signal R or "
            "--signal T"
        )
    if intensity:
        return intensity
    other = {c.role for c in columns} & {"R", "T"}
    if other:
        raise UsageError(f"{table.path}: holds {other.pop()} but --signal says {signal}; correct the flag")
    if {"psi", "delta"} & {c.role for c in columns}:
        raise UsageError(f"{table.path}: holds psi and delta but --signal says {signal}; leave the flag out")
    raise DataError(
        f"{table.path}: no column is a signal (R, T, Rs, Rp, Ts, Tp or intensity) among {listed(columns)}; "
        "name the columns in order with --columns, e.g. --columns wavelength,R"
    )


def listed(columns: Sequence[Column]) -> str:
    """The names of columns, for a message."""
    return ", ".join(repr(c.name) for c in columns)
