"""The dispersion formulas of refractiveindex.info, numbers 1 to 9.

Source: M. N. Polyanskiy, "Dispersion formulas", refractiveindex.info (CC0). Its coefficients are
C1, C2, ... with the wavelength λ in µm; here they are `c[0]`, `c[1]`, ... The same database also
writes a "formula A" under the properties of some glasses (Schott's thermal dispersion, dn/dT): that
is a change with temperature, not an index, and is not among these.
"""

from collections.abc import Callable
from typing import Any, final

import equinox as eqx

from pellicle.dispersion.base import AbstractDispersion
from pellicle.optics.pair import namespace

Coefficients = tuple[float, ...]


def _pairs(c: Coefficients):
    """The coefficients after the first, two by two; a missing last one is zero."""
    c = c if len(c) % 2 else (*c, 0.0)
    return zip(c[1::2], c[2::2], strict=True)


def _at(c: Coefficients, size: int) -> Coefficients:
    """Trailing coefficients that a page leaves out are zero."""
    return (*c, *([0.0] * (size - len(c))))


def _power(x: Any, exponent: float):
    """x to a constant power; whole ones by multiplication, exact in value and slope."""
    return x ** int(exponent) if exponent == int(exponent) else x**exponent


def _sqrt(x: Any):
    return namespace(x).sqrt(x)


def _polynomial(x, c: Coefficients):
    """5: n = C1 + Σ C λ^e."""
    return c[0] + sum(a * _power(x, e) for a, e in _pairs(c) if a)


def _sellmeier(x, c: Coefficients):
    """1: n² − 1 = C1 + Σ B λ²/(λ² − C²)."""
    u = x * x
    return _sqrt(1 + c[0] + sum(b * u / (u - r * r) for b, r in _pairs(c)))


def _sellmeier_2(x, c: Coefficients):
    """2: n² − 1 = C1 + Σ B λ²/(λ² − C)."""
    u = x * x
    return _sqrt(1 + c[0] + sum(b * u / (u - r) for b, r in _pairs(c)))


def _polynomial_of_square(x, c: Coefficients):
    """3: n² = C1 + Σ C λ^e."""
    return _sqrt(_polynomial(x, c))


def _refractiveindex_info(x, c: Coefficients):
    """4: n² = C1 + C2 λ^C3/(λ² − C4^C5) + C6 λ^C7/(λ² − C8^C9) + Σ C λ^e."""
    c = _at(c, 9)
    u = x * x
    square = _polynomial(x, (c[0], *c[9:]))
    for b, e, r, f in (c[1:5], c[5:9]):
        if b:
            square = square + b * _power(x, e) / (u - r**f)
    return _sqrt(square)


def _gases(x, c: Coefficients):
    """6: n − 1 = C1 + Σ B/(C − λ⁻²)."""
    inverse = 1 / (x * x)
    return 1 + (c[0] + sum(b / (r - inverse) for b, r in _pairs(c)))


def _herzberger(x, c: Coefficients):
    """7: n = C1 + C2 L + C3 L² + C4 λ² + C5 λ⁴ + C6 λ⁶, L = 1/(λ² − 0.028)."""
    c = _at(c, 6)
    u = x * x
    pole = 1 / (u - 0.028)
    return c[0] + pole * (c[1] + pole * c[2]) + u * (c[3] + u * (c[4] + u * c[5]))


def _retro(x, c: Coefficients):
    """8: (n² − 1)/(n² + 2) = C1 + C2 λ²/(λ² − C3) + C4 λ²."""
    c = _at(c, 4)
    u = x * x
    ratio = c[0] + c[1] * u / (u - c[2]) + c[3] * u
    return _sqrt((1 + 2 * ratio) / (1 - ratio))


def _exotic(x, c: Coefficients):
    """9: n² = C1 + C2/(λ² − C3) + C4 (λ − C5)/((λ − C5)² + C6)."""
    c = _at(c, 6)
    off = x - c[4]
    return _sqrt(c[0] + c[1] / (x * x - c[2]) + c[3] * off / (off * off + c[5]))


_FORMULAS: tuple[Callable[[Any, Coefficients], Any], ...] = (
    *(_sellmeier, _sellmeier_2, _polynomial_of_square, _refractiveindex_info, _polynomial),
    *(_gases, _herzberger, _retro, _exotic),
)


@final
class Formula(AbstractDispersion):
    """Formula `number` (1 to 9) of refractiveindex.info with its coefficients; no absorption.

    The coefficients are published constants, not parameters to fit, so they are static: exponents are
    known when the program is traced. They take λ in µm; `index` takes nm like every dispersion. Where
    n² comes out negative the index is NaN. The formula knows no range: `pellicle.materials` does.
    """

    number: int = eqx.field(static=True)
    coefficients: Coefficients = eqx.field(static=True)

    def __check_init__(self):
        if not 1 <= self.number <= len(_FORMULAS):
            raise ValueError(f"number: expected a formula from 1 to 9, got {self.number}")
        if not self.coefficients:
            raise ValueError("coefficients: expected at least one, got none")

    def index(self, wavelength):
        xp = namespace(wavelength)
        micrometres = xp.asarray(wavelength) * 1e-3
        return xp.broadcast_to(_FORMULAS[self.number - 1](micrometres, self.coefficients), micrometres.shape)
