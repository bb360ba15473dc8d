"""Effects of the instrument on the signal: scale, offset, bandwidth, spreads and the cone of light."""

import math
from functools import partial
from typing import final

import equinox as eqx

from pellicle.scene.free import MONOTONIC, VARIES, Free
from pellicle.scene.layers import Quantity, check_not_negative, none_if_zero


@final
class Drift(eqx.Module):
    """Linear nuisance that each evaluation solves exactly: a polynomial in wavelength.

    Degree 0 is one free number. Coefficients of higher degree shrink under normal priors: that of degree j
    has the standard deviation `width`·2^(1−j) of the signal's own level. `varies`: how one number changes in
    a series, one of `VARIES` but "monotonic"; None, and "freely", for another number at each time.
    """

    degree: int = eqx.field(static=True, default=0)
    width: float = eqx.field(static=True, default=0.3)
    varies: str | None = eqx.field(static=True, default=None)


SLOW_SCALE, SLOW_OFFSET, ONE_NUMBER = Drift(3), Drift(2), Drift(0)


def _number_or_drift(
    value: float | str | dict[str, str] | Drift | Free, slow: Drift, name: str
) -> float | Drift:
    if isinstance(value, dict):
        words = tuple(word for word in VARIES if word != MONOTONIC)
        if {*value} != {"varies"} or value["varies"] not in words:
            raise ValueError(f"`{name}` has the key varies, one of {', '.join(words)}, not {value!r}")
        return Drift(varies=value["varies"])
    if isinstance(value, str):
        drifts = {"free": ONE_NUMBER, "slow": slow}
        if value not in drifts:
            raise ValueError(f"`{name}` must be 'free', 'slow' or a number, not {value!r}")
        return drifts[value]
    if isinstance(value, Free):
        raise ValueError(f"`{name}` has no bounds: give 'free', 'slow' or a number")
    return value


_SCALE = partial(_number_or_drift, slow=SLOW_SCALE, name="scale")
_OFFSET = partial(_number_or_drift, slow=SLOW_OFFSET, name="offset")


@final
class Instrument(eqx.Module):
    """Effects of the instrument on the signal.

    **Arguments:**

    - `scale`, `offset`: numbers, "free" (one fitted number) or "slow" (a fitted polynomial in wavelength);
      {"varies": "slowly"} for one number that changes slowly with the time of a series.
    - `bandwidth`: full width at half maximum in nm.
    - `thickness_spread`: standard deviation of the only layer's thickness over the spot in nm.
    - `angle_spread`: half angle of the cone of light in degrees; or `numerical_aperture`, n₀ times its sine.
    - `apodisation`: factor G of a Gaussian apodisation of the cone: the light in the pupil falls as
      exp(−2Gρ²) towards its edge, ρ = 1. Without it the pupil is evenly filled.
    - `stray_light`: light that reaches the detector beside that of the sample and as much beside that of the
      reference of a contrast, as a fraction of the incident light.
    - `wavelength_shift`: true wavelength minus the instrument's, in nm.
    - `angle_shift`: true angle of incidence minus the instrument's, in degrees.

    None or 0 is absent.

    **Raises:** ValueError for an unknown word, a negative width, or two descriptions of the cone.

    >>> Instrument(scale="slow", bandwidth=Free(0, 20)).scale.degree
    3
    """

    scale: float | Drift = eqx.field(converter=_SCALE, default=1.0)
    offset: float | Drift = eqx.field(converter=_OFFSET, default=0.0)
    bandwidth: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    thickness_spread: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    angle_spread: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    numerical_aperture: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    apodisation: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    stray_light: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    wavelength_shift: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    angle_shift: Quantity | None = eqx.field(converter=none_if_zero, default=None)

    def __check_init__(self):
        units = {"bandwidth": "nm", "thickness_spread": "nm", "angle_spread": "degrees"}
        units |= dict.fromkeys(("numerical_aperture", "apodisation", "stray_light"), "")
        for name, unit in units.items():
            check_not_negative(name, getattr(self, name), unit)
        if self.angle_spread is not None and self.numerical_aperture is not None:
            raise ValueError("give `angle_spread` or `numerical_aperture`, not both: each describes the cone")
        if _upper(self.angle_spread) >= 90:
            raise ValueError("`angle_spread` is a half angle: it must be below 90 degrees")
        if self.apodisation is not None and not self.has_cone:
            raise ValueError(
                "`apodisation` is that of a cone of light: give `numerical_aperture` or `angle_spread` too"
            )
        if isinstance(self.stray_light, int | float) and self.stray_light >= 1:
            raise ValueError("`stray_light` is a fraction of the incident light: it must be below 1")

    @property
    def has_cone(self) -> bool:
        """True where the light comes at more than one angle."""
        return self.angle_spread is not None or self.numerical_aperture is not None

    def largest_half_angle(self, ambient: float) -> float:
        """Return the cone's half angle in radians, at the upper bounds, in this ambient index."""
        if self.numerical_aperture is not None:
            return math.asin(min(_upper(self.numerical_aperture) / ambient, 1.0))
        return math.radians(_upper(self.angle_spread))


def _upper(number: Quantity | None) -> float:
    if isinstance(number, Free):
        return number.upper
    return float(number) if isinstance(number, int | float) else 0.0
