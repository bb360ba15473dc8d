"""Selection of the columns to read: by the caller's names, by the header, or by position."""

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pellicle.data.tabular.columns import (
    COUNTERS,
    SIGNALS,
    Column,
    listed,
    parse_columns,
    recognise,
    recognise_all,
)
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError


class AxisColumns(NamedTuple):
    """Columns of the wavelength and, where the table has them, of the angle of incidence and the azimuth of
    the sample."""

    wavelength: Column
    angle: Column | None = None
    azimuth: Column | None = None


@dataclass(frozen=True)
class Selection:
    """Columns to read for one spectrum, and sentences on the choice.

    `signal` is the word of the signal (of a power the role of its column), `values` are its columns, `errors`
    their standard deviations or none; `others` are read, too.
    """

    signal: str
    axis: AxisColumns
    values: tuple[Column, ...]
    errors: tuple[Column, ...] = ()
    others: tuple[Column, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[Column, ...]:
        """All columns beside the axis."""
        return (*self.values, *self.errors, *self.others)


def select(
    table: Table,
    columns: Sequence[Column],
    signal: str,
    values: Sequence[Column],
    meaning: str,
    example: str,
    *,
    errors: Sequence[Column] = (),
    others: Sequence[Column | None] = (),
    notes: Sequence[str] = (),
) -> Selection:
    """Select columns with those of the axis, and describe them and the columns that are ignored.

    `example` names columns in messages. Raises DataError as `axis_columns` does.
    """
    axis = axis_columns(table, columns, example)
    further = tuple(column for column in others if column)
    read = {column.position for column in (*axis, *values, *errors, *further) if column}
    ignored = [c for c in columns if c.position not in read and c.name not in ("_", "")]
    turns = (axis.angle, "angle of incidence"), (axis.azimuth, "azimuth of the sample")
    described = (
        f"{listed([axis.wavelength])} read as the wavelength, {listed(values)} as {meaning}",
        *notes,
        *(f"{listed([column])} read as the {what} in degrees" for column, what in turns if column),
        *([f"ignored: {listed(ignored)}"] if ignored else []),
    )
    return Selection(signal, axis, tuple(values), tuple(errors), further, described)


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
            "wavelength_nm, or a line `# wavelength: 632.8 nm` above the names, with that of the light"
        )
    if wavelength is None:
        raise DataError(
            f"{table.path}: no column is a wavelength, energy or wavenumber among {listed(columns)}; "
            f"name the columns in order, as in {example}"
        )
    refuse_units(table, [column for column in (angle, azimuth) if column], "write angles in degrees")
    return AxisColumns(wavelength, angle, azimuth)


def refuse_units(table: Table, columns: Iterable[Column], remedy: str, *foreign: str) -> None:
    """Raise DataError for the first column in a unit that is unknown, or `foreign` to its quantity."""
    for column in columns:
        if column.unknown_unit or column.unit in foreign:
            unit = column.unknown_unit or column.unit
            raise DataError(f"{table.path}: {table.label(column.position)} is in {unit!r}; {remedy}")


def only(table: Table, columns: Sequence[Column], role: str) -> Column | None:
    """Return the one column of a role, or None. Raises DataError for several."""
    matching = [c for c in columns if c.role == role]
    if len(matching) > 1:
        raise DataError(
            f"{table.path}: {listed(matching)} could each be the {role}; choose one with `columns`, "
            "_ for the others"
        )
    return matching[0] if matching else None


def error_columns(
    table: Table, columns: Sequence[Column], values: Sequence[Column], partly: str
) -> tuple[Column, ...]:
    """Return a standard deviation of each of `values`, one `sigma` for all, or none.

    Raises DataError where only some have one, which `partly` describes.
    """
    stated = [column for one in values if (column := only(table, columns, f"sigma_{one.role}")) is not None]
    if stated and len(stated) < len(values):
        raise DataError(f"{table.path}: gives {partly.format(listed(stated))} with _ in `columns`")
    one = only(table, columns, "sigma")
    return tuple(stated) or ((one,) if one else ())


def without_header(table: Table, example: str) -> UsageError:
    """Return the error of a table without a header, whose columns are named as in the `example`."""
    return UsageError(
        f"{table.path}: has {table.width} columns and no header; name them in order, as in {example}"
    )


def named_columns(table: Table, columns: str | Sequence[str] | None) -> tuple[Column, ...] | None:
    """Return the columns by the caller's names, or by the header and what the file declares; None without.

    Raises DataError where the file contradicts itself.
    """
    names, declared = table.names, table.declared
    if columns is not None:
        parsed = parse_columns(columns, table.path, table.width)
        return tuple(_with_unit_of_file(table, column) for column in parsed)
    if names is None:  # the file may declare the quantity above its rows
        if declared.signal is None or table.width not in (2, 3):
            return None
        of_signal = declared.signal.column
        signal = dataclasses.replace(of_signal, position=1, name=f"declared {of_signal.name}")
        sigma = [Column(2, "column 3", "sigma")] if table.width == 3 else []
        return (dataclasses.replace(first_column(table), name="column 1"), signal, *sigma)
    recognised = recognise_all(names)
    # x, y and Y are three quantities, R and r one
    alike = [x if column.role == "other" else x.lower() for x, column in zip(names, recognised, strict=True)]
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
    return tuple(_with_declared(table, column, column in unnamed) for column in recognised)


def first_column(table: Table) -> Column:
    """Return the wavelength of a table without a header, with the unit that the file declares."""
    declared = table.declared.axis
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
    names, declared = table.names or (), table.declared
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


def _with_declared(table: Table, column: Column, unnamed: bool) -> Column:
    """A column of the header with the role and the unit that the file declares. Raises DataError."""
    statement = table.declared.axis if column.role == "wavelength" else table.declared.signal
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
