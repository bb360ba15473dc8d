"""Special functions of the dispersion models, finite in value and slope at their singular points."""

import math
from typing import Any

import jax.numpy as jnp

from pellicle.optics.pair import custom_jvp, fori_loop, namespace

_STEP = 0.2
_TERMS = 17
_EULER = 0.5772156649015329


def _tiny(x: Any) -> Any:
    # large enough that its inverse, times a few factors, does not overflow
    return 1e12 * jnp.finfo(jnp.result_type(float, x)).tiny


@custom_jvp
def log_abs(x: Any) -> Any:
    """Return ln|x|; at 0 a large negative number with slope zero, for use with a factor that vanishes."""
    return 0.5 * namespace(x).log(x * x + _tiny(x))


@log_abs.defjvp
def _log_abs_slope(primals, tangents):
    (x,), (dx,) = primals, tangents
    # as one quotient: the slope of the logarithm alone would overflow
    return log_abs(x), x / (x * x + _tiny(x)) * dx


@custom_jvp
def dawson(x: Any) -> Any:
    """Return Dawson's integral exp(−x²) ∫₀ˣ exp(t²) dt of a real array, to 4e-16 of its maximum.

    **Source:** G. Rybicki, Computers in Physics 3, 85 (1989), with h = 0.2: the error of the method is
    exp(−(π/2h)²) = 2e-27.

    >>> round(float(dawson(1.0)), 5)
    0.53808
    """
    xp = namespace(x)
    even = 2 * xp.round(x / (2 * _STEP))
    rest = x - even * _STEP
    first = xp.exp(2 * rest * _STEP)
    power, square, total = first, first * first, 0.0
    for i in range(_TERMS):
        odd = 2 * i + 1
        weight = math.exp(-((odd * _STEP) ** 2))
        total = total + weight * (power / (even + odd) + 1 / ((even - odd) * power))
        power = power * square
    return xp.exp(-rest * rest) * total / math.sqrt(math.pi)


@dawson.defjvp
def _dawson_slope(primals, tangents):
    (x,), (dx,) = primals, tangents
    value = dawson(x)
    return value, (1 - 2 * x * value) * dx


def arctan_over_root(u: Any, y: Any, x: Any) -> Any:
    """Return atan2(y √u, x)/√u, smooth in u through zero; for u < 0 it is artanh(y √−u / x)/√−u.

    Requires x > 0 wherever u ≤ 0.
    """
    xp = namespace(u, y, x)
    near = (x > 0) & (xp.abs(u) * y * y < 1e-3 * x * x)
    positive, negative = (u > 0) & ~near, (u < 0) & ~near
    ratio = xp.where(positive, 0.0, y) / xp.where(positive, 1.0, x)
    t = xp.where(near, -u, 0.0) * ratio * ratio
    series = ratio * (1 + t * (1 / 3 + t * (1 / 5 + t * (1 / 7 + t * (1 / 9 + t / 11)))))
    root = xp.sqrt(xp.where(positive, u, 1.0))
    imaginary_root = xp.sqrt(xp.where(negative, -u, 1.0))
    circular = xp.arctan2(y * root, x) / root
    hyperbolic = xp.arctanh(xp.where(negative, imaginary_root * ratio, 0.5)) / imaginary_root
    return xp.where(near, series, xp.where(positive, circular, hyperbolic))


@custom_jvp
def scaled_ei(x: Any) -> Any:
    """Return exp(−x) Ei(x) of a real array, Ei the exponential integral (a principal value for x > 0).

    The relative error is 1e-14 except near the zero of Ei at 0.37. At x = 0, where Ei is −∞, `log_abs`
    takes the place of ln|x|. The power series serves up to 40, a continued fraction below −2, and the
    asymptotic series above 40.

    **Source:** Abramowitz and Stegun 5.1.10, 5.1.22, 5.1.51.

    >>> round(float(scaled_ei(1.0)), 5)
    0.69717
    """
    xp = namespace(x)
    near = (x > -2) & (x < 40)
    inner = xp.where(near, x, 1.0)

    def add(k, state):
        term, total = state
        term = term * inner / k
        return term, total + term / k

    _, series = fori_loop(1, 160, add, (xp.ones_like(inner), xp.zeros_like(inner)))
    middle = xp.exp(-inner) * (_EULER + log_abs(inner) + series)
    y = xp.where(x <= -2, -x, 2.0)

    def divide(i, below):
        k = 80 - i
        return y + 2 * k - 1 - k * k / below

    # 1/(y + 1 − 1/(y + 3 − 4/(y + 5 − ...)))
    left = -1 / fori_loop(0, 80, divide, y + 161)
    z = xp.where(x >= 40, x, 40.0)
    right = xp.zeros_like(z)
    for k in range(24, 0, -1):
        right = (1 + right) * k / z
    return xp.where(near, middle, xp.where(x < 0, left, (1 + right) / z))


@scaled_ei.defjvp
def _scaled_ei_slope(primals, tangents):
    (x,), (dx,) = primals, tangents
    value = scaled_ei(x)
    return value, (x / (x * x + _tiny(x)) - value) * dx
