"""Rows of a table that make a spectrum: their wavelength axis and columns, a range of them, and checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.measurement import SHORTEST
from pellicle.data.options import SpectrumOptions
from pellicle.data.repeated_sweeps import are_sweeps, mean_spectrum, one_way, sweep_numbers
from pellicle.data.spectrum import POLARISATIONS, Spectrum, inside_range, setting_numbers
from pellicle.data.tabular.column_selection import AxisColumns, Selection
from pellicle.data.tabular.columns import Column, unknown_unit
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.units import WAVELENGTH_UNITS, to_nm, wavelength_unit
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import check_noise, refuse_first
from pellicle.signals.registry import SIMULATED

REMEDY = "correct or delete that row"
NOISE_REPLACES = "the given noise replaces the columns of errors"
_SHORTEST = 10.0
"""An axis below this (nm) in another unit that is stated is not one of light: 500 taken for eV are 2.5 nm."""
SHORTEST_ASSUMED = 30.0
"""An axis below this (nm) whose unit is not stated is more likely in µm or eV."""
LONGEST_ASSUMED = 3300.0
"""An axis that goes beyond this (nm) without a unit is more likely in cm⁻¹ or Å; spectrometers with gratings
end at 3300 nm."""

_LEAST = 1e-12
_FEW = 3
"""Rows out of order that are corrected one by one; more are a matter of the whole file."""
_LONG = '`wavelength_unit="cm-1"`, `wavelength_unit="A"`'


@dataclass(frozen=True, kw_only=True)
class Reading(SpectrumOptions):
    """Arguments of `read_spectrum`. Raises UsageError for an unknown word."""

    noise: float | int | str | None = None
    calibrated: bool | None = None

    def __post_init__(self) -> None:
        for name, known in (("signal", SIMULATED), ("polarisation", POLARISATIONS)):
            value = getattr(self, name)
            if value is not None and value not in known:
                raise UsageError(f"`{name}` must be one of {', '.join(known)}, not {value!r}")
        check_noise(self.noise)


class Axis(NamedTuple):
    """Wavelength (nm), angle of incidence and azimuth of the sample (degrees) of each row; None without such
    a column."""

    wavelength: np.ndarray
    angle: np.ndarray | None = None
    azimuth: np.ndarray | None = None

    @property
    def setting(self) -> np.ndarray | None:
        """A number for each row that is the same at one angle and azimuth."""
        return setting_numbers(self.angle, self.azimuth)

    def taken(self, rows: Any) -> Axis:
        """Return the axis of some rows."""
        rest = (None if x is None else x[rows] for x in self[1:])
        return Axis(self.wavelength[rows], *rest)


@dataclass(frozen=True)
class Rows:
    """Rows of a table: their positions (rows,), axis, columns (rows,) by name, and sentences on them."""

    table: Table
    positions: np.ndarray
    axis: Axis
    columns: dict[str, np.ndarray]
    notes: tuple[str, ...]

    @classmethod
    def read(
        cls,
        table: Table,
        chosen: Selection,
        unit: str | None,
        overlapping: Callable[[np.ndarray], object] = lambda _: False,
    ) -> Rows:
        """Read the chosen axis in the `unit` that the user gives, or None, and columns by their roles.

        `overlapping` tells of wavelengths (rows,) that are not monotone whether the caller can read them.

        Raises DataError or UsageError.
        """
        given, unit = unit, axis_unit(table, chosen.axis.wavelength, unit)
        axis, values = read_axis(table, chosen.axis, chosen.columns, unit, overlapping)
        if given is None and unit == "nm" and (longest := np.max(axis.wavelength, initial=0)) < SHORTEST:
            raise DataError(
                f"{table.path}: wavelengths are in nm by their name and end at {longest:g}, which is like µm:"
                ' say with `wavelength_unit="um"` or `wavelength_unit="nm"` what they are'
            )
        columns = {column.role: x for column, x in zip(chosen.columns, values, strict=True)}
        notes = (*table.notes, *chosen.notes, f"wavelength unit: {unit or 'nm, assumed'}")
        return cls(table, np.arange(len(axis.wavelength)), axis, columns, notes)

    def cut(self, limits: tuple[float, float] | None) -> Rows:
        """The rows within limits (nm), with a note; all of them without limits. Raises as `Spectrum.cut`."""
        if limits is None:
            return self
        return self.taken(*inside_range(self.axis.wavelength, limits, self.table.path))

    def taken(self, rows: Any, note: str) -> Rows:
        """Some of the rows, by an index of arrays, with a note."""
        return replace(
            self,
            positions=self.positions[rows],
            axis=self.axis.taken(rows),
            columns={name: x[rows] for name, x in self.columns.items()},
            notes=(*self.notes, note),
        )

    def places(self, column: Column) -> Callable[[int], str]:
        """Where a cell of a column stands, by the number of the row."""
        return self.table.places(column.position, self.positions)

    def stacked(self, names: Sequence[str]) -> np.ndarray:
        """Columns side by side, (rows, columns)."""
        return np.stack([self.columns[name] for name in names], axis=1)

    def check_errors(self, columns: Mapping[str, Column]) -> None:
        """Raise DataError for a standard deviation that is not above zero; files name them as `columns`."""
        for name, column in columns.items():
            error, reason = self.columns[name], f"is a standard deviation not above zero; {REMEDY}"
            refuse_first(error, error <= 0, self.places(column), reason)

    def spectrum(self, notes: Sequence[str], arrays: dict[str, Any], **words: Any) -> Spectrum:
        """The spectrum of `arrays` with one number per row, or None, or the mean of its sweeps.

        Raises DataError as `repeated_sweeps.mean_spectrum` does.
        """
        lines = self.table.lines
        arrays = {**self.axis._asdict(), **arrays, "lines": None if lines is None else lines[self.positions]}
        words |= {"path": self.table.path, "sha256": self.table.sha256, "notes": (*self.notes, *notes)}
        number = sweep_numbers(self.axis.wavelength, self.axis.setting)
        if number.max(initial=0) == 0:
            return Spectrum(**arrays, **words)
        sweeps = []
        for k in range(number.max() + 1):
            of_sweep = {name: None if x is None else x[number == k] for name, x in arrays.items()}
            sweeps.append(Spectrum(**of_sweep, **words))
        return mean_spectrum(sweeps)


def axis_unit(table: Table, column: Column, requested: str | None) -> str | None:
    """Return the unit of the wavelength column from its name or from `requested`; None without either.

    Raises UsageError if `requested` is unknown or contradicts the name, DataError if the name's unit is
    unknown and none is requested.
    """
    asked = wavelength_unit(requested) if requested is not None else None
    if requested is not None and asked is None:
        raise UsageError(f"`wavelength_unit` must be one of {', '.join(WAVELENGTH_UNITS)}, not {requested!r}")
    if column.unknown_unit and asked is None:
        raise DataError(
            f"{table.path}: {table.label(column.position)} {unknown_unit(column)}; "
            f"convert it or state one of {', '.join(WAVELENGTH_UNITS)} with `wavelength_unit`"
        )
    if asked and column.unit and asked != column.unit:
        raise UsageError(
            f"{table.path}: {table.label(column.position)} is in {column.unit}, which contradicts "
            f'`wavelength_unit="{asked}"`; leave that out, or rename the columns with `columns`'
        )
    return column.unit or asked


def read_axis(
    table: Table,
    axis: AxisColumns,
    others: Sequence[Column],
    unit: str | None,
    overlapping: Callable[[np.ndarray], object] = lambda _: False,
) -> tuple[Axis, list[np.ndarray]]:
    """Return the axis and other columns, in file order.

    `unit` is the result of `axis_unit`; None means nm, assumed. Raises DataError for a cell that is not a
    finite number, an impossible wavelength or angle, or an axis that is not strictly monotone within one
    angle and azimuth and is neither that of several complete sweeps nor `overlapping`.
    """
    wavelength, angle, azimuth = axis
    columns = [wavelength, *others, *(column for column in (angle, azimuth) if column)]
    values, *read = table.numbers([column.position for column in columns])
    azimuths = read.pop() if azimuth else None
    angles = read.pop() if angle else None
    if angle and angles is not None:
        reason = f"is not from 0 to below 90 degrees; {REMEDY}"
        refuse_first(angles, (angles < 0) | (angles >= 90), table.places(angle.position), reason)
    place = table.places(wavelength.position)
    refuse_first(values, values <= 0, place, f"is not above zero; {REMEDY}")
    beyond = (values < _LEAST) | (values > 1 / _LEAST)
    refuse_first(values, beyond, place, f"is far from any wavelength, in whatever unit; {REMEDY}")
    if unit is None and not SHORTEST_ASSUMED <= values.max() <= LONGEST_ASSUMED:
        small = values.max() < SHORTEST_ASSUMED
        likely = '`wavelength_unit="um"`, `wavelength_unit="eV"`' if small else _LONG
        raise DataError(
            f"{table.path}: {table.label(wavelength.position)} runs from {values.min():g} to "
            f'{values.max():g}, which is unlike nm; state its unit: {likely} or `wavelength_unit="nm"`'
        )
    converted = Axis(to_nm(values, unit or "nm"), angles, azimuths)
    if unit not in (None, "nm") and converted.wavelength.max() < _SHORTEST:
        raise DataError(
            f"{table.path}: {table.label(wavelength.position)} runs from {values.min():g} to "
            f"{values.max():g} {unit}, which is no wavelength of light; correct its unit, or leave out "
            "`wavelength_unit`"
        )
    if converted.setting is None and (one_way(values) or overlapping(values)):
        return converted, read
    if are_sweeps(values, converted.setting, sweep_numbers(values, converted.setting)):
        return converted, read
    groups = np.zeros(values.size) if converted.setting is None else converted.setting
    for group in np.unique(groups):
        _check_monotone(table, axis, values, np.flatnonzero(groups == group))
    return converted, read


def _check_monotone(table: Table, axis: AxisColumns, values: np.ndarray, rows: np.ndarray) -> None:
    steps = np.diff(values[rows])
    direction = np.sign(np.sum(np.sign(steps))) or 1.0
    wrong = np.flatnonzero(np.sign(steps) != direction)
    if wrong.size:
        here, before = int(rows[wrong[0] + 1]), int(rows[wrong[0]])
        one = "angle and azimuth" if axis.azimuth else "angle"
        verb = "repeats" if values[here] == values[before] else "turns back after"
        place = table.where(here, axis.wavelength.position)
        equal, turns = int(np.sum(steps == 0)), int(np.sum(np.sign(steps) == -direction))
        remedy = "delete or correct one of the rows"
        if turns > _FEW and np.unique(values[rows]).size == rows.size:
            remedy = f"sort the rows, which turn back {turns} times"
        elif equal > _FEW and not turns:
            remedy = (
                "export more digits of the wavelengths, or replace the rows of each of the "
                f"{equal} repeated ones by their mean"
            )
        raise DataError(
            f"{place}: {values[here]:.10g} {verb} {values[before]:.10g} of {table.place(before)}; within one "
            f"{one} wavelengths must rise or fall strictly, or come in several complete sweeps, so {remedy}"
        )
