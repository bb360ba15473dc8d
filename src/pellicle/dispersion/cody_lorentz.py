"""The Cody-Lorentz oscillator with an Urbach tail."""

from __future__ import annotations

import math
from typing import Any, ClassVar, final

from pellicle.dispersion.base import bounds_of
from pellicle.dispersion.oscillators import AbstractOscillator, check
from pellicle.optics.array_namespace import namespace
from pellicle.optics.pair import Pair
from pellicle.optics.special import arctan_over_root, log_abs, scaled_ei


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
            found = bounds_of(getattr(self, name))
            if found is not None and not found[0] > 0:
                raise ValueError(f"cody-lorentz: {name} must be positive, got {found[0]:g} eV")

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
