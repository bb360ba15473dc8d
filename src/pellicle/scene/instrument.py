"""What the instrument does to the signal."""

from __future__ import annotations

import math
from typing import final

import equinox as eqx

from pellicle.scene.free import Free
from pellicle.scene.layers import Quantity, check_not_negative, none_if_zero


@final
class Drift(eqx.Module):
    """A linear nuisance solved exactly in each evaluation: a polynomial in wavelength of a degree.

    Degree 0 is one free number. The coefficients of higher degree shrink under Gaussian priors:
    of degree j, standard deviation `width`·2^(1−j) of the signal's own level.
    """

    degree: int = eqx.field(static=True, default=0)
    width: float = eqx.field(static=True, default=0.3)


SLOW_SCALE, SLOW_OFFSET, ONE_NUMBER = Drift(3), Drift(2), Drift(0)


def scale_word(what: float | str | Drift) -> float | Drift:
    """'free', 'slow' or a number, for the scale."""
    return _word(what, SLOW_SCALE, "scale")


def offset_word(what: float | str | Drift) -> float | Drift:
    """'free', 'slow' or a number, for the offset."""
    return _word(what, SLOW_OFFSET, "offset")


def _word(what, slow, name):
    if what in ("free", "slow"):
        return ONE_NUMBER if what == "free" else slow
    if isinstance(what, str):
        raise ValueError(f"{name} must be 'free', 'slow' or a number, not {what!r}")
    return what


@final
class Instrument(eqx.Module):
    """What the instrument does to the signal.

    `scale` and `offset` are numbers, "free" or "slow"; `bandwidth` is the full width at half maximum
    in nm and `thickness_spread` the standard deviation of the only layer's thickness over the spot in
    nm. The light's cone is given by `angle_spread`, its half angle in degrees, or by
    `numerical_aperture`, n₀ times the sine of that. `wavelength_shift` is what the true wavelength is
    above the one that the instrument tells, in nm. None or 0 is absent.
    """

    scale: float | Drift = eqx.field(converter=scale_word, default=1.0)
    offset: float | Drift = eqx.field(converter=offset_word, default=0.0)
    bandwidth: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    thickness_spread: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    angle_spread: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    numerical_aperture: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    wavelength_shift: Quantity | None = eqx.field(converter=none_if_zero, default=None)

    def __check_init__(self):
        check_not_negative("bandwidth", self.bandwidth, "nm")
        check_not_negative("thickness_spread", self.thickness_spread, "nm")
        check_not_negative("angle_spread", self.angle_spread, "degrees")
        check_not_negative("numerical_aperture", self.numerical_aperture, "")
        if self.angle_spread is not None and self.numerical_aperture is not None:
            raise ValueError("give angle_spread or numerical_aperture, not both: they say the same")
        if _most(self.angle_spread) >= 90:
            raise ValueError("angle_spread is a half angle: it must be below 90 degrees")

    @property
    def has_cone(self) -> bool:
        """Whether the light comes at more than one angle."""
        return self.angle_spread is not None or self.numerical_aperture is not None

    def largest_half_angle(self, ambient: float) -> float:
        """The cone's half angle in radians, at the largest that the bounds allow, in this ambient index."""
        if self.numerical_aperture is not None:
            return math.asin(min(_most(self.numerical_aperture) / ambient, 1.0))
        return math.radians(_most(self.angle_spread))


def _most(number: Quantity | None) -> float:
    if isinstance(number, Free):
        return number.upper
    return float(number) if isinstance(number, int | float) else 0.0
