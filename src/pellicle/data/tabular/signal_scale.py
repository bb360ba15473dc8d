"""Unit of a reflectance or transmittance: fractions or percent, as the file or the caller states it."""

from __future__ import annotations

from dataclasses import dataclass

from pellicle.data.tabular.column_selection import SpectrumColumns
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError


@dataclass(frozen=True)
class Scale:
    """Divisors that turn a file's signal and σ into fractions, and whether the unit was stated."""

    signal: float
    sigma: float
    stated: bool

    def note(self, calibrated: bool) -> str:
        """Return a sentence on the unit in which the signal was read."""
        if not calibrated:
            return "signal unit: arbitrary (uncalibrated)"
        unit = "percent" if self.signal == 100 else "fraction"
        return f"signal unit: {unit}" + ("" if self.stated else ", assumed")


def signal_scale(table: Table, columns: SpectrumColumns, requested: str | None) -> Scale:
    """Return the scale from the column's name or from `requested`. Percent is never guessed from values.

    Raises UsageError if `requested` is unknown or contradicts the name, DataError if the name's unit is
    unknown and none is requested.
    """
    asked = None if requested is None else signal_unit(requested)
    if requested is not None and asked is None:
        raise UsageError(f"`signal_unit` must be one of {', '.join(SIGNAL_UNITS)}, not {requested!r}")
    column = columns.signal
    place = f"{table.path}: {table.label(column.position)}"
    if column.unknown_unit and asked is None:
        raise DataError(
            f"{place} is in an unknown unit {column.unknown_unit!r}; state it with "
            '`signal_unit="fraction"` or `signal_unit="percent"`'
        )
    if asked and column.unit and asked != column.unit:
        raise UsageError(
            f'{place} is in {column.unit}, which contradicts `signal_unit="{asked}"`; leave that out, or '
            "rename the columns with `columns`"
        )
    unit = column.unit or asked
    sigma_unit = columns.sigma.unit if columns.sigma else None
    return Scale(_divisor(unit), _divisor(sigma_unit or unit), unit is not None)


def _divisor(unit: str | None) -> float:
    return 100.0 if unit == "percent" else 1.0
