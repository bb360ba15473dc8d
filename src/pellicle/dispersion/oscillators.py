"""Permittivity as a sum of oscillators: Lorentz, Drude, Gaussian, Tauc-Lorentz, Cody-Lorentz, poles.

Energies are in eV. Each term of this module has ε₂ ≥ 0 and is Kramers-Kronig consistent by itself.
"""

import abc
import math
from typing import Any, ClassVar, final

import equinox as eqx

from pellicle.dispersion.base import HC, AbstractDispersion, bounds_of, require_nonnegative
from pellicle.optics import pair
from pellicle.optics.pair import Pair, namespace
from pellicle.optics.special import arctan_over_root, dawson, log_abs, scaled_ei


class AbstractOscillator(eqx.Module):
    """One term of a permittivity. Subclasses are final; `kramers_kronig` is True where ε₁ belongs to ε₂."""

    units: ClassVar[dict[str, str]] = {}
    kramers_kronig: ClassVar[bool] = True

    @abc.abstractmethod
    def epsilon(self, energy: Any) -> Any:
        """Its share of ε₁ + iε₂, a `Pair`, at photon energy `energy` (eV, any shape)."""


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
    """n + ik = √(eps_inf + Σ terms), Im ≥ 0. Where the terms give ε₂ < 0, as critical points can, ε₂ is 0."""

    kramers_kronig: ClassVar = True
    eps_inf: Any
    terms: tuple[AbstractOscillator, ...]

    def __check_init__(self):
        require_nonnegative("oscillators", eps_inf=self.eps_inf)

    def index(self, wavelength):
        energy = HC / wavelength
        shares = [term.epsilon(energy) for term in self.terms]
        loss = sum(s.im for s in shares)
        loss = namespace(loss).where(loss < 0, 0.0, loss)  # not `maximum`, which halves the slope at 0
        return pair.sqrt(Pair(self.eps_inf + sum(s.re for s in shares), loss))


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
class DrudeSmith(AbstractOscillator):
    """ε = −Ep²/(E² + i gamma E) [1 + c gamma/(gamma − iE)]: free charges that scatter backwards.

    N. Smith, Phys. Rev. B 64, 155106 (2001), with its first term: `c` from −1 (every first collision
    reverses the velocity) to 0 (Drude) has no unit; `Ep` and `gamma` as of `Drude`.
    """

    units: ClassVar = {"Ep": "eV", "gamma": "eV"}
    Ep: Any
    gamma: Any
    c: Any = 0.0

    def __check_init__(self):
        check("drude-smith", Ep=self.Ep, gamma=self.gamma)
        bounds = bounds_of(self.c)
        if bounds is not None and not -1 <= bounds[0] <= bounds[1] <= 0:
            wrong = bounds[0] if bounds[0] < -1 else bounds[1]
            raise ValueError(f"drude-smith: c must lie in -1 to 0, got {wrong:g}")

    def epsilon(self, energy):
        total = energy * energy + self.gamma * self.gamma
        scale, back = self.Ep * self.Ep / total, self.c * self.gamma / total
        free = Pair(-scale, scale * self.gamma / energy)
        return free * Pair(1 + back * self.gamma, back * energy)


@final
class UVPole(AbstractOscillator):
    """ε = A/(E0² − E²): absorption above the spectrum, at `E0` (eV); `A` in eV²."""

    units: ClassVar = {"A": "eV^2", "E0": "eV"}
    A: Any
    E0: Any

    def __check_init__(self):
        check("uv-pole", A=self.A, E0=self.E0)

    def epsilon(self, energy):
        return Pair(self.A / (self.E0 * self.E0 - energy * energy), 0.0 * energy)


@final
class IRPole(AbstractOscillator):
    """ε = −A/E²: absorption below the spectrum; `A` in eV². Programs that add A/E² have the other sign."""

    units: ClassVar = {"A": "eV^2"}
    A: Any

    def __check_init__(self):
        check("ir-pole", A=self.A)

    def epsilon(self, energy):
        return Pair(-self.A / (energy * energy), 0.0 * energy)


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
        third = 4 * E0 * Eg * (square - gamma2)
        third *= arctan_over_root(alpha2, 2 * C, 2 * (width + 2 * (gap - centre)))
        # both logarithms of |E − Eg| under the factor (E − Eg)² that they have together
        edge = (E + Eg) ** 2 * xp.log(E + Eg) - (E - Eg) ** 2 * log_abs(E - Eg)
        at_gap = xp.log((centre - gap) ** 2 + gap * width)
        return first + second + third + E0 * C * (edge / E - Eg * at_gap)


@final
class CodyLorentz(AbstractOscillator):
    """ε₂ = G L above T = Eg + Et, and (T/E) G(T) L(T) exp((E − T)/Eu) below; all seven in eV.

    G = (E − Eg)²/((E − Eg)² + Ep²) and L = A E0 C E/[(E² − E0²)² + C²E²]. A. S. Ferlauto et al.,
    J. Appl. Phys. 92, 2424 (2002), eqs. 1-4. `Et` is counted from the gap, as the field's programs
    do; the paper's own E_t is Eg + Et. With `Et` = 0 there is no tail.

    ε₁ is the exact Kramers-Kronig integral: the part above T by partial fractions written in reals,
    smooth through critical damping, the tail by exponential integrals. Where Et > 0, ε₂ has a
    kink at T, so the true ∂ε₁/∂E diverges logarithmically there; what is returned is finite. The
    partial fractions lose their digits where Eg + iEp meets L's pole α/2 + iC/2.
    """

    units: ClassVar = dict.fromkeys(("A", "E0", "C", "Eg", "Ep", "Et", "Eu"), "eV")
    A: Any
    E0: Any
    C: Any
    Eg: Any
    Ep: Any
    Et: Any = 0.0
    Eu: Any = 0.05

    def __check_init__(self):
        check("cody-lorentz", gap=self.Eg, centre=self.E0, A=self.A, C=self.C, Eg=self.Eg, Et=self.Et)
        for name in ("Ep", "Eu"):
            bounds = bounds_of(getattr(self, name))
            if bounds is not None and not bounds[0] > 0:
                raise ValueError(f"cody-lorentz: {name} must be positive, got {bounds[0]:g} eV")

    def epsilon(self, energy):
        onset = self.Eg + self.Et
        xp = namespace(energy, onset)
        above = xp.maximum(energy, onset)
        tail = self._product(onset) * onset
        below = tail / energy * xp.exp(xp.minimum(energy - onset, 0.0) / self.Eu)
        im = xp.where(energy > onset, self._product(above), below)
        re = 2 / math.pi * self.A * self.E0 * self.C * self._rational(energy, onset)
        return Pair(re + tail / (math.pi * energy) * self._tail(energy, onset), im)

    def _lorentz(self, energy):
        """[(E² − E0²)² + C²E²]."""
        return (energy * energy - self.E0 * self.E0) ** 2 + (self.C * energy) ** 2

    def _share(self, energy):
        """E² (E − Eg)²/{[(E − Eg)² + Ep²] [(E² − E0²)² + C²E²]}."""
        off = (energy - self.Eg) ** 2
        return energy * energy * off / ((off + self.Ep * self.Ep) * self._lorentz(energy))

    def _product(self, energy):
        """G L at `energy` > 0, and its limit at 0."""
        off = (energy - self.Eg) ** 2
        return self.A * self.E0 * self.C * energy * off / ((off + self.Ep * self.Ep) * self._lorentz(energy))

    def _rational(self, E, T):
        """P∫ from T to ∞ of ξ² (ξ − Eg)²/{[(ξ − Eg)² + Ep²] [(ξ² − E0²)² + C²ξ²] (ξ² − E²)} dξ.

        = ∫ (aξ + b)/[(ξ − Eg)² + Ep²] + (qξ + r)/(ξ² − E²) + (p₃ξ³ + ... + p₀)/[(ξ² − E0²)² + C²ξ²].
        """
        E0, C, Eg, Ep, square = self.E0, self.C, self.Eg, self.Ep, E * E
        xp = namespace(E, T)
        centre, alpha2, gamma2 = E0 * E0, 4 * E0 * E0 - C * C, E0 * E0 - 0.5 * C * C
        v = self._at_gap_pole(square)
        a, b = -Ep * v.im, -Ep * Ep * v.re + Ep * v.im * Eg
        up, down = self._share(E), self._share(-E)
        q, r = (up - down) / (2 * E), 0.5 * (up + down)
        p3, p2, p1, p0 = self._remainder(square, a, b, q, r)

        gap_part = -0.5 * a * xp.log((T - Eg) ** 2 + Ep * Ep) - Ep * v.re * xp.arctan2(Ep, T - Eg)
        # the same ln|T − E| as the tail's, so that both cancel at E = T
        edge = log_abs((T - E) / self.Eu) + xp.log(self.Eu)
        edge_part = -0.5 / E * (up * edge - down * xp.log(T + E))
        odd = arctan_over_root(alpha2, 0.5 * C, T * T - gamma2) / C
        even = 0.5 * (p2 + p0 / centre) * xp.arctan2(C * T, T * T - centre) / C
        even += 0.5 * (p2 - p0 / centre) * arctan_over_root(-alpha2, T, T * T + centre)
        return gap_part + edge_part - 0.25 * p3 * xp.log(self._lorentz(T)) + (p1 + gamma2 * p3) * odd + even

    def _at_gap_pole(self, square):
        """c²/{[(c² − E0²)² + C²c²] (c² − E²)} at c = Eg + iEp."""
        pole = Pair(self.Eg, self.Ep)
        c2 = pole * pole
        off = c2 - self.E0 * self.E0
        return c2 / ((off * off + c2 * (self.C * self.C)) * (c2 - square))

    def _remainder(self, square, a, b, q, r):
        """p₃ ... p₀ by polynomial division: what the other two fractions leave over."""
        d2 = self.C * self.C - 2 * self.E0 * self.E0
        g1, g0 = -2 * self.Eg, self.Eg * self.Eg + self.Ep * self.Ep
        # the divisor [(ξ − Eg)² + Ep²] (ξ² − E²) = ξ⁴ + c₃ξ³ + c₂ξ² + ..., and the dividend's upper half
        c3, c2, c1 = g1, g0 - square, -square * g1
        n7 = -a - q
        n6 = -b - r - q * g1
        n5 = -a * (d2 - square) - q * (d2 + g0) - r * g1
        n4 = 1 - b * (d2 - square) - r * (d2 + g0) - q * g1 * d2
        p3 = n7
        p2 = n6 - c3 * p3
        p1 = n5 - c3 * p2 - c2 * p3
        return p3, p2, p1, n4 - c3 * p1 - c2 * p2 - c1 * p3

    def _tail(self, E, T):
        """P∫ from 0 to T of exp((ξ − T)/Eu) [1/(ξ − E) − 1/(ξ + E)] dξ."""
        y, start = E / self.Eu, namespace(E, T).exp(-T / self.Eu)
        forward = scaled_ei((T - E) / self.Eu) - start * scaled_ei(-y)
        return forward - scaled_ei((T + E) / self.Eu) + start * scaled_ei(y)
