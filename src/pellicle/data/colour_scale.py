"""Scale of colours in files: fractions, percent, or 8 and 16 bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellicle.data.signal_checks import Where, refuse_first
from pellicle.data.tabular.units import signal_unit
from pellicle.errors import DataError, UsageError

BITS = ("8-bit", "16-bit")
"""Units of coded values."""
UNITS = {"fraction": 1.0, "percent": 100.0, "8-bit": 255.0, "16-bit": 65535.0}
_ASK = '`signal_unit="8-bit"`, `signal_unit="percent"` or `signal_unit="fraction"`'
_HIGHEST = 1.5
"""Largest fraction: calibrations are off by half at most."""


def colour_unit(text: str) -> str | None:
    """Return the unit of a spectrum's signal or of colours that `text` spells, else None."""
    return text if text in BITS else signal_unit(text)


def scaled(
    values: np.ndarray,
    sigma: np.ndarray | None,
    space: str,
    unit: str | None,
    where: Sequence[Where],
    path: str,
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Convert colours (colours, 3) of a file to those of `Colours`, with a sentence on what was done.

    R, G, B that are whole numbers above 1 are 8-bit, or 16-bit above 255; X, Y, Z are percent where a Y is
    above 1.5. L*, a*, b* are taken as they are. `where` are the places of each channel's values.

    **Raises:** UsageError where the unit is unclear or unknown, DataError for values beyond every unit.
    """
    if unit is not None and colour_unit(unit) not in UNITS:
        raise UsageError(f"`signal_unit` of colours must be one of {', '.join(UNITS)}, not {unit!r}")
    unit = None if unit is None else colour_unit(unit)
    if space == "lab":
        lightness = values[:, 0]
        refuse_first(
            lightness, (lightness < -1) | (lightness > 150), where[0], "is no L*, of 0 to 100; correct it"
        )
        if lightness.max() <= 1:
            raise DataError(
                f"{path}: L* is at most {lightness.max():g}, and runs from 0 to 100; multiply it by 100"
            )
        return values, sigma, ""
    chosen = unit or (_unit_of_xyz(values, path) if space == "xyz" else _unit_of_rgb(values, path))
    full = UNITS[chosen]
    if np.max(values) > _HIGHEST * full or (unit and chosen.endswith("bit") and np.max(values) > full):
        wrong = np.max(values, axis=1) == np.max(values)
        channel = int(np.argmax(np.max(values, axis=0)))
        reason = f"is beyond {full:g}, the {'white' if space == 'xyz' else 'largest'} in {chosen}; correct it"
        refuse_first(values[:, channel], wrong, where[channel], reason)
    white = "Y = 1" if space == "xyz" else "1"
    note = f"values divided by {full:g} ({chosen})" if full != 1 else f"values as they are: {white} is white"
    return values / full, None if sigma is None else sigma / full, note


def _unit_of_rgb(values: np.ndarray, path: str) -> str:
    highest, whole = np.max(values), bool(np.all(values == np.round(values)))
    if highest <= (1 if whole else _HIGHEST):
        return "fraction"
    if whole and highest <= UNITS["16-bit"]:
        return "8-bit" if highest <= UNITS["8-bit"] else "16-bit"
    if UNITS["percent"] < highest <= UNITS["8-bit"]:
        return "8-bit"
    raise UsageError(f"{path}: R, G, B go up to {highest:g}, in an unclear unit: state it, {_ASK}")


def _unit_of_xyz(values: np.ndarray, path: str) -> str:
    highest = np.max(values[:, 1])
    if highest <= _HIGHEST:
        return "fraction"
    if highest <= _HIGHEST * UNITS["percent"]:
        return "percent"
    raise DataError(
        f"{path}: Y goes up to {highest:g}, beyond the 100 of a perfect reflector in percent; divide X, Y, Z"
        " by the Y of that white"
    )
