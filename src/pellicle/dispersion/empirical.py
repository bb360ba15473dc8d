"""Refractive index n + ik against wavelength (nm), each model a small pytree of its parameters.

A dispersion answers `index(wavelength)` with a real array where it cannot absorb and a `Pair`
where it can: that type is what tells the rest of the code whether there is absorption to compute.
"""

from typing import Any, ClassVar, final

import numpy as np

from pellicle.dispersion.base import HC, AbstractDispersion, bounds_of, cast_like, require_nonnegative
from pellicle.optics.pair import Number, Pair, imag, is_real, namespace, real


@final
class Constant(AbstractDispersion):
    """Index that is constant in wavelength; `k=None` means that the medium cannot absorb."""

    n: Any
    k: Any = None

    def index(self, wavelength):
        one = namespace(wavelength).ones_like(wavelength)
        return self.n * one if self.k is None else Pair(self.n * one, self.k * one)


@final
class Table(AbstractDispersion):
    """Linear interpolation between measured points; NaN outside them, never an extrapolation.

    `wavelength` (nm) rises strictly; `n` and `k` have its length, and `k=None` says that the
    source gives no extinction.
    """

    wavelength: Any
    n: Any
    k: Any = None

    def index(self, wavelength):
        def column(values):
            known, values = cast_like(self.wavelength, wavelength), cast_like(values, wavelength)
            interp = namespace(wavelength, known, values).interp
            return interp(wavelength, known, values, left=np.nan, right=np.nan)

        return column(self.n) if self.k is None else Pair(column(self.n), column(self.k))


def along_the_spectrum(number: Any, wavelengths: Any) -> Any:
    """Return a number as it is, and one for each channel as a table.

    It is linear between the wavelengths (nm) of the channels and constant beyond.
    """
    if np.ndim(number) == 0:
        return number
    order = np.argsort(wavelengths)
    nm, values = np.asarray(wavelengths, float)[order], np.asarray(number, float)[order]
    return Table(np.array([1.0, *nm, 1e5]), np.array([values[0], *values, values[-1]]))


@final
class Cauchy(AbstractDispersion):
    """n = A + B/λ² + C/λ⁴ with λ in nm, B in nm² and C in nm⁴ (A. Cauchy, 1836); no absorption."""

    units: ClassVar = {"B": "nm^2", "C": "nm^4"}
    A: Any
    B: Any = 0.0
    C: Any = 0.0

    def index(self, wavelength):
        u = 1 / (wavelength * wavelength)
        return self.A + u * (self.B + u * self.C)


@final
class CauchyUrbach(AbstractDispersion):
    """Cauchy's n = A + B/λ² + C/λ⁴ with an absorption edge k = k0 exp((E − Eb)/Eu).

    λ in nm, B in nm², C in nm⁴; E = hc/λ, Eb and Eu in eV: k is `k0` at the photon energy `Eb`
    and grows by e with every `Eu` (F. Urbach, Phys. Rev. 92, 1324 (1953)). `Eb` only says where
    `k0` is meant: fix it. Not Kramers-Kronig consistent. Elsewhere the exponent is written
    β·12400(1/λ − 1/γ) with λ and γ in Å: β = 1/Eu and 12400/γ = Eb.
    """

    units: ClassVar = {"B": "nm^2", "C": "nm^4", "Eu": "eV", "Eb": "eV"}
    A: Any
    B: Any = 0.0
    C: Any = 0.0
    k0: Any = 0.01
    Eu: Any = 0.5
    Eb: Any = 3.1

    def __check_init__(self):
        require_nonnegative("cauchy-urbach", k0=self.k0)
        bounds = bounds_of(self.Eu)
        if bounds is not None and not bounds[0] > 0:
            raise ValueError(f"cauchy-urbach: the Urbach energy Eu must be positive, got {bounds[0]:g} eV")

    def index(self, wavelength):
        u = 1 / (wavelength * wavelength)
        exponent = (HC / wavelength - self.Eb) / self.Eu
        edge = self.k0 * namespace(exponent).exp(exponent)
        return Pair(self.A + u * (self.B + u * self.C), edge)


@final
class Sellmeier(AbstractDispersion):
    """n² = 1 + Σ Bᵢ λ²/(λ² − Cᵢ) with λ in nm and Cᵢ in nm² (W. Sellmeier, 1871); no absorption.

    `B` and `C` are tuples of the same length. Between the resonances √Cᵢ the formula has poles;
    a negative n² gives NaN.
    """

    units: ClassVar = {"C": "nm^2"}
    B: tuple[Any, ...]
    C: tuple[Any, ...]

    def index(self, wavelength):
        square = wavelength * wavelength
        n2 = 1 + sum(b * square / (square - c) for b, c in zip(self.B, self.C, strict=True))
        return namespace(n2).sqrt(n2)


@final
class WithExtinction(AbstractDispersion):
    """The real index of one model with the extinction coefficient of another (its imaginary part)."""

    base: AbstractDispersion
    extinction: AbstractDispersion

    def index(self, wavelength):
        return Pair(real(self.base.index(wavelength)), imag(self.extinction.index(wavelength)))


@final
class Shifted(AbstractDispersion):
    """A known dispersion plus a constant: what is fitted when a table is nearly right.

    `n` and `k` are added; None adds nothing.
    """

    base: AbstractDispersion
    n: Any = None
    k: Any = None

    def index(self, wavelength):
        known = self.base.index(wavelength)
        n = real(known) if self.n is None else real(known) + self.n
        if self.k is None and is_real(known):
            return n
        return Pair(n, imag(known) if self.k is None else imag(known) + self.k)


@final
class Scaled(AbstractDispersion):
    """A dispersion times 1 + `change`·`shape`, with `shape` one number or one for each wavelength."""

    base: AbstractDispersion
    change: Any
    shape: Any = 1.0

    def index(self, wavelength):
        return self.base.index(wavelength) * (1 + self.change * self.shape)


@final
class Tabulated(AbstractDispersion):
    """Index and slope (1/nm) of another dispersion at the wavelengths of a measurement.

    A fit replaces every medium without free parameters by this before it starts. The first-order expansion
    is exact at these wavelengths, and has the derivative in wavelength that the group index needs;
    `slope=None` where nothing needs it.
    """

    wavelength: Any
    value: Number
    slope: Number | None

    def index(self, wavelength):
        if self.slope is None:
            return self.value
        return self.value + self.slope * (wavelength - self.wavelength)
