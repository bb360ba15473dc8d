"""Units of the reflectances and transmittances of a file, and its errors and the given noise in them."""

from dataclasses import dataclass

import numpy as np

from pellicle.data.spectrum_rows import Rows
from pellicle.data.tabular import column_selection as selection
from pellicle.data.tabular.columns import Column, unknown_unit
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import noise_level

LEAST_SHARED = 0.01
"""Fraction below which a share of the signal is taken of this: there the noise of the dark dominates."""
_LEAST_ABSORBANCE = -300.0
"""Absorbances below it would overflow; the signal is refused anyhow, as far above 1."""


@dataclass(frozen=True)
class Scale:
    """Units of a file's signal and σ, members of `SIGNAL_UNITS`, and whether file or caller states it."""

    signal: str
    sigma: str
    stated: bool

    def fractions(self, values: np.ndarray, sigma: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Convert the signal (points,) and its σ (points,) to fractions.

        An absorbance A becomes 10⁻ᴬ with the error ln 10 · 10⁻ᴬ σ.
        """
        if self.signal == "absorbance":
            values = 10.0 ** -np.maximum(values, _LEAST_ABSORBANCE)
        elif self.signal == "percent":
            values = values / 100
        fractions = {"values": values}
        if sigma is not None:
            factor = np.log(10.0) * values if self.sigma == "absorbance" else 1.0
            fractions["sigma"] = sigma / 100 if self.sigma == "percent" else factor * sigma
        return fractions

    def noise(self, given: float | str, values: np.ndarray) -> tuple[np.ndarray, str]:
        """σ of the fractions (points,): a number as it is, a text in the unit of the file or as a share.

        Returns a note, too, where σ is not the number that is given.
        """
        level = noise_level(given)
        if level.relative:
            note = f"noise: {level} of the signal at each point, at least of {LEAST_SHARED:g}"
            return level.value * np.maximum(np.abs(values), LEAST_SHARED), note
        sigma = np.full(len(values), level.value)
        if not isinstance(given, str) or self.signal == "fraction":
            return sigma, ""
        if self.signal == "percent":
            return sigma / 100, f"noise: {level} %, as the file is in percent, {level.value / 100:g}"
        return np.log(10.0) * values * sigma, f"noise: {level} of the absorbance"

    def note(self, quantity: str, calibrated: bool) -> str:
        """Return a sentence on the unit in which the signal was read."""
        if self.signal == "absorbance":
            return f"signal unit: absorbance A, converted to {quantity} = 10^-A"
        if not calibrated:
            return "signal unit: arbitrary (uncalibrated)"
        return f"signal unit: {self.signal}" + ("" if self.stated else ", assumed")


def _contradiction(table: Table, column: Column, unit: str) -> UsageError:
    return UsageError(
        f"{table.path}: {table.label(column.position)} is in {column.unit}, which contradicts"
        f' `signal_unit="{unit}"`; leave that out, or rename the columns with `columns`'
    )


def check_percent(table: Table, rows: Rows, column: Column, asked: str | None) -> None:
    """Raise UsageError for values of 0 to 1 in a column of percent, unless the caller states their unit.

    Exports of an instrument, which its reader remarks on, are in the unit that they state.
    """
    values = rows.columns["values"]
    if column.unit != "percent":
        return
    if values.max() > 1:
        if asked is not None and signal_unit(asked) == "fraction":
            raise _contradiction(table, column, "fraction")
    elif asked is None and not table.remarks and values.min() >= 0 and values.max() > 0:
        raise UsageError(
            f"{table.path}: {table.label(column.position)} is in percent by its name, and its largest value,"
            f' {values.max():g}, is like a fraction: say with `signal_unit="percent"` or'
            ' `signal_unit="fraction"` what it is'
        )


def signal_scale(table: Table, chosen: selection.Selection, requested: str | None) -> Scale:
    """Return the scale from the column's name or from `requested`. It is never guessed from values.

    Raises UsageError if `requested` is unknown or contradicts the name, DataError if the name's unit is
    unknown and none is requested.
    """
    asked = None if requested is None else signal_unit(requested)
    if requested is not None and asked is None:
        raise UsageError(f"`signal_unit` must be one of {', '.join(SIGNAL_UNITS)}, not {requested!r}")
    [column] = chosen.values
    place = f"{table.path}: {table.label(column.position)}"
    if column.unknown_unit and asked is None:
        raise DataError(
            f"{place} {unknown_unit(column)}; state it with "
            '`signal_unit="fraction"`, `signal_unit="percent"` or `signal_unit="absorbance"`'
        )
    overruled = (asked, column.unit) == ("fraction", "percent")  # fractions under a header of percent
    if asked and column.unit and asked != column.unit and not overruled:
        raise _contradiction(table, column, asked)
    unit = asked or column.unit
    sigma_unit = "fraction" if overruled else chosen.errors[0].unit if chosen.errors else None
    return Scale(unit or "fraction", sigma_unit or unit or "fraction", unit is not None)
