"""Elements of a layer's characteristic matrix, as entire functions of the squared normal index.

With q the normal component of the layer's index, Q = q² and k = k₀d, the matrix is built from
c = cos(k √Q) and f = sin(k √Q)/√Q. Both are entire in Q, so they are finite where the layer is at its
critical angle or has no thickness. They are returned times a common scale, which keeps them finite in
opaque layers and cancels in r, R and T. Derivatives are written by hand: no root is differentiated where
it is small.

Source: Born and Wolf, Principles of Optics, section 1.6.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.hoisting import hoist
from pellicle.optics.pair import (
    Number,
    Pair,
    abs2,
    custom_jvp,
    imag,
    namespace,
    real,
    sqrt,
    times_i,
    to_complex,
    where,
)
from pellicle.optics.special import exp_and_expm1, sincos


class Characteristic(NamedTuple):
    """Both elements of a layer's matrix, times a scale that cancels in r and in T."""

    c: Number  # cos(kq), q = √Q
    f: Number  # sin(kq)/q
    scale_square: Any  # |scale|²
    df_dk: Number  # for derivatives only: cos(kq), or e^{2ikq} where the scale varies


@custom_jvp
def matrix_elements(Q: Number, k: Any) -> Characteristic:
    """Return c and f times e^{ikq}: c = 1 + M/2 and f = −iM/2q with M = e^{2ikq} − 1.

    A real Q may have either sign. Where it is negative the wave is evanescent; where it is positive the
    scale is 1.

    **Arguments:** `Q` = q² = n² − a², real, complex or a `Pair`; `k` = k₀d = 2πd/λ, real. Both broadcast.
    """
    if is_real_array(Q):
        return _real_elements(Q, k)
    q = nonzero_root(Q)
    half, scale_square = half_expm1(q, k)
    c, f = 1 + half, times_i(-half) * hoist(1 / q, k)
    return Characteristic(c, f, scale_square, where(_near_zero(Q, k), c, 1 + 2 * half))


def nonzero_root(Q: Number) -> Number:
    """Return √Q; a root of exactly 0 is replaced by ε², a change below all digits of c and f."""
    q = sqrt(Q)
    tiny = float(jnp.finfo(jnp.result_type(real(q))).eps) ** 2
    return where(abs2(q) == 0, tiny + 0.0 * q, q)


def half_expm1(q: Number, k: Any) -> tuple[Number, Any]:
    """Return ½(e^{2ikq} − 1), to full precision where it is small, and |e^{ikq}|²."""
    # 1 + expm1 in place of exp would lose a transmittance of 1e-22
    scale_square, m = exp_and_expm1(k * hoist(-2 * imag(q), k))
    sine, cosine = sincos(k * hoist(real(q), k))
    square, product = sine * sine, sine * cosine
    join = Pair if isinstance(q, Pair) else lambda re, im: to_complex(Pair(re, im))
    return join(m * (0.5 - square) - square, product + m * product), scale_square


def _real_elements(Q: Any, k: Any) -> Characteristic:
    """`matrix_elements` of a real Q: the propagating and the evanescent branch, selected by its sign."""
    xp = namespace(Q, k)
    q = xp.sqrt(xp.abs(Q))
    zero = q == 0
    propagating, inverse, q = Q >= 0, hoist(1 / xp.where(zero, 1.0, q), k), hoist(q, k)
    sine, cosine = sincos(k * q)
    scale_square, m = exp_and_expm1(xp.where(propagating, 0.0, -2 * (k * q)))
    c = xp.where(propagating, cosine, 1 + 0.5 * m)
    f = xp.where(zero, k, xp.where(propagating, sine, -0.5 * m) * inverse)
    df_dk = xp.where(propagating | _near_zero(Q, k), c, scale_square)
    return Characteristic(c, f, scale_square, df_dk)


@custom_jvp
def propagating_elements(Q: Any, k: Any) -> Characteristic:
    """Return c and f of a real and positive Q, where the wave propagates without loss; the scale is 1."""
    xp = namespace(Q, k)
    q = xp.sqrt(Q)
    sine, cosine = sincos(k * hoist(q, k))
    return Characteristic(cosine, sine * hoist(1 / q, k), xp.ones_like(cosine), cosine)


def _near_zero(Q: Number, k: Any) -> Any:
    """True where |k²Q| < 0.01: the derivative of the scale would be infinite there, or nearly."""
    return abs2(k * k * Q) < 1e-4


def element_slopes(
    elements: Callable[[Number, Any], Characteristic], primal: Any, tangent: Any
) -> tuple[Characteristic, Characteristic]:
    """JVP of `matrix_elements` or `propagating_elements`.

    The scale cancels in R and T, so its derivative may be chosen. Near Q = 0, and where a real wave
    propagates, it counts as a constant: dc = −f (Q dk + k dQ/2) and df = c dk + (kc − f)/2Q dQ, the last
    slope by its Taylor series near zero. Elsewhere it varies: dc = i e^{2ikq}/q (Q dk + k dQ/2) and
    df = e^{2ikq} dk + (k e^{2ikq} − f)/2Q dQ. So no derivatives as large as k are left to cancel under
    a millimetre of metal, or across a wide gap.
    """
    (Q, k), (dQ, dk) = primal, tangent
    c, f, scale_square, df_dk = values = elements(Q, k)
    w, near = k * k * Q, _near_zero(Q, k)
    small, far = where(near, w, 0.0 * w), where(near, 1.0 + 0.0 * w, Q + 0.0 * w)
    taylor = 1.0 + 0.0 * small  # (tan φ/φ − 1) 3/φ² with φ² = w: times c, so that the scale is c's
    for ratio in (10922 / 26949, 691 / 1705, 62 / 153, 17 / 42, 2 / 5):
        taylor = 1 + small * taylor * ratio
    df_dQ = where(near, taylor * c * (k * k * k * (-1 / 6)), (k * df_dk - f) * (0.5 / far))
    q_dphase, df = Q * dk + 0.5 * k * dQ, df_dk * dk + df_dQ * dQ  # q d(kq)
    if elements is propagating_elements:
        dc = -f * q_dphase
        return values, Characteristic(dc, df, jnp.zeros_like(scale_square), dc)
    constant = near | (Q >= 0) if is_real_array(Q) else near
    inverse = hoist(_i_over_root(Q), k)
    inverse = where(constant, 0.0 * inverse, inverse)
    dc, i_dphase = where(constant, -f, df_dk * inverse) * q_dphase, inverse * q_dphase
    slopes = Characteristic(
        dc, df, 2 * real(i_dphase) * scale_square, where(constant, dc, 2 * df_dk * i_dphase)
    )
    return values, slopes


@custom_jvp
def scale_exponent(Q: Number, k: Any) -> Number:
    """Return ikq, the logarithm of the scale of `matrix_elements`, whose derivative is that of the scale.

    For fields at different depths of a layer, whose scales differ. Of a complex array or a `Pair`.
    """
    return times_i(k * sqrt(Q))


@scale_exponent.defjvp
def _scale_exponent_slope(primal: Any, tangent: Any) -> tuple[Number, Number]:
    (Q, k), (dQ, dk) = primal, tangent
    slope = _i_over_root(Q) * (Q * dk + 0.5 * k * dQ)
    return scale_exponent(Q, k), where(_near_zero(Q, k), 0.0 * slope, slope)


def _i_over_root(Q: Number) -> Number:
    """Return i/√Q, finite at 0; of a real Q 1/√−Q, which is used for evanescent layers only."""
    q = jnp.sqrt(jnp.abs(real(Q))) if is_real_array(Q) else sqrt(Q)
    inverse = 1 / where(abs2(q) == 0, 1.0 + 0.0 * q, q)
    return inverse if is_real_array(Q) else times_i(inverse)


def is_real_array(Q: Number) -> bool:
    """True for a real array or number, False for a complex array or a `Pair`."""
    return not isinstance(Q, Pair) and not jnp.iscomplexobj(Q)


matrix_elements.defjvp(lambda primal, tangent: element_slopes(matrix_elements, primal, tangent))
propagating_elements.defjvp(lambda primal, tangent: element_slopes(propagating_elements, primal, tangent))
