"""Selection of the columns to read: by the caller's names, by the header, or by position."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pellicle.data.tabular.column_names import COUNTERS, MUELLER, RATIO_COLUMNS
from pellicle.data.tabular.columns import (
    COUNTS,
    SIGNALS,
    Column,
    Declared,
    listed,
    parse_columns,
    recognise,
    recognise_all,
)
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError

_EITHER_SIGNAL = '`signal="R"` or `signal="T"`'
_SEVERAL_COLUMNS = {
    "psi and delta": ("psi", "delta"),
    "elements of a Mueller matrix": MUELLER,
    "generalised psi and delta": RATIO_COLUMNS,
}
"""Roles of the signals that have several columns."""


class AxisColumns(NamedTuple):
    """Columns of the wavelength and, where the table has them, of the angle of incidence and the azimuth of
    the sample."""

    wavelength: Column
    angle: Column | None = None
    azimuth: Column | None = None

    @property
    def notes(self) -> list[str]:
        """Sentences on the angle and the azimuth."""
        sentences = (
            [f"{listed([self.angle])} read as the angle of incidence in degrees"] if self.angle else []
        )
        if self.azimuth:
            sentences.append(f"{listed([self.azimuth])} read as the azimuth of the sample in degrees")
        return sentences


def choice_notes(
    columns: Sequence[Column],
    axis: AxisColumns,
    values: Sequence[Column],
    meaning: str,
    others: Sequence[Column | None] = (),
    notes: Sequence[str] = (),
) -> tuple[str, ...]:
    """Sentences on the columns of the axis and of the `values`, `notes`, and on columns that are ignored.

    `others` are columns that are read, too.
    """
    read = {column.position for column in (*axis, *values, *others) if column}
    ignored = [c for c in columns if c.position not in read and c.name not in ("_", "")]
    return (
        f"{listed([axis.wavelength])} read as the wavelength, {listed(values)} as {meaning}",
        *notes,
        *axis.notes,
        *([f"ignored: {listed(ignored)}"] if ignored else []),
    )


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
    notes = [f"{listed([sigma])} read as the standard deviation of the signal"] if sigma else []
    notes = choice_notes(columns, axis, [signal], "the signal", [sigma], notes)
    return SpectrumColumns(axis, signal, sigma, notes)


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
    _check_no_other_signal(table, columns, signal)
    roles = {c.role for c in columns}
    named = [c for c in columns if c.name not in ("_", "")]
    processed = [c for c in named if c.role == "processed"]
    free = [c for c in named if c.role in ("other", "value")]
    foreign = [c for c in columns if c.role in ("foreign", "counts", *COUNTS)]
    counters = [] if foreign else free
    unnamed = processed or [c for c in free if c.name.strip().lower() not in COUNTERS] or counters
    _check_one_angle(table, unnamed)
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
    raise _no_signal(table, columns, unnamed if "wavelength" in roles else [], foreign)


def _check_no_other_signal(table: Table, columns: Sequence[Column], signal: str | None) -> None:
    """Raise UsageError for columns of another signal than the one that the caller states."""
    roles = {c.role for c in columns}
    other = next((role for role in SIGNALS if role in roles), None)
    if other:
        raise UsageError(f'{table.path}: has {other}, which contradicts `signal="{signal}"`; correct that')
    for name, known in _SEVERAL_COLUMNS.items():
        if roles & set(known):
            raise UsageError(
                f'{table.path}: has {name}, which contradicts `signal="{signal}"`; leave that out'
            )


def _check_one_angle(table: Table, unnamed: Sequence[Column]) -> None:
    angles = [c for c in unnamed if c.name.strip().lower().startswith(("psi", "delta", "ψ", "δ"))]
    if len(angles) > 1:
        raise DataError(
            f"{table.path}: {listed(angles)} may be psi and delta at several angles; choose two with "
            '`columns=["wavelength", "psi", "delta", "_"]` and `angle=70`, or write them below each other '
            "with a column angle_deg"
        )


def _no_signal(
    table: Table, columns: Sequence[Column], unnamed: Sequence[Column], foreign: Sequence[Column]
) -> DataError | UsageError:
    """The error of a table whose columns name no signal: `unnamed` may be one, `foreign` are none."""
    if unnamed:
        percent = any(column.unit == "percent" for column in unnamed)
        unit = "" if percent else ' (unit: `signal_unit="percent"`, ...)'
        states = "states" if len(unnamed) == 1 else "state"
        return UsageError(
            f"{table.path}: {listed(unnamed)} {states} no quantity; state it with {_EITHER_SIGNAL}{unit}"
            ', or name the columns, as in `columns=["wavelength", "R"]`'
        )
    if foreign:
        names, verb = listed(foreign).replace("declared ", ""), "is" if len(foreign) == 1 else "are"
        return DataError(
            f"{table.path}: {names} {verb} neither a reflectance nor a transmittance; export one of these or "
            "psi and delta, give raw counts with `reference`, or if it is one, name it: "
            '`columns=["wavelength", "R"]`'
        )
    return DataError(
        f"{table.path}: no column is a signal (R, T, Rs, Rp, Ts, Tp, absorbance or intensity) among "
        f'{listed(columns)}; name the columns in order, as in `columns=["wavelength", "R"]`'
    )


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
    recognised = recognise_all(names)
    # x, y and Y are three quantities, R and r one
    alike = [
        name if column.role == "other" else name.lower()
        for name, column in zip(names, recognised, strict=True)
    ]
    twice = next((name for i, name in enumerate(names) if name and alike[i] in alike[:i]), None)
    if twice is not None:
        raise DataError(
            f"{table.path}: the header names {twice!r} twice; rename one, or name the columns with `columns`"
        )
    signals = [column for column in recognised if column.role in SIGNALS]
    _refuse_optical_constants(table, recognised)
    open_roles = ("other", "intensity", "counts", "processed")
    free = [c for c in recognised if c.role in open_roles and c.name.strip().lower() not in ("", *COUNTERS)]
    foreign = declared.signal is not None and declared.signal.column.role == "foreign"
    processed = [] if foreign else [c for c in free if c.role == "processed"]
    unnamed = () if signals else processed or free
    return tuple(_with_declared(table, column, declared, column in unnamed) for column in recognised)


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
    named = recognise(names[column.position]) if column.position < len(names) else None
    power = column.role in SIGNALS
    statement = declared.signal if power else declared.axis
    known = (*SIGNALS, "processed", "other") if power else ("wavelength",)
    stated = [named] if named and named.role in known else []
    stated += [statement.column] if statement else []
    with_unit = next((one for one in stated if one.unit or one.unknown_unit), None)
    if with_unit is None:
        return column
    if power and with_unit.unit == "absorbance":
        raise UsageError(
            f"{table.path}: calls {with_unit.name!r}, an absorbance, what `columns` calls {column.name!r}; "
            f"name it absorbance there, or {column.name}_fraction if it is none"
        )
    return dataclasses.replace(column, unit=with_unit.unit, unknown_unit=with_unit.unknown_unit)


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
