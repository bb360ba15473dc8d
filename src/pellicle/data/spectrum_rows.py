"""Rows of a table that make a spectrum: their axis and columns, a range of them, and their checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pellicle.data.options import SpectrumOptions
from pellicle.data.repeated_sweeps import mean_spectrum, sweep_numbers
from pellicle.data.spectrum import POLARISATIONS, Spectrum, inside_range
from pellicle.data.tabular.axis import Axis, axis_note, axis_unit, read_axis
from pellicle.data.tabular.column_selection import Selection
from pellicle.data.tabular.columns import Column
from pellicle.data.tabular.table import Table
from pellicle.errors import UsageError
from pellicle.signals.limits import check_noise, refuse_first
from pellicle.signals.registry import SIMULATED

REMEDY = "correct or delete that row"
NOISE_REPLACES = "the given noise replaces the columns of errors"


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
class Rows:
    """Rows of a table: their positions (rows,), axis, columns (rows,) by name, and sentences on them."""

    table: Table
    positions: np.ndarray
    axis: Axis
    columns: dict[str, np.ndarray]
    notes: tuple[str, ...]

    @classmethod
    def read(cls, table: Table, chosen: Selection, unit: str | None) -> Rows:
        """Read the chosen axis in the `unit` that the user gives, or None, and columns by their roles.

        Raises DataError or UsageError.
        """
        unit = axis_unit(table, chosen.axis.wavelength, unit)
        axis, values = read_axis(table, chosen.axis, chosen.columns, unit)
        columns = {column.role: x for column, x in zip(chosen.columns, values, strict=True)}
        notes = (*table.notes, *chosen.notes, axis_note(unit))
        return cls(table, np.arange(len(axis.wavelength)), axis, columns, notes)

    def cut(self, limits: tuple[float, float] | None) -> Rows:
        """The rows within limits (nm), with a note; all of them without limits. Raises as `Spectrum.cut`."""
        if limits is None:
            return self
        inside, note = inside_range(self.axis.wavelength, limits, self.table.path)
        return replace(
            self,
            positions=self.positions[inside],
            axis=self.axis.taken(inside),
            columns={name: x[inside] for name, x in self.columns.items()},
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
