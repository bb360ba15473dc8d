"""Settings of a measurement: angle of incidence and azimuth of the sample at each point, in degrees."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int


class Setting(NamedTuple):
    """The points measured at one angle of incidence and one azimuth; None where the data state none."""

    rows: Int[np.ndarray, " points"]
    angle: float | None
    azimuth: float | None


def setting_numbers(
    angle: Float[np.ndarray, " points"] | None, azimuth: Float[np.ndarray, " points"] | None
) -> Float[np.ndarray, " points"] | None:
    """Return a number for each point that is the same at one angle and azimuth; None where neither is known.

    Without azimuths it is the angle itself.
    """
    if azimuth is None:
        return angle
    if angle is None:
        return azimuth
    pairs = np.stack([angle, azimuth])
    return np.unique(pairs, axis=1, return_inverse=True)[1].ravel().astype(float)


def settings(
    angle: Float[np.ndarray, " points"] | None,
    azimuth: Float[np.ndarray, " points"] | None,
    points: int,
) -> list[Setting]:
    """Return the points of each angle and azimuth, in rising order of both."""
    numbers = setting_numbers(angle, azimuth)
    if numbers is None:
        return [Setting(np.arange(points), None, None)]
    levels = []
    for number in np.unique(numbers):
        rows = np.flatnonzero(numbers == number)
        own = (None if x is None else float(x[rows[0]]) for x in (angle, azimuth))
        levels.append(Setting(rows, *own))
    return levels


def named(setting: Setting, every: list[Setting]) -> str | None:
    """Return the name of a setting among several, such as `65°` or `azimuth 45°`; None for a single one."""
    if len(every) == 1:
        return None
    parts = []
    if setting.angle is not None and len({each.angle for each in every}) > 1:
        parts.append(f"{setting.angle:g}°")
    if setting.azimuth is not None and len({each.azimuth for each in every}) > 1:
        parts.append(f"azimuth {setting.azimuth:g}°")
    return ", ".join(parts)
