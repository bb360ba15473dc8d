"""Selection of the columns to read: by the caller's names, by the header, or by position."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pellicle.data.tabular.column_names import COUNTERS, MUELLER, RATIO_COLUMNS
from pellicle.data.tabular.columns import COUNTS, SIGNALS, Column, listed
from pellicle.data.tabular.named_columns import first_column, named_columns
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError

_EITHER_SIGNAL = '`signal="R"` or `signal="T"`'


class AxisColumns(NamedTuple):
    """Columns of the wavelength and, where the table has them, of the angle of incidence and the azimuth of
    the sample."""

    wavelength: Column
    angle: Column | None = None
    azimuth: Column | None = None

    @property
    def notes(self) -> list[str]:
        """Sentences on the angle and the azimuth."""
        found = [f"{listed([self.angle])} read as the angle of incidence in degrees"] if self.angle else []
        if self.azimuth:
            found.append(f"{listed([self.azimuth])} read as the azimuth of the sample in degrees")
        return found


@dataclass(frozen=True)
class SpectrumColumns:
    """Columns to read, and sentences on the choice.

    With a `reference`, the signal is (sample - dark) / (reference - dark) of three columns of counts.
    """

    axis: AxisColumns
    signal: Column
    sigma: Column | None
    notes: tuple[str, ...]
    reference: Column | None = None
    dark: Column | None = None


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
            raise UsageError(f"{table.path}: {_ask_without_header(table.layout.width)}")
        return [_by_position(table, signal)]
    chosen = _signals(table, named, signal, polarisation, by_caller=columns is not None)
    if [column.role for column in chosen] == ["sample counts"]:
        return [_quotient(table, named, chosen[0])]
    return [_with_wavelength(table, named, column) for column in chosen]


def _ask_without_header(width: int) -> str:
    """Ask what the columns of a table without a header are."""
    names = '`columns=["wavelength", "angle", "psi", "delta"]`'
    if width <= 2:
        return f"has no header, so say what its second column is with {_EITHER_SIGNAL}"
    if width == 3:
        return (
            f"has 3 columns and no header; say what the second is with {_EITHER_SIGNAL} (the third then is "
            f'its error), or that they are psi and delta with `signal="psi-delta"`, or name them: {names}'
        )
    return (
        f"has {width} columns and no header; name them in order, _ to skip one, as in "
        f'`columns=["wavelength", "R_percent", "_"]` or {names}'
    )


def counts_columns(table: Table, columns: str | Sequence[str] | None) -> SpectrumColumns:
    """Choose the columns of raw counts: those of the sample, or the one column beside the wavelength."""
    named = named_columns(table, columns)
    if named is None:
        return _by_position(table, "counts")
    sample = [c for c in named if c.role == "sample counts"]
    free = [
        c
        for c in named
        if c.role not in ("wavelength", "sigma", "angle", "azimuth") and c.name not in ("_", "")
    ]
    counts = sample or free
    if len(counts) != 1:
        raise UsageError(
            f"{table.path}: expected one column of counts beside the wavelength, found "
            f'{listed(counts) or "none"}; choose one, as in `columns=["wavelength", "counts"]`'
        )
    return _with_wavelength(table, _without_other_counts(named, counts[0]), counts[0])


def counts_columns_beside(
    table: Table, columns: str | Sequence[str] | None, part: str
) -> SpectrumColumns | None:
    """Return the columns of one of `COUNTS`, None where the table has none."""
    named = named_columns(table, columns) or ()
    counts = only(table, named, part)
    return _with_wavelength(table, _without_other_counts(named, counts), counts) if counts else None


def _without_other_counts(columns: Sequence[Column], counts: Column) -> list[Column]:
    return [c for c in columns if c.role not in COUNTS or c is counts]


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
    return SpectrumColumns(AxisColumns(first_column(table)), Column(1, "", role), sigma, tuple(notes))


def _with_wavelength(table: Table, columns: Sequence[Column], signal: Column) -> SpectrumColumns:
    axis = axis_columns(table, columns, '`columns=["wavelength", "R"]`')
    sigma = only(table, columns, "sigma")
    used = {c.position for c in (*axis, signal, sigma) if c}
    ignored = [c for c in columns if c.position not in used and c.name not in ("_", "")]
    notes = [f"{listed([axis.wavelength])} read as the wavelength, {listed([signal])} as the signal"]
    if sigma:
        notes.append(f"{listed([sigma])} read as the standard deviation of the signal")
    notes += axis.notes
    if ignored:
        notes.append(f"ignored: {listed(ignored)}")
    return SpectrumColumns(axis, signal, sigma, tuple(notes))


def _quotient(table: Table, columns: Sequence[Column], sample: Column) -> SpectrumColumns:
    """The transmittance that counts of a sample, a reference and possibly the dark make."""
    chosen = _with_wavelength(table, _without_other_counts(columns, sample), sample)
    reference, dark = only(table, columns, "reference counts"), only(table, columns, "dark counts")
    formula = "(sample - dark) / (reference - dark)" if dark else "sample / reference"
    notes = (*chosen.notes, f"transmittance computed from counts: {formula}")
    signal = dataclasses.replace(sample, role="T", unit="fraction", unknown_unit=None)
    return dataclasses.replace(chosen, signal=signal, reference=reference, dark=dark, notes=notes)


def axis_columns(table: Table, columns: Sequence[Column], example: str) -> AxisColumns:
    """Return the columns of wavelength, angle and azimuth. Raises DataError."""
    axes = [column for column in columns if column.role == "wavelength"]
    if len({column.unit for column in axes} - {None}) == len(axes) > 1:  # one axis in several units
        axes = [next((column for column in axes if column.unit == "nm"), axes[0])]
    wavelength, angle = only(table, axes, "wavelength"), only(table, columns, "angle")
    azimuth = only(table, columns, "azimuth")
    if wavelength is None and angle is not None:
        raise DataError(
            f"{table.path}: has angles of incidence but no wavelength among {listed(columns)}; add a column "
            "wavelength_nm with that of the light"
        )
    if wavelength is None:
        raise DataError(
            f"{table.path}: no column is a wavelength, energy or wavenumber among {listed(columns)}; "
            f"name the columns in order, as in {example}"
        )
    for column in (angle, azimuth):
        if column and column.unknown_unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit!r}; "
                "write angles in degrees"
            )
    return AxisColumns(wavelength, angle, azimuth)


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
    words = {"wavelength": "wavelength", "sigma": "sigma", "angle": "angle", "azimuth": "azimuth"}
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
    if roles & set(MUELLER):
        raise UsageError(
            f"{table.path}: has elements of a Mueller matrix, which contradicts "
            f'`signal="{signal}"`; leave that out'
        )
    if roles & set(RATIO_COLUMNS):
        raise UsageError(
            f"{table.path}: has generalised psi and delta, which contradicts "
            f'`signal="{signal}"`; leave that out'
        )
    named = [c for c in columns if c.name not in ("_", "")]
    processed = [c for c in named if c.role == "processed"]
    free = [c for c in named if c.role in ("other", "value")]
    foreign = [c for c in columns if c.role in ("foreign", "counts", *COUNTS)]
    counters = [] if foreign else free
    unnamed = processed or [c for c in free if c.name.strip().lower() not in COUNTERS] or counters
    angles = [c for c in unnamed if c.name.strip().lower().startswith(("psi", "delta", "ψ", "δ"))]
    if len(angles) > 1:
        raise DataError(
            f"{table.path}: {listed(angles)} may be psi and delta at several angles; choose two with "
            '`columns=["wavelength", "psi", "delta", "_"]` and `angle=70`, or write them below each other '
            "with a column angle_deg"
        )
    if signal is not None and unnamed and "wavelength" in roles:
        return [dataclasses.replace(c, role=signal) for c in unnamed]
    sample = only(table, columns, "sample counts")
    if sample and "reference counts" in roles and signal == "T":
        return [sample]
    if sample and "reference counts" in roles and not processed:
        raise UsageError(
            f'{table.path}: has counts of a sample and a reference; `signal="T"` takes their quotient, and a '
            'reflectance needs the material of the reference as well, as in `reference_material="Si"`'
        )
    if unnamed and "wavelength" in roles:
        percent = any(column.unit == "percent" for column in unnamed)
        unit = "" if percent else ' (unit: `signal_unit="percent"`, ...)'
        states = "states" if len(unnamed) == 1 else "state"
        raise UsageError(
            f"{table.path}: {listed(unnamed)} {states} no quantity; state it with {_EITHER_SIGNAL}{unit}"
            ', or name the columns, as in `columns=["wavelength", "R"]`'
        )
    if foreign:
        names, verb = listed(foreign).replace("declared ", ""), "is" if len(foreign) == 1 else "are"
        raise DataError(
            f"{table.path}: {names} {verb} neither a reflectance nor a transmittance; export one of these or "
            "psi and delta, give raw counts with `reference`, or if it is one, name it: "
            '`columns=["wavelength", "R"]`'
        )
    raise DataError(
        f"{table.path}: no column is a signal (R, T, Rs, Rp, Ts, Tp, absorbance or intensity) among "
        f'{listed(columns)}; name the columns in order, as in `columns=["wavelength", "R"]`'
    )
