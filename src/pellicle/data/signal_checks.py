"""Is this a reflectance? The unit of a signal settled, and its values judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.column_selection import Chosen
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError

HIGHEST = 1.5  # a calibration may be off by half; 49 is a percentage that nobody declared
LOWEST = -0.05  # without a sigma: what dark current and drift may do
LOWEST_WITH_SIGMA = -0.01  # with one: the same for a good instrument, or 5 sigma if that is lower


@dataclass(frozen=True)
class Scale:
    """Divisors that turn the file's signal and sigma into fractions; was the unit stated?"""

    signal: float
    sigma: float
    stated: bool


def signal_scale(table: Table, chosen: Chosen, flag: str | None) -> Scale:
    """Scale from the column's name or `--signal-unit`. Percent is never guessed from the values.

    Raises UsageError if the flag is no unit or contradicts the name, DataError if the name's unit
    is unknown and there is no flag.
    """
    asked = None if flag is None else signal_unit(flag)
    if flag is not None and asked is None:
        raise UsageError(f"--signal-unit {flag!r} is not known; use one of {', '.join(SIGNAL_UNITS)}")
    column = chosen.signal
    where = f"{table.path}: {table.label(column.position)}"
    if column.unknown_unit and asked is None:
        raise DataError(
            f"{where} is in an unknown unit {column.unknown_unit!r}; state it with --signal-unit fraction or "
            "--signal-unit percent"
        )
    if asked and column.unit and asked != column.unit:
        raise UsageError(
            f"{where} is in {column.unit} but --signal-unit says {asked}; leave the flag out, or name the "
            "columns anew with --columns"
        )
    unit = column.unit or asked
    own = chosen.sigma.unit if chosen.sigma else None
    return Scale(_divisor(unit), _divisor(own or unit), unit is not None)


def _divisor(unit: str | None) -> float:
    return 100.0 if unit == "percent" else 1.0


def scale_note(scale: Scale, calibrated: bool) -> str:
    """Sentence on the unit in which the signal was read."""
    if not calibrated:
        return "signal unit: arbitrary (uncalibrated)"
    unit = "percent" if scale.signal == 100 else "fraction"
    return f"signal unit: {unit}" + ("" if scale.stated else ", assumed")


def check_signal(spectrum: Spectrum, label: str, *, stated: bool) -> None:
    """Refuses what no sample can reflect or transmit.

    Calibrated values are at most 1.5 and at least -0.05, or where sigma is known at least -5 sigma
    or -0.01, whichever is lower: an offset of the dark current reaches that. Uncalibrated values
    need only be positive somewhere. `label` names the column; `stated` says that its unit was
    given. Raises DataError.
    """
    values, sigma = spectrum.values, spectrum.sigma
    if sigma is not None and sigma.min() <= 0:
        _refuse(
            spectrum, "sigma", int(np.argmin(sigma)), sigma, "is not above zero; correct or delete that row"
        )
    if not spectrum.calibrated:
        if values.max() <= 0:
            raise DataError(f"{spectrum.path}: {label} is nowhere positive; check what it holds")
        return
    high = int(np.argmax(values))
    if values[high] > HIGHEST:
        remedy = "cut it off with --range or correct that row"
        if not stated:
            remedy = "if the file is in percent, say so with --signal-unit percent or in its header"
        _refuse(spectrum, label, high, values, f"is above {HIGHEST} for a {_noun(spectrum)}; {remedy}")
    limit = np.full(values.shape, LOWEST) if sigma is None else np.minimum(LOWEST_WITH_SIGMA, -5 * sigma)
    low = int(np.argmin(values - limit))
    if values[low] < limit[low]:
        remedy = "cut it off with --range or correct that row"
        why = f"is a {_noun(spectrum)} below zero by more than noise ({limit[low]:g})"
        _refuse(spectrum, label, low, values, f"{why}; {remedy}")


def _noun(spectrum: Spectrum) -> str:
    return "reflectance" if spectrum.signal == "R" else "transmittance"


def _refuse(spectrum: Spectrum, label: str, row: int, values: np.ndarray, why: str) -> None:
    line = "" if spectrum.lines is None else f"line {spectrum.lines[row]}, "
    raise DataError(f"{spectrum.path}: {line}{label}: {values[row]:g} {why}")
