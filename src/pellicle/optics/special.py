"""Elementary and special functions: faster than the library's, or finite where its slopes are not.

Sine, cosine and exponentials by polynomials, in which a film spends most of its time; functions of the
dispersion models, finite in value and slope at their singular points.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.pair import custom_jvp, fori_loop, namespace

_QUARTER = (1.5707963267341256, 6.0771005063039007e-11, 2.0222662487959506e-21)
_QUARTER_32 = (1.5703125, 4.837512969970703125e-4, 7.54978995489188216e-8)
"""π/2 in pieces, the first so short that its products are exact (Cody and Waite)."""

_ODD = (
    1.58969099521155010221e-10,
    -2.50507602534068634195e-08,
    2.75573137070700676789e-06,
    -1.98412698298579493134e-04,
    8.33333333332248946124e-03,
    -1.66666666666666324348e-01,
)
_EVEN = (
    -1.13596475577881948265e-11,
    2.08757232129817482790e-09,
    -2.75573143513906633035e-07,
    2.48015872894767294178e-05,
    -1.38888888888741095749e-03,
    4.16666666666666019037e-02,
)
_ODD_32 = (-1.9515295891e-4, 8.3321608736e-3, -1.6666654611e-1)
_EVEN_32 = (2.443315711809948e-5, -1.388731625493765e-3, 4.166664568298827e-2)


def sincos(x: Any) -> tuple[Any, Any]:
    """Return sine and cosine of a real array (radians), without branches and in one pass.

    Cody-Waite reduction and a polynomial. Worst error up to 1e5 rad: 2.0e-16 in float64, 9.1e-8 in
    float32.

    **Source:** coefficients of Cephes (S. Moshier), sin.c and sinf.c.
    """
    if namespace(x) is np:
        return np.sin(x), np.cos(x)
    number = x.dtype.type
    quarter, r = _reduce_argument(x)
    z = r * r
    odd, even = (_ODD, _EVEN) if x.dtype == jnp.float64 else (_ODD_32, _EVEN_32)
    s, c = number(odd[0]), number(even[0])
    for a, b in zip(odd[1:], even[1:], strict=True):
        s, c = s * z + number(a), c * z + number(b)
    s, c = r + r * z * s, 1 - 0.5 * z + z * z * c
    quadrant = quarter - 4 * jnp.floor(quarter * 0.25)
    swap = (quadrant == 1) | (quadrant == 3)
    sine, cosine = jnp.where(swap, c, s), jnp.where(swap, s, c)
    return (
        jnp.where(quadrant >= 2, -sine, sine),
        jnp.where((quadrant == 1) | (quadrant == 2), -cosine, cosine),
    )


def sincos_squares(x: Any) -> tuple[Any, Any]:
    """Return sin² and cos² of a real array (radians), for half the work of `sincos`.

    With the reduced argument |r| ≤ π/4, sin² r = Σ (−1)ⁿ⁺¹ 2²ⁿ⁻¹ r²ⁿ/(2n)!, and cos² r = 1 − sin² r
    loses no digits, for it is at least ½. Of the number of quarter turns only the parity counts.
    """
    if namespace(x) is np:
        return np.sin(x) ** 2, np.cos(x) ** 2
    quarter, r = _reduce_argument(x)
    z = r * r
    terms = 10 if x.dtype == jnp.float64 else 6
    coefficients = [(-1) ** (n + 1) * 2 ** (2 * n - 1) / math.factorial(2 * n) for n in range(2, terms + 1)]
    series = x.dtype.type(coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        series = series * z + x.dtype.type(coefficient)
    small = z + z * z * series
    odd = quarter - 2 * jnp.floor(quarter * 0.5) == 1
    return jnp.where(odd, 1 - small, small), jnp.where(odd, small, 1 - small)


def _reduce_argument(x: Any) -> tuple[Any, Any]:
    """Return the number of quarter turns nearest to x, and the rest of x."""
    number = x.dtype.type
    quarter = jnp.round(x * number(2 / math.pi))
    r = x
    for piece in _QUARTER if x.dtype == jnp.float64 else _QUARTER_32:
        r = r - quarter * number(piece)
    return quarter, r


def exp_and_expm1(x: Any) -> tuple[Any, Any]:
    """Return exp(x) and expm1(x) of a real array x ≤ 0, to full precision, at the cost of one.

    eˣ = 2ⁿ eʳ with |r| ≤ ½ ln 2, and eʳ by its series. Relative errors are below 2e-16 in float64 and
    1.2e-7 in float32, larger only next to underflow, where eˣ is 1e-290 (1e-30) or less. The power of two
    is written into the exponent's bits and has no derivative of its own.
    """
    if namespace(x) is np:
        return np.exp(x), np.expm1(x)
    double = x.dtype == jnp.float64
    number, whole = x.dtype.type, jnp.int64 if double else jnp.int32
    bias, bits, terms = (1023, 52, 13) if double else (127, 23, 7)
    log2 = (0.693145751953125, 1.42860682030941723212e-6) if double else (0.693359375, -2.12194440e-4)
    n = jnp.round(x * number(1.4426950408889634))
    r = x - n * number(log2[0]) - n * number(log2[1])
    square = r * r  # even and odd terms apart: two short chains in place of a long one
    even, odd = number(1 / math.factorial(terms - 1)), number(1 / math.factorial(terms))
    for j in range(terms - 2, 2, -2):
        even = even * square + number(1 / math.factorial(j - 1))
        odd = odd * square + number(1 / math.factorial(j))
    series = r + square * (even + r * odd)
    # adding 1.5·2^bits leaves n as an integer in the lowest bits
    integer = jax.lax.bitcast_convert_type(n + number(1.5 * 2**bits), whole)
    power = jax.lax.bitcast_convert_type((integer + bias) << bits, x.dtype)
    underflow = n <= -bias
    return jnp.where(underflow, 0, power * series + power), jnp.where(
        underflow, -1, power * series + (power - 1)
    )


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


def erfc(x: Any) -> Any:
    """Return the complementary error function of a real array."""
    if namespace(x) is not np:
        return jax.scipy.special.erfc(x)
    from scipy.special import erfc as of_numbers  # slow to import

    return of_numbers(x)


@custom_jvp
def dawson_integral(x: Any) -> Any:
    """Return ∫₀ˣ F(t) dt of Dawson's integral F, to 1e-14: ½ ln|x| + γ/4 + ½ ln 2 at large |x|.

    **Source:** Rybicki's series of `dawson` integrated term by term, with h = ¼ (the error of the method is
    7e-18), and beyond |x| = 6 the integral of the asymptotic series of F, Abramowitz and Stegun 7.1.23.

    >>> round(float(dawson_integral(1.0)), 5)
    0.36972
    """
    xp = namespace(x)
    size = xp.abs(x)
    near, far = xp.minimum(size, 6.0), xp.maximum(size, 6.0)
    inner = 0.0
    for odd in range(1, 50, 2):
        shift = 0.25 * odd
        inner = inner + (erfc(near + shift) - erfc(near - shift) + 2 * math.erf(shift)) / (2 * odd)
    inverse, series = 1 / (far * far), 1.0
    for k in range(20, 1, -1):
        series = 1 + (2 * k - 1) * (k - 1) / (2 * k) * inverse * series
    outer = 0.5 * xp.log(far) + _EULER / 4 + 0.5 * math.log(2) - 0.125 * inverse * series
    return xp.where(size > 6, outer, inner)


@dawson_integral.defjvp
def _dawson_integral_slope(primals, tangents):
    (x,), (dx,) = primals, tangents
    return dawson_integral(x), dawson(x) * dx


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
