"""Rows of a table that make a spectrum: their axis and columns, a range of them, and their checks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pellicle.data.options import SpectrumOptions
from pellicle.data.repeated_sweeps import mean_spectrum, sweep_numbers
from pellicle.data.spectrum import POLARISATIONS, Spectrum, inside_range
from pellicle.data.tabular.axis_and_signal import Axis, axis_note, axis_unit, read_axis
from pellicle.data.tabular.column_selection import AxisColumns, SpectrumColumns, only
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import check_noise, refuse_first
from pellicle.signals.registry import SIMULATED

REMEDY = "correct or delete that row"


@dataclass(frozen=True, kw_only=True)
class Reading(SpectrumOptions):
    """Arguments of `read_spectrum`. Raises UsageError for an unknown word."""

    noise: float | int | None = None
    calibrated: bool | None = None

    def __post_init__(self) -> None:
        for name, known in (("signal", SIMULATED), ("polarisation", POLARISATIONS)):
            value = getattr(self, name)
            if value is not None and value not in known:
                raise UsageError(f"`{name}` must be one of {', '.join(known)}, not {value!r}")
        check_noise(self.noise)


@dataclass(frozen=True)
class SeveralColumns:
    """Columns of the axis, of a signal that has several, and of its standard deviations or none; sentences
    on the choice."""

    axis: AxisColumns
    values: tuple[Column, ...]
    errors: tuple[Column, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Rows:
    """Rows of a table: their positions (rows,), axis and columns (rows,), and sentences on their reading."""

    table: Table
    positions: np.ndarray
    axis: Axis
    columns: tuple[np.ndarray, ...]
    notes: tuple[str, ...]

    @classmethod
    def read(
        cls,
        table: Table,
        chosen: SeveralColumns | SpectrumColumns,
        columns: Sequence[Column],
        unit: str | None,
    ) -> Rows:
        """Read the chosen axis in the `unit` that the user gives, or None, and columns.

        Raises DataError or UsageError.
        """
        unit = axis_unit(table, chosen.axis.wavelength, unit)
        axis, values = read_axis(table, chosen.axis, columns, unit)
        rows = np.arange(len(axis.wavelength))
        return cls(table, rows, axis, tuple(values), (*table.notes, *chosen.notes, axis_note(unit)))

    def cut(self, limits: tuple[float, float] | None) -> Rows:
        """The rows within limits (nm), with a note; all of them without limits. Raises as `Spectrum.cut`."""
        if limits is None:
            return self
        inside, note = inside_range(self.axis.wavelength, limits, self.table.path)
        return replace(
            self,
            positions=self.positions[inside],
            axis=self.axis.taken(inside),
            columns=tuple(x[inside] for x in self.columns),
            notes=(*self.notes, note),
        )

    def places(self, column: Column) -> Callable[[int], str]:
        """Where a cell of a column stands, by the number of the row."""
        return self.table.places(column.position, self.positions)

    def check_errors(self, columns: Sequence[Column], errors: Sequence[np.ndarray]) -> None:
        """Raise DataError for a standard deviation (rows,) that is not above zero."""
        for column, error in zip(columns, errors, strict=False):
            reason = f"is a standard deviation not above zero; {REMEDY}"
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


def read_signal(table: Table, columns: SpectrumColumns, unit: str | None) -> Rows:
    """Read the signal and, if there is one, its sigma, against an axis in the `unit` that the user gives.

    A quotient of counts is infinite where the reference has none. Raises as `Rows.read` does.
    """
    optional = (columns.sigma, columns.reference, columns.dark)
    cells = [columns.signal, *(column for column in optional if column)]
    rows = Rows.read(table, columns, cells, unit)
    signal, *rest = rows.columns
    sigma, reference, dark = (rest.pop(0) if column else None for column in optional)
    if reference is not None:
        background = 0.0 if dark is None else dark
        with np.errstate(divide="ignore", invalid="ignore"):
            quotient = (signal - background) / (reference - background)
        signal = np.where(reference > background, quotient, np.inf)
    return replace(rows, columns=(signal,) if sigma is None else (signal, sigma))


def without_header(table: Table, example: str) -> UsageError:
    """The error of a table without a header, whose columns are named as in the `example`."""
    return UsageError(
        f"{table.path}: has {table.layout.width} columns and no header; name them in order, as in {example}"
    )


def error_columns(
    table: Table, columns: Sequence[Column], values: Sequence[Column], partly: str
) -> tuple[Column, ...]:
    """A standard deviation of each of `values`, one `sigma` for all, or none.

    Raises DataError where only some have one, which `partly` describes.
    """
    stated = [column for one in values if (column := only(table, columns, f"sigma_{one.role}")) is not None]
    if stated and len(stated) < len(values):
        raise DataError(f"{table.path}: gives {partly.format(listed(stated))} with _ in `columns`")
    one = only(table, columns, "sigma")
    return tuple(stated) or ((one,) if one else ())
