"""Physical limits of measured values: which reflectances, Ψ and Δ, σ and angles are accepted."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pellicle.errors import DataError, UsageError
from pellicle.signals.local_scatter import local_scatter

HIGHEST = 1.5  # a calibration may be off by half; 49 is a percentage without its unit
LOWEST = -0.05  # without σ: what dark current and drift may do
LOWEST_OF_NOISE = -0.1  # without σ, where the local scatter explains it
LOWEST_WITH_SIGMA = -0.01  # with σ: the same for a good instrument, or −5 σ if that is lower

PSI = (0.0, 90.0)
"""Limits of Ψ in degrees."""
DELTA = (-180.0, 360.0)
"""Limits of Δ in degrees: -180 to 180, -90 to 270 and 0 to 360 are all in use."""
FOLDED_DELTA = (0.0, 180.0)
"""Limits of Δ in degrees for an instrument without a compensator, which measures cos Δ only."""

DEPOLARISATION = (-0.5, 1.05)
"""Limits of 1 − N² − C² − S²: noise and calibration take it below 0 and beyond 1; 2.3 is a percentage."""

ROUNDING = 1e-3
"""Degrees by which Ψ and Δ may exceed their limits, as rounded or differenced values do."""

Where = Callable[[int], str]
"""The place of a row for a message: file, line and column."""


def refuse_first(values: np.ndarray, wrong: np.ndarray, where: Where, reason: str) -> None:
    """Raise DataError for the first wrong value: its place, the value, the reason."""
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(f"{where(row)}: {values[row]:g} {reason}")


class NoiseLevel(NamedTuple):
    """A standard deviation in the unit of the signal, or where `relative` as a share of the signal."""

    value: float
    relative: bool = False

    def __str__(self) -> str:
        return f"{100 * self.value:g} %" if self.relative else f"{self.value:g}"


def noise_level(value: float | str, name: str = "`noise`") -> NoiseLevel:
    """Return the noise level of a number, or of a text such as "0.01" or "2 %".

    Raises UsageError, with `name` in front, unless it is a finite number above zero.
    """
    text = str(value).strip()
    relative = text.endswith("%")
    try:
        number = float(text.removesuffix("%"))
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise UsageError(
            f"{name} must be a standard deviation above zero, as in 0.01, or a share of the signal, "
            f"as in '2 %', not {text!r}"
        )
    return NoiseLevel(number / 100 if relative else number, relative)


def noise_of(kind: str, noise: float | str) -> float:
    """The standard deviation of a signal that has no share of itself. Raises UsageError for a share."""
    level = noise_level(noise)
    if level.relative:
        raise UsageError(
            f"`noise` {level} is a share of the signal, which {kind} cannot have: give its standard deviation"
            " as a number"
        )
    return level.value


def check_noise(noise: float | str | None) -> None:
    """Raise UsageError unless a standard deviation is None, finite and above zero, or a text of one."""
    if isinstance(noise, str):
        noise_level(noise)
    elif noise is not None and not 0 < noise < np.inf:
        raise UsageError(
            f"`noise` must be a standard deviation above zero, as in `noise=0.005`, got {noise:g}"
        )


def check_power(
    noun: str, values: np.ndarray, sigma: np.ndarray | None, where: Where, *, too_high: str, remedy: str
) -> None:
    """Refuse what no sample reflects or transmits; `noun` names it. Raises DataError.

    Values are at most 1.5 and at least -0.05, or with σ at least −5 σ or -0.01, whichever is lower: an offset
    of the dark current reaches that. Without σ, −5 times the local scatter are accepted down to -0.1.
    `too_high` and `remedy` are the advice for too high and too low values.
    """
    if values.max() > HIGHEST:
        high = values == values.max()
        refuse_first(values, high, where, f"is above {HIGHEST} for a {noun}; {too_high}")
    limit = np.full(values.shape, LOWEST) if sigma is None else np.minimum(LOWEST_WITH_SIGMA, -5 * sigma)
    if sigma is None and values.min() < LOWEST:
        limit = np.clip(-5 * local_scatter(values), LOWEST_OF_NOISE, LOWEST)
    lowest = int(np.argmin(values - limit))
    if values[lowest] < limit[lowest]:
        reason = f"is a {noun} below zero by more than noise ({limit[lowest]:g}); {remedy}"
        refuse_first(values, np.arange(values.size) == lowest, where, reason)


def check_psi_delta(
    psi: np.ndarray, delta: np.ndarray, folded: bool, where_psi: Where, where_delta: Where, remedy: str
) -> None:
    """Refuse Ψ and Δ (degrees) outside their limits. Raises DataError."""
    name, limits = ("a folded delta", FOLDED_DELTA) if folded else ("delta", DELTA)
    _check_limits(psi, PSI, "psi", where_psi, remedy)
    _check_limits(delta, limits, name, where_delta, remedy)


def check_depolarisation(values: np.ndarray, where: Where, remedy: str) -> None:
    """Refuse a depolarisation that is no fraction. Raises DataError."""
    low, high = DEPOLARISATION
    reason = f"is not from {low:g} to {high:g}, as a depolarisation is, a fraction; {remedy}"
    refuse_first(values, (values < low) | (values > high), where, reason)


def _check_limits(
    values: np.ndarray, limits: tuple[float, float], name: str, where: Where, remedy: str
) -> None:
    low, high = limits
    reason = f"is not from {low:g} to {high:g} degrees, as {name} is; {remedy}"
    wrong = (values < low - ROUNDING) | (values > high + ROUNDING)
    refuse_first(values, wrong, where, reason)
