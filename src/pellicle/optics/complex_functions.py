"""Logarithm, powers, digamma and Faddeeva functions of complex numbers, for dispersion models.

Arguments are real arrays or pairs of them (`pellicle.optics.pair`), and results are pairs.
"""

import math
from functools import cache
from typing import Any

import numpy as np

from pellicle.optics.pair import Number, Pair, abs2, imag, namespace, real

_FADDEEVA_TERMS = 44
_SCALE = math.sqrt(_FADDEEVA_TERMS / math.sqrt(2))


def log(z: Number) -> Pair:
    """Return the principal logarithm."""
    xp = namespace(z)
    return Pair(0.5 * xp.log(abs2(z)), xp.arctan2(imag(z), real(z)))


def exp(z: Number) -> Pair:
    """Return the exponential."""
    xp = namespace(z)
    size = xp.exp(real(z))
    return Pair(size * xp.cos(imag(z)), size * xp.sin(imag(z)))


def power(z: Number, exponent: Any) -> Pair:
    """Return the principal power z^exponent of a real exponent; z must not be 0."""
    return exp(log(z) * exponent)


def digamma(z: Number) -> Number:
    """Return ψ(z) of complex numbers with Re z ≥ 0, to 1e-14.

    **Source:** Abramowitz and Stegun 6.3.5 (recurrence, to Re z ≥ 10) and 6.3.18 (asymptotic series).
    """
    shifted, steps = z, 0.0
    for _ in range(10):
        steps, shifted = steps + 1.0 / shifted, shifted + 1.0
    inverse = 1.0 / shifted
    square = inverse * inverse
    series: Number = square * 0.0
    for coefficient in (-1 / 12, 691 / 32760, -1 / 132, 1 / 240, -1 / 252, 1 / 120, -1 / 12):
        series = (series + coefficient) * square
    return log(shifted) + inverse * (-0.5) + series - steps


@cache
def _faddeeva_coefficients() -> tuple[float, ...]:
    count = 4 * _FADDEEVA_TERMS
    angle = np.arange(1 - count, count) * (math.pi / count)
    t = _SCALE * np.tan(angle / 2)
    samples = np.concatenate([[0.0], np.exp(-t * t) * (_SCALE**2 + t * t)])
    spectrum = np.real(np.fft.fft(np.fft.fftshift(samples))) / (2 * count)
    return tuple(spectrum[1 : _FADDEEVA_TERMS + 1][::-1].tolist())


def faddeeva(z: Number) -> Number:
    """Return w(z) = exp(−z²) erfc(−iz) of complex numbers with Im z ≥ 0, to 2e-14.

    **Source:** J. Weideman, SIAM J. Numer. Anal. 31, 1497 (1994), with 44 terms.
    """
    iz = Pair(-imag(z), real(z))
    inverse = 1.0 / (-iz + _SCALE)
    argument = (iz + _SCALE) * inverse
    first, *rest = _faddeeva_coefficients()
    total: Number = argument * 0.0 + first
    for coefficient in rest:
        total = total * argument + coefficient
    return total * (inverse * inverse) * 2.0 + inverse * (1 / math.sqrt(math.pi))
