"""Rows of a table that make a spectrum: their axis and columns, a range of them, and their checks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pellicle.data.repeated_sweeps import of_rows, sweep_numbers
from pellicle.data.spectrum import Spectrum, inside_range
from pellicle.data.tabular.axis_and_signal import Axis, axis_note, axis_unit, read_axis
from pellicle.data.tabular.column_selection import AxisColumns, only
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import refuse_first

REMEDY = "correct or delete that row"


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
        axis: AxisColumns,
        columns: Sequence[Column],
        unit: str | None,
        notes: Sequence[str],
    ) -> Rows:
        """Read an axis in the `unit` that the user gives, or None, and columns.

        Raises DataError or UsageError.
        """
        unit = axis_unit(table, axis.wavelength, unit)
        converted, values = read_axis(table, axis, columns, unit)
        rows = np.arange(len(converted.wavelength))
        return cls(table, rows, converted, tuple(values), (*table.notes, *notes, axis_note(unit)))

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

    def spectrum(self, notes: Sequence[str], arrays: dict[str, np.ndarray | None], **words: Any) -> Spectrum:
        """The spectrum of `arrays` with one number per row, or the mean of its sweeps.

        Raises DataError as `repeated_sweeps.mean_spectrum` does.
        """
        return of_rows(
            sweep_numbers(self.axis.wavelength, self.axis.setting),
            {**self.axis._asdict(), **arrays, "lines": self.table.source_lines(self.positions)},
            path=self.table.path,
            sha256=self.table.sha256,
            notes=(*self.notes, *notes),
            **words,
        )


def without_header(table: Table, example: str) -> UsageError:
    """The error of a table without a header, whose columns are named as in the `example`."""
    return UsageError(
        f"{table.path}: has {table.layout.width} columns and no header; name them in order, as in {example}"
    )


def error_columns(
    table: Table, columns: Sequence[Column], values: Sequence[Column], noun: str
) -> tuple[Column, ...]:
    """A standard deviation of each of `values` (called a `noun`), one `sigma` for all, or none.

    Raises DataError where only some have one.
    """
    stated = [column for one in values if (column := only(table, columns, f"sigma_{one.role}")) is not None]
    if stated and len(stated) < len(values):
        raise DataError(
            f"{table.path}: gives standard deviations of some of the {noun} only ({listed(stated)}); add the"
            " others, or skip these with _ in `columns`"
        )
    one = only(table, columns, "sigma")
    return tuple(stated) or ((one,) if one else ())
