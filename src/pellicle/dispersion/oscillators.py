"""Permittivity as a sum of oscillators: Lorentz, Drude, Gaussian, Tauc-Lorentz, Cody-Lorentz.

Energies are in eV. Each term has ε₂ ≥ 0 and is Kramers-Kronig consistent by itself.
"""

from __future__ import annotations

import abc
import math
from typing import Any, ClassVar, final

import equinox as eqx

from pellicle.dispersion.base import HC, AbstractDispersion, bounds_of, require_nonnegative
from pellicle.optics import pair
from pellicle.optics.array_namespace import namespace
from pellicle.optics.pair import Pair
from pellicle.optics.special import arctan_over_root, dawson, log_abs


class AbstractOscillator(eqx.Module):
    """One term of a permittivity. Subclasses are final."""

    units: ClassVar[dict[str, str]] = {}

    @abc.abstractmethod
    def epsilon(self, energy: Any) -> Pair:
        """Its share of ε₁ + iε₂ at photon energy `energy` (eV, any shape)."""


def check(model: str, *, gap: Any = None, centre: Any = None, **not_below_zero: Any) -> None:
    """ValueError where a parameter may fall below zero, or the gap lies wholly above the resonance."""
    require_nonnegative(model, **not_below_zero)
    low, high = bounds_of(gap), bounds_of(centre)
    if low is not None and high is not None and low[0] >= high[1]:
        raise ValueError(
            f"{model}: the gap Eg must lie below the resonance E0, got Eg {low[0]:g} and E0 {high[1]:g} eV"
        )


@final
class Oscillators(AbstractDispersion):
    """n + ik = √(eps_inf + Σ terms), Im ≥ 0."""

    eps_inf: Any
    terms: tuple[AbstractOscillator, ...]

    def __check_init__(self):
        require_nonnegative("oscillators", eps_inf=self.eps_inf)

    def index(self, wavelength):
        energy = HC / wavelength
        shares = [term.epsilon(energy) for term in self.terms]
        return pair.sqrt(Pair(self.eps_inf + sum(s.re for s in shares), sum(s.im for s in shares)))


@final
class Lorentz(AbstractOscillator):
    """ε = A E0²/(E0² − E² − i gamma E): a bound charge (H. A. Lorentz).

    `A` is the term's share of the static permittivity (no unit), `E0` its resonance and `gamma` its
    full width at half maximum of ε₂, both in eV. Born and Wolf, Principles of Optics, section 2.3.4.
    """

    units: ClassVar = {"E0": "eV", "gamma": "eV"}
    A: Any
    E0: Any
    gamma: Any

    def __check_init__(self):
        check("lorentz", A=self.A, E0=self.E0, gamma=self.gamma)

    def epsilon(self, energy):
        square = self.E0 * self.E0
        off, loss = square - energy * energy, self.gamma * energy
        scale = self.A * square / (off * off + loss * loss)
        return Pair(scale * off, scale * loss)


@final
class Drude(AbstractOscillator):
    """ε = −Ep²/(E² + i gamma E): free charges (P. Drude, Ann. Phys. 306, 566 (1900)).

    `Ep` is the unscreened plasma energy ħω_p and `gamma` the damping ħ/τ, in eV.
    """

    units: ClassVar = {"Ep": "eV", "gamma": "eV"}
    Ep: Any
    gamma: Any

    def __check_init__(self):
        check("drude", Ep=self.Ep, gamma=self.gamma)

    def epsilon(self, energy):
        scale = self.Ep * self.Ep / (energy * energy + self.gamma * self.gamma)
        return Pair(-scale, scale * self.gamma / energy)


@final
class Gaussian(AbstractOscillator):
    """ε₂ = A {exp[−((E − E0)/σ)²] − exp[−((E + E0)/σ)²]}, σ = fwhm/(2√ln 2).

    ε₁ = (2A/√π) [F((E + E0)/σ) − F((E − E0)/σ)] with Dawson's integral F. D. De Sousa Meneses et al.,
    J. Non-Cryst. Solids 352, 769 (2006), eqs. 2-4. `A` is the height of ε₂ (no unit); `E0` and `fwhm`
    are in eV.
    """

    units: ClassVar = {"E0": "eV", "fwhm": "eV"}
    A: Any
    E0: Any
    fwhm: Any

    def __check_init__(self):
        check("gaussian", A=self.A, E0=self.E0, fwhm=self.fwhm)

    def epsilon(self, energy):
        width = self.fwhm * (0.5 / math.sqrt(math.log(2)))
        x, y = (energy - self.E0) / width, (energy + self.E0) / width
        re = self.A * (2 / math.sqrt(math.pi)) * (dawson(y) - dawson(x))
        # the difference of the two, which keeps its sign where both are nearly equal
        xp = namespace(x)
        return Pair(re, -self.A * xp.exp(-x * x) * xp.expm1(x * x - y * y))


@final
class TaucLorentz(AbstractOscillator):
    """ε₂ = A E0 C (E − Eg)²/{[(E² − E0²)² + C²E²] E} above the gap Eg, 0 below; A, E0, C, Eg in eV.

    G. E. Jellison and F. A. Modine, Appl. Phys. Lett. 69, 371 (1996), eqs. 5 and 6, ε₁ with the
    erratum 69, 2137 (1996): its arctangents are brought together here, so that ε₁ is smooth
    through E = Eg, E = E0 and the critical damping C = 2 E0, where the printed form divides by
    α = √(4E0² − C²) = 0. Finite for Eg above E0 too, which a search may pass through.
    """

    units: ClassVar = {"A": "eV", "E0": "eV", "C": "eV", "Eg": "eV"}
    A: Any
    E0: Any
    C: Any
    Eg: Any

    def __check_init__(self):
        check("tauc-lorentz", gap=self.Eg, centre=self.E0, A=self.A, E0=self.E0, C=self.C, Eg=self.Eg)

    def epsilon(self, energy):
        E, A, E0, C, Eg = energy, self.A, self.E0, self.C, self.Eg
        centre, gap, width, square = E0 * E0, Eg * Eg, C * C, E * E
        zeta4 = (square - centre) ** 2 + width * square
        above = namespace(E - Eg).maximum(E - Eg, 0.0)
        im = A * E0 * C * above * above / (zeta4 * E)
        return Pair(A / (math.pi * zeta4) * self._bracket(E, centre, gap, width, square), im)

    def _bracket(self, E, centre, gap, width, square):
        """π ζ⁴ ε₁/A, term by term in the order of eq. 6."""
        E0, C, Eg = self.E0, self.C, self.Eg
        xp = namespace(E, centre, gap, width)
        alpha2, gamma2 = 4 * centre - width, centre - 0.5 * width
        a_ln = (gap - centre) * square + gap * width - centre * (centre + 3 * gap)
        a_atan = (square - centre) * (centre + gap) + gap * width
        # ln[(E0² + Eg² + αEg)/(E0² + Eg² − αEg)] = 2 artanh(αEg/(E0² + Eg²))
        first = C * a_ln / E0 * arctan_over_root(-alpha2, Eg, centre + gap)
        # π − atan[(α + 2Eg)/C] + atan[(α − 2Eg)/C] holds no α
        second = -a_atan / E0 * xp.arctan2(Eg * C, gap - centre)
        third = (
            4
            * E0
            * Eg
            * (square - gamma2)
            * arctan_over_root(alpha2, 2 * C, 2 * (width + 2 * (gap - centre)))
        )
        # both logarithms of |E − Eg| under the factor (E − Eg)² that they have together
        edge = (E + Eg) ** 2 * xp.log(E + Eg) - (E - Eg) ** 2 * log_abs(E - Eg)
        at_gap = xp.log((centre - gap) ** 2 + gap * width)
        return first + second + third + E0 * C * (edge / E - Eg * at_gap)
