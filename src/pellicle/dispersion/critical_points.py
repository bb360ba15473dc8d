"""Interband transitions: critical points of semiconductors and metals, excitons, scattered resonances.

Energies are in eV. All are terms of `Oscillators`, Kramers-Kronig consistent unless a docstring excludes it.
"""

import math
from typing import Any, ClassVar, final

from pellicle.dispersion.base import require_positive
from pellicle.dispersion.oscillators import AbstractOscillator, check
from pellicle.optics import pair
from pellicle.optics.complex_functions import digamma, exp, faddeeva, log, power
from pellicle.optics.pair import Number, Pair, conj, imag, namespace, real


@final
class CriticalPoint(AbstractOscillator):
    """ε = A {e^iφ [E0/(E0 − E − iγ)]^mu + e^−iφ [E0/(E0 + E + iγ)]^mu}: a critical point of the joint bands.

    `mu` is 1 for an exciton and ½ for a one-dimensional critical point; mu = 1 is the model of P. Etchegoin,
    E. Le Ru and M. Meyer, J. Chem. Phys. 125, 164705 (2006), for gold. `A` has no unit, `E0` and the
    half width `gamma` are in eV, `phase` φ in degrees. The second part makes it real at E = 0 and
    Kramers-Kronig consistent for mu > 0. With a phase ε₂ can be negative on one side.
    """

    units: ClassVar = {"E0": "eV", "gamma": "eV", "phase": "deg"}
    A: Any
    E0: Any
    gamma: Any
    phase: Any = 0.0
    mu: Any = 1.0

    def __check_init__(self):
        check("critical-point", A=self.A)
        require_positive("critical-point", E0=self.E0, gamma=self.gamma, mu=self.mu)

    def epsilon(self, energy):
        xp = namespace(energy, self.phase)
        turn = self.phase * (math.pi / 180)
        turned = Pair(self.A * xp.cos(turn), self.A * xp.sin(turn))
        z = Pair(energy / self.E0, self.gamma / self.E0)
        near, far = power(1.0 - z, -self.mu), power(1.0 + z, -self.mu)
        return turned * near + conj(turned) * far


@final
class ParabolicBand(AbstractOscillator):
    """ε = A e^iφ [γ/(2E0 − 2E − iγ)]^mu: a critical point between parabolic bands (CPPB).

    The line shape of D. Aspnes, in Handbook on Semiconductors, vol. 2, ed. M. Balkanski (1980), p. 109. No
    source was found for how commercial programs scale their CPPB: here `A` (no unit) is the height of |ε| at
    `E0` and `gamma` the full width, in eV; compare one curve before you copy numbers. `phase` φ is in
    degrees and `mu` is 1 for an exciton, ½, 0 or −½ for one, two or three dimensions (the logarithm of two
    dimensions is `AdachiM1`). Not Kramers-Kronig consistent: it has no part at −E0 and no decay for mu ≤ 0.
    Where the phase makes ε₂ negative, a sum counts it as 0.
    """

    units: ClassVar = {"E0": "eV", "gamma": "eV", "phase": "deg"}
    kramers_kronig: ClassVar = False
    A: Any
    E0: Any
    gamma: Any
    phase: Any = 0.0
    mu: Any = 1.0

    def __check_init__(self):
        check("cppb", A=self.A, E0=self.E0)
        require_positive("cppb", gamma=self.gamma)

    def epsilon(self, energy):
        xp = namespace(energy, self.phase)
        turn = self.phase * (math.pi / 180)
        off = Pair(2 * (self.E0 - energy) / self.gamma, -1.0 + 0.0 * energy)
        return Pair(self.A * xp.cos(turn), self.A * xp.sin(turn)) * power(off, -self.mu)


@final
class AdachiM0(AbstractOscillator):
    """ε = A E0^−1.5 χ⁻² [2 − √(1 + χ) − √(1 − χ)], χ = (E + iγ)/E0: a three-dimensional M₀ critical point.

    The lowest gap E₀, or E₀ + Δ₀, in the model dielectric function of S. Adachi, Phys. Rev. B 35, 7454
    (1987). `A` in eV^1.5, `E0` and `gamma` in eV. Computed as 2/[(1 + R)(2 + S)] with
    R = √(1 − χ²) and S = √(1 + χ) + √(1 − χ), which loses no digits for small χ.
    """

    units: ClassVar = {"A": "eV^1.5", "E0": "eV", "gamma": "eV"}
    A: Any
    E0: Any
    gamma: Any

    def __check_init__(self):
        check("adachi-m0", A=self.A, gamma=self.gamma)
        require_positive("adachi-m0", E0=self.E0)

    def epsilon(self, energy):
        z = Pair(energy / self.E0, self.gamma / self.E0 + 0.0 * energy)
        # the upper half-plane has its root in the first quadrant, and 1 − χ is below the axis
        up, down = pair.sqrt(1.0 + z), conj(pair.sqrt(conj(1.0 - z)))
        return 2.0 * self.A * self.E0**-1.5 / ((1.0 + up * down) * (2.0 + up + down))


@final
class AdachiM1(AbstractOscillator):
    """ε = −A χ⁻² ln(1 − χ²), χ = (E + iγ)/E0: a critical point of two dimensions, the E₁ of semiconductors.

    S. Adachi, Phys. Rev. B 35, 7454 (1987), whose B₁ and E₁ are `A` (no unit) and `E0`; `E0`
    and `gamma` in eV. The harmonic oscillator of his E₂ is `Lorentz` with A = C and gamma = γE₂.
    """

    units: ClassVar = {"E0": "eV", "gamma": "eV"}
    A: Any
    E0: Any
    gamma: Any

    def __check_init__(self):
        check("adachi-m1", A=self.A)
        require_positive("adachi-m1", E0=self.E0, gamma=self.gamma)

    def epsilon(self, energy):
        z = Pair(energy / self.E0, self.gamma / self.E0 + 0.0 * energy)
        return -self.A * (log(1.0 - z) + log(1.0 + z)) / (z * z)


@final
class Tanguy(AbstractOscillator):
    """ε = A √R z⁻² [g(ξ(z)) + g(ξ(−z)) − 2g(ξ(0))], z = E + iγ: Wannier excitons and their continuum.

    ξ(z) = √(R/(Eg − z)) and g(ξ) = 2 ln ξ − 2π cot πξ − 2ψ(ξ) − 1/ξ. C. Tanguy, Phys. Rev. Lett. 75, 4090
    (1995), with the erratum 76, 716 (1996), three dimensions. `A` in eV^1.5, the gap `Eg`, the
    binding energy `R` and the half width `gamma` in eV; the ground state lies at Eg − R.
    """

    units: ClassVar = {"A": "eV^1.5", "Eg": "eV", "R": "eV", "gamma": "eV"}
    A: Any
    Eg: Any
    R: Any
    gamma: Any

    def __check_init__(self):
        check("tanguy", A=self.A)
        require_positive("tanguy", Eg=self.Eg, R=self.R, gamma=self.gamma)

    def epsilon(self, energy):
        z = Pair(energy, self.gamma + 0.0 * energy)
        three = self._g(z) + self._g(-z) - 2.0 * self._g(0.0 * z)
        return three * (self.A * namespace(energy, self.R).sqrt(self.R)) / (z * z)

    def _g(self, z: Number) -> Number:
        below = self.Eg - z
        upper = imag(below) <= 0
        # Re ξ > 0; 1/below is above the axis where `below` is below it
        inverse = self.R / below
        root = pair.sqrt(pair.where(upper, inverse, conj(inverse)))
        turns = exp(Pair(-imag(root), real(root)) * (2 * math.pi))
        cotangent = pair.times_i((1.0 + turns) / (turns - 1.0))
        value = 2.0 * log(root) - 2 * math.pi * cotangent - 2.0 * digamma(root) - 1.0 / root
        return pair.where(upper, value, conj(value))


@final
class BrendelBormann(AbstractOscillator):
    """ε = i√π A/(2√2 a sigma) [w((a − E0)/(√2 sigma)) + w((a + E0)/(√2 sigma))], a² = E² + iγE.

    Lorentz oscillators whose resonances scatter with the standard deviation `sigma` about `E0`; w is the
    Faddeeva function. R. Brendel and D. Bormann, J. Appl. Phys. 71, 1 (1992), as written by A. Rakić et al.,
    Appl. Opt. 37, 5271 (1998): their f ωₚ² is `A`, in eV²; `E0`, `gamma` and `sigma` in eV.
    """

    units: ClassVar = {"A": "eV^2", "E0": "eV", "gamma": "eV", "sigma": "eV"}
    A: Any
    E0: Any
    gamma: Any
    sigma: Any

    def __check_init__(self):
        check("brendel-bormann", A=self.A, E0=self.E0, gamma=self.gamma)
        require_positive("brendel-bormann", sigma=self.sigma)

    def epsilon(self, energy):
        a = pair.sqrt(Pair(energy * energy, self.gamma * energy))
        width = math.sqrt(2) * self.sigma
        both = faddeeva((a - self.E0) * (1 / width)) + faddeeva((a + self.E0) * (1 / width))
        return pair.times_i(both) * (0.5 * math.sqrt(math.pi) * self.A / width) / a
