"""Unit of a reflectance or transmittance: fraction, percent or absorbance, as file or caller state it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellicle.data.tabular.column_selection import SpectrumColumns
from pellicle.data.tabular.columns import unknown_unit
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError

_LEAST = -300.0
"""Absorbances below it would overflow; the signal is refused anyhow, as far above 1."""


@dataclass(frozen=True)
class Scale:
    """Units of a file's signal and σ, members of `SIGNAL_UNITS`, and whether file or caller states it."""

    signal: str
    sigma: str
    stated: bool

    def fractions(self, values: np.ndarray, sigma: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """Convert the signal and its σ to fractions.

        An absorbance A becomes 10⁻ᴬ with the error ln 10 · 10⁻ᴬ σ.
        """
        if self.signal == "absorbance":
            values = 10.0 ** -np.maximum(values, _LEAST)
        elif self.signal == "percent":
            values = values / 100
        if sigma is not None and self.sigma == "absorbance":
            sigma = np.log(10.0) * values * sigma
        elif sigma is not None and self.sigma == "percent":
            sigma = sigma / 100
        return values, sigma

    def note(self, quantity: str, calibrated: bool) -> str:
        """Return a sentence on the unit in which the signal was read."""
        if self.signal == "absorbance":
            return f"signal unit: absorbance A, converted to {quantity} = 10^-A"
        if not calibrated:
            return "signal unit: arbitrary (uncalibrated)"
        return f"signal unit: {self.signal}" + ("" if self.stated else ", assumed")


def signal_scale(table: Table, columns: SpectrumColumns, requested: str | None) -> Scale:
    """Return the scale from the column's name or from `requested`. It is never guessed from values.

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
            f"{place} {unknown_unit(column)}; state it with "
            '`signal_unit="fraction"`, `signal_unit="percent"` or `signal_unit="absorbance"`'
        )
    if asked and column.unit and asked != column.unit:
        raise UsageError(
            f'{place} is in {column.unit}, which contradicts `signal_unit="{asked}"`; leave that out, or '
            "rename the columns with `columns`"
        )
    unit = column.unit or asked
    sigma_unit = columns.sigma.unit if columns.sigma else None
    return Scale(unit or "fraction", sigma_unit or unit or "fraction", unit is not None)
