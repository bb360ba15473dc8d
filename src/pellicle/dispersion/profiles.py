"""Profiles of a graded layer: volume fraction of its second medium against relative depth.

The relative depth z is 0 at the upper face of the layer and 1 at its lower face. Every profile stays within
0 to 1, and each of its numbers may be a `pellicle.Free`.
"""

import abc
import itertools
from typing import Any, final

import equinox as eqx
import numpy as np

from pellicle.dispersion.base import bounds_of
from pellicle.dispersion.spline import b_splines, greville_knots
from pellicle.optics.pair import namespace


class AbstractProfile(eqx.Module):
    """Fraction of the second medium as a function of relative depth. Subclasses are final."""

    @abc.abstractmethod
    def fraction(self, depth: np.ndarray) -> Any:
        """Fraction at relative depths 0 to 1, an array of any shape."""

    @property
    def variations(self) -> float:
        """About how often the fraction rises or falls over the layer; the slices resolve at least this."""
        return 1.0


def _check_fractions(model: str, **fractions: Any) -> None:
    for name, number in fractions.items():
        bounds = bounds_of(number)
        if bounds is not None and not 0 <= bounds[0] <= bounds[1] <= 1:
            wrong = bounds[0] if not 0 <= bounds[0] <= 1 else bounds[1]
            raise ValueError(f"{model}: `{name}` is a volume fraction, 0 to 1, got {wrong:g}")


@final
class Linear(AbstractProfile):
    """f = top + (bottom − top) z: from `top` at the upper face to `bottom` at the lower one."""

    top: Any = 0.0
    bottom: Any = 1.0

    def __check_init__(self):
        _check_fractions("linear", top=self.top, bottom=self.bottom)

    def fraction(self, depth):
        return self.top + (self.bottom - self.top) * depth


@final
class Exponential(AbstractProfile):
    """f = top + (bottom − top)(1 − e^(−z/L))/(1 − e^(−1/L)), with the decay length L in layer thicknesses.

    It has `top` and `bottom` at the faces for every `length`, so that it becomes linear where L is large. A
    positive L decays downwards, as a dopant that diffuses in from above; a negative one upwards, from the
    lower face.
    """

    top: Any = 0.0
    bottom: Any = 1.0
    length: Any = 0.3

    def __check_init__(self):
        _check_fractions("exponential", top=self.top, bottom=self.bottom)
        bounds = bounds_of(self.length)
        if bounds is not None and (bounds[0] * bounds[1] <= 0 or min(map(abs, bounds)) < SHORTEST):
            raise ValueError(
                f"exponential: `length`, in layer thicknesses, must stay above {SHORTEST:g}, or below"
                f" {-SHORTEST:g} for a decay upwards, got {bounds[0]:g} to {bounds[1]:g}"
            )

    def fraction(self, depth):
        xp = namespace(depth, self.length)
        down, length = xp.asarray(self.length) > 0, xp.abs(xp.asarray(self.length))
        share = xp.expm1(-xp.where(down, depth, 1 - depth) / length) / xp.expm1(-1.0 / length)
        return self.top + (self.bottom - self.top) * xp.where(down, share, 1 - share)


SHORTEST = 0.005
"""Least decay length, in layer thicknesses: what is shorter is an interface."""


@final
class Power(AbstractProfile):
    """f = top + (bottom − top) z^p with the exponent p > 0; 1 is linear, 2 parabolic."""

    top: Any = 0.0
    bottom: Any = 1.0
    exponent: Any = 1.0

    def __check_init__(self):
        _check_fractions("power", top=self.top, bottom=self.bottom)
        bounds = bounds_of(self.exponent)
        if bounds is not None and bounds[0] <= 0:
            raise ValueError(f"power: `exponent` must be above 0, got {bounds[0]:g}")

    def fraction(self, depth):
        xp = namespace(depth, self.exponent)
        inside = xp.asarray(depth) > 0  # 0^p has no slope in p
        power = xp.where(inside, xp.where(inside, depth, 1.0) ** self.exponent, 0.0)
        return self.top + (self.bottom - self.top) * power


@final
class Spline(AbstractProfile):
    """Free form: a cubic B-spline with coefficients `values`, m ≥ 2 fractions from the upper face down.

    It meets the first and the last value, passes near the others and stays between the least and the
    largest; values that rise or fall give a profile that does (de Boor, A Practical Guide to Splines, 2001,
    chapters IX and XI). Its pieces have equal thickness, and values on a line at the depths `sites` give that
    line. `knots`, m relative depths from 0 to 1 (fixed), place the values elsewhere, about.
    """

    values: tuple[Any, ...] = eqx.field(converter=tuple)
    knots: tuple[float, ...] | None = eqx.field(
        static=True, default=None, converter=lambda x: None if x is None else tuple(map(float, x))
    )

    def __check_init__(self):
        count, knots = len(self.values), self.knots
        if count < 2:
            raise ValueError(f"spline: `values` must be two or more fractions, got {count}")
        _check_fractions("spline", **{f"values[{i}]": x for i, x in enumerate(self.values)})
        if knots is None:
            return
        if len(knots) != count:
            raise ValueError(f"spline: `values` needs one fraction a knot, {len(knots)}, got {count}")
        rising = all(a < b for a, b in itertools.pairwise(knots))
        if not rising or knots[0] != 0 or knots[-1] != 1:
            raise ValueError(f"spline: `knots` must rise from 0 to 1, got {list(knots)}")

    def _basis_knots(self) -> tuple[np.ndarray, int]:
        if self.knots is not None:
            return greville_knots(self.knots)
        degree = min(3, len(self.values) - 1)
        inner = np.linspace(0.0, 1.0, len(self.values) - degree + 1)
        return np.concatenate([np.zeros(degree), inner, np.ones(degree)]), degree

    @property
    def sites(self) -> np.ndarray:
        """Relative depth to which each value belongs, (m,)."""
        knots, degree = self._basis_knots()
        return np.array([knots[i + 1 : i + 1 + degree].mean() for i in range(len(self.values))])

    @property
    def variations(self) -> float:
        return float(len(self.values) - 1)

    def fraction(self, depth):
        basis = b_splines(depth, *self._basis_knots())
        return sum(basis[..., i] * value for i, value in enumerate(self.values))


@final
class Sine(AbstractProfile):
    """f = mean + amplitude sin(2π (periods z + phase)): a rugate filter; `phase` in periods."""

    mean: Any = 0.5
    amplitude: Any = 0.5
    periods: Any = 10.0
    phase: Any = 0.0

    def __check_init__(self):
        _check_fractions("sine", mean=self.mean)
        mean, amplitude, periods = map(bounds_of, (self.mean, self.amplitude, self.periods))
        if mean is not None and amplitude is not None:
            swing = max(map(abs, amplitude))
            if mean[0] - swing < -1e-12 or mean[1] + swing > 1 + 1e-12:
                raise ValueError(
                    f"sine: mean ± amplitude must stay within 0 to 1, got {mean[0] - swing:g} to"
                    f" {mean[1] + swing:g}"
                )
        if periods is not None and periods[0] < 0:
            raise ValueError(f"sine: `periods` must not be negative, got {periods[0]:g}")

    @property
    def variations(self) -> float:
        bounds = bounds_of(self.periods)
        return 1.0 if bounds is None else max(2 * bounds[1], 1.0)

    def fraction(self, depth):
        xp = namespace(depth, self.periods, self.phase)
        return self.mean + self.amplitude * xp.sin(2 * np.pi * (self.periods * depth + self.phase))


PROFILES: dict[str, Any] = {
    "linear": Linear,
    "exponential": Exponential,
    "power": Power,
    "spline": Spline,
    "sine": Sine,
}
"""Profiles by name."""
