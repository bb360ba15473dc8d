"""Unit of the stored numbers of a cube: fraction, percent, absorbance, or a number that stands for 1."""

from __future__ import annotations

import numpy as np

from pellicle.data.cubes.pixel_array import Scale
from pellicle.data.cubes.raw_cube import COUNTS, RawCube
from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError


def value_scale(
    raw: RawCube, signal: str, asked: str | float | None, *, calibrated: bool, framed: bool
) -> tuple[Scale, str]:
    """Return the conversion of the stored numbers, and a note on their unit.

    `asked` is the unit that the caller states, which is taken before that of the file; `framed` marks counts
    that frames of a camera convert. Raises DataError for counts without a scale, UsageError for an unknown
    unit.
    """
    factor = 1.0 / raw.divisor
    if framed or signal == "psi-delta":
        if asked is not None:
            reason = "frames of a camera give the scale" if framed else "psi and delta are in degrees"
            raise UsageError(f"{raw.path}: {reason}; leave `signal_unit` out")
        return Scale(factor, raw.missing), ""
    unit = raw.signal_unit
    if asked is not None:
        unit, full = signal_unit(str(asked)), _number(asked)
        if unit is None and full is None:
            raise UsageError(
                f"`signal_unit` must be one of {', '.join(SIGNAL_UNITS)}, or the number that stands for 1, "
                f"not {asked!r}"
            )
        if full is not None and full != 1:
            return Scale(factor / full, raw.missing), f"values divided by {full:g}, as given"
    stored = np.dtype(raw.arrays["values"].data.dtype)
    whole = stored.kind in "iu" and raw.divisor == 1.0 and unit is None
    if calibrated and (unit == COUNTS or whole):
        raise DataError(
            f"{raw.path}: has counts of a camera ({stored.name}): give `white_frame` and `dark_frame`, or, "
            "for scaled reflectances, percent or the number that stands for 1 as `signal_unit`"
        )
    if unit == "percent":
        return Scale(factor / 100, raw.missing), "signal unit: percent"
    if unit == "absorbance":
        return Scale(factor, raw.missing, True), f"signal unit: absorbance A, converted to {signal} = 10^-A"
    if not calibrated:
        return Scale(factor, raw.missing), "signal unit: arbitrary (uncalibrated)"
    return Scale(factor, raw.missing), f"signal unit: fraction{'' if unit else ', assumed'}"


def _number(asked: str | float) -> float | None:
    """A number above zero, None for anything else."""
    try:
        value = float(asked)
    except ValueError:
        return None
    return value if 0 < value < np.inf else None
