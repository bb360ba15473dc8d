"""Parametric semiconductor: critical points as quadratic splines of ε₂, broadened by a Gaussian."""

import math
from typing import Any, ClassVar, final

from pellicle.dispersion.base import bounds_of, require_positive
from pellicle.dispersion.oscillators import AbstractOscillator, check
from pellicle.optics.pair import Pair, namespace
from pellicle.optics.special import dawson, dawson_integral, erfc


@final
class Psemi(AbstractOscillator):
    """ε₂ of one critical point: four parabolas from E0 − WL over E0 to E0 + WR, broadened by a Gaussian.

    Before broadening ε₂ is 0 at both ends, `A` at `E0`, AL·A at the left control point E0 − PL·WL and AR·A
    at the right one E0 + PR·WR; value and slope are continuous at the control points. The outer right piece
    is AR·A·[(1 − OR) u + OR u²], u from 0 at the end to 1 at the control point: a straight line if `OR` is 0.
    So is the left one with `OL`. The construction is that of C. Herzinger and B. Johs, US patent 5 796 983
    (1998), whose broadening σ is fwhm/(4√(2 ln 2)) = 0.2123 `fwhm`. No open source was found for those of
    other programs: their ends may be energies in place of the widths WL and WR, and their second-order terms
    are normalised otherwise. Compare one curve before you copy numbers, and fit `OL` and `OR`.

    `A` has no unit, energies are in eV, PL, PR, AL, AR lie between 0 and 1. ε₁ is the exact Kramers-Kronig
    integral, by the antiderivative of Dawson's integral (J. Vohánka, D. Nečas and D. Franta,
    doi:10.1116/1.5122276). Its sum over the joints cancels: 1e-12 A remain at a distance of 1000 fwhm.
    """

    units: ClassVar = {"E0": "eV", "fwhm": "eV", "WL": "eV", "WR": "eV"}
    A: Any
    E0: Any
    fwhm: Any
    WL: Any
    WR: Any
    PL: Any = 0.5
    PR: Any = 0.5
    AL: Any = 0.5
    AR: Any = 0.5
    OL: Any = 0.0
    OR: Any = 0.0

    def __check_init__(self):
        check("psemi", A=self.A, E0=self.E0, AL=self.AL, AR=self.AR)
        require_positive("psemi", fwhm=self.fwhm, WL=self.WL, WR=self.WR, PL=self.PL, PR=self.PR)
        for name in ("PL", "PR"):
            bounds = bounds_of(getattr(self, name))
            if bounds is not None and not bounds[1] < 1:
                raise ValueError(f"psemi: {name} must be below 1, got {bounds[1]:g}")

    def epsilon(self, energy):
        width = self.fwhm * (0.5 / math.sqrt(math.log(2)))
        joints, slopes, curvatures = self._joints()
        xp = namespace(energy, *joints)
        t = xp.stack([xp.asarray(x) for x in joints])
        linear, square = (xp.stack([xp.asarray(x) for x in row]) * self.A for row in (slopes, curvatures))
        re, im = 0.0, 0.0
        for sign in (1, -1):
            x = (sign * xp.asarray(energy)[..., None] - t) / width
            total, below = dawson_integral(x), xp.exp(-x * x) / (2 * math.sqrt(math.pi))
            half, dip = 0.5 * erfc(-x), dawson(x)
            once = x * total - 0.5 * (x - dip)
            twice = 0.5 * x * x * total + 0.25 * (total + x * dip) - 0.375 * x * x
            re = re - (linear * once * width + square * (2 * twice) * (width * width)).sum(axis=-1)
            ramp, bow = x * half + below, (x * x + 0.5) * half + x * below
            im = im + sign * (linear * ramp * width + square * bow * (width * width)).sum(axis=-1)
        return Pair(re * (2 / math.pi), im)

    def _joints(self) -> tuple[list[Any], list[Any], list[Any]]:
        """The five joints, and the jumps of the slope and of the coefficient of E² there, for A = 1."""
        left, right = (
            self._side(self.WL, self.PL, self.AL, self.OL),
            self._side(self.WR, self.PR, self.AR, self.OR),
        )
        inner, outer = self.E0 - self.PL * self.WL, self.E0 + self.PR * self.WR
        joints = [self.E0 - self.WL, inner, self.E0, outer, self.E0 + self.WR]
        # slopes and curvatures of `_side` are along the distance from E0
        slopes = [-left[0], 0.0, left[1] + right[1], 0.0, -right[0]]
        curvatures = [left[2], left[3] - left[2], right[3] - left[3], right[2] - right[3], -right[2]]
        return joints, slopes, curvatures

    @staticmethod
    def _side(width: Any, place: Any, height: Any, bend: Any) -> tuple[Any, Any, Any, Any]:
        """Slope at the end and at E0, and the coefficients of the outer and of the inner parabola."""
        span, reach = (1 - place) * width, place * width
        end, joint = -height * (1 - bend) / span, -height * (1 + bend) / span
        # through 1 at E0 and `height` at the control point, with the slope `joint` there
        inner = (joint - (height - 1) / reach) / reach
        return end, joint - 2 * inner * reach, height * bend / (span * span), inner
