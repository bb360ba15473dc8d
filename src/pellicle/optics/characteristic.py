"""What a layer does to the fields that pass it: two entire functions of Q = q₁², finite everywhere.

c = cos(k₀d √Q) and f = sin(k₀d √Q)/√Q, both times a scale that keeps them finite and cancels in r, R
and T. No root of the film's is ever differentiated where it is small.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.elementary import exp_and_expm1, sincos
from pellicle.optics.hoisting import hoist
from pellicle.optics.pair import Number, Pair, abs2, imag, real, sqrt, times_i, where


class Characteristic(NamedTuple):
    """A layer's two functions, both times a scale that cancels in r and in T."""

    c: Number  # cos(kq), q = √Q
    f: Number  # sin(kq)/q
    scale_square: Any  # |scale|²
    rise: Number  # ∂f/∂k, for derivatives only: cos(kq), or e^{2ikq} where the scale moves


@jax.custom_jvp
def matrix_elements(Q: Number, k: Any) -> Characteristic:
    """c and f times e^{ikq}: c = 1 + M/2 and f = −iM/2q with M = e^{2ikq} − 1.

    A real Q may have either sign: negative is a tunnelling layer, and where the wave propagates the
    scale of a real Q is 1.
    """
    if is_real_array(Q):
        return _real_elements(Q, k)
    q = root(Q)
    half, scale_square = half_expm1(q, k)
    c, f = 1 + half, times_i(-half) * hoist(1 / q, k)
    return Characteristic(c, f, scale_square, where(_near(Q, k), c, 1 + 2 * half))


def root(Q: Number) -> Number:
    """√Q; one of exactly 0 is replaced by one whose distance from 0 is beneath all digits."""
    q = sqrt(Q)
    return where(abs2(q) == 0, 1e-15 + 0.0 * q, q)


def half_expm1(q: Number, k: Any) -> tuple[Number, Any]:
    """½(e^{2ikq} − 1), to the last digit where it is small, and |e^{ikq}|²."""
    scale_square, m = exp_and_expm1(k * hoist(-2 * imag(q), k))  # 1 + m would lose a transmittance of 1e-22
    sine, cosine = sincos(k * hoist(real(q), k))
    square, product = sine * sine, sine * cosine
    join = Pair if isinstance(q, Pair) else jax.lax.complex
    return join(m * (0.5 - square) - square, product + m * product), scale_square


def _real_elements(Q, k):
    q = jnp.sqrt(jnp.abs(Q))
    flat = q == 0
    wave, over, q = Q >= 0, hoist(1 / jnp.where(flat, 1.0, q), k), hoist(q, k)
    sine, cosine = sincos(k * q)
    scale_square, m = exp_and_expm1(jnp.where(wave, 0.0, -2 * (k * q)))
    c = jnp.where(wave, cosine, 1 + 0.5 * m)
    f = jnp.where(flat, k, jnp.where(wave, sine, -0.5 * m) * over)
    return Characteristic(c, f, scale_square, jnp.where(wave | _near(Q, k), c, scale_square))


@jax.custom_jvp
def propagating_elements(Q: Any, k: Any) -> Characteristic:
    """The same where Q is real and positive: the wave always propagates."""
    q = jnp.sqrt(Q)
    sine, cosine = sincos(k * hoist(q, k))
    return Characteristic(cosine, sine * hoist(1 / q, k), jnp.ones_like(cosine), cosine)


def _near(Q, k):
    """Where the derivative of the scale would be infinite, or nearly."""
    return abs2(k * k * Q) < 1e-4


def element_slopes(fn: Callable[[Number, Any], Characteristic], primal: Any, tangent: Any):
    """Derivatives by hand: no root of the film's is differentiated where it is small.

    The scale cancels in R and T, so its derivative is ours to choose. It counts as a constant near
    zero and where a real wave propagates: dc = −f (Q dk + k dQ/2) and df = c dk + (kc − f)/2Q dQ, the
    last slope by Taylor near zero. Elsewhere it moves: dc = i e^{2ikq}/q (Q dk + k dQ/2) and
    df = e^{2ikq} dk + (k e^{2ikq} − f)/2Q dQ. So under a millimetre of metal, or across a wide gap,
    no derivatives as large as k remain that would have to cancel.
    """
    (Q, k), (dQ, dk) = primal, tangent
    c, f, scale_square, rise = out = fn(Q, k)
    w, near = k * k * Q, _near(Q, k)
    small, far = where(near, w, 0.0 * w), where(near, 1.0 + 0.0 * w, Q + 0.0 * w)
    taylor = 1.0 + 0.0 * small  # (tan φ/φ − 1) 3/φ² with φ² = w: times c, so that the scale is c's
    for ratio in (10922 / 26949, 691 / 1705, 62 / 153, 17 / 42, 2 / 5):
        taylor = 1 + small * taylor * ratio
    slope = where(near, taylor * c * (k * k * k * (-1 / 6)), (k * rise - f) * (0.5 / far))
    way, df = Q * dk + 0.5 * k * dQ, rise * dk + slope * dQ
    if fn is propagating_elements:
        dc = -f * way
        return out, Characteristic(dc, df, jnp.zeros_like(scale_square), dc)
    held = near | (Q >= 0) if is_real_array(Q) else near
    over = hoist(_over_root(Q), k)
    over = where(held, 0.0 * over, over)
    dc, turn = where(held, -f, rise * over) * way, over * way  # the turn is i d(kq)
    return out, Characteristic(dc, df, 2 * real(turn) * scale_square, where(held, dc, 2 * rise * turn))


def _over_root(Q: Number) -> Number:
    """i/√Q, finite at 0; of a real Q 1/√−Q, for it serves only a tunnelling layer."""
    q = jnp.sqrt(jnp.abs(Q)) if is_real_array(Q) else sqrt(Q)
    over = 1 / where(abs2(q) == 0, 1.0 + 0.0 * q, q)
    return over if is_real_array(Q) else times_i(over)


def is_real_array(Q: Number) -> bool:
    """Whether its type says that it has no imaginary part, and it is no Pair."""
    return not isinstance(Q, Pair) and not jnp.iscomplexobj(Q)


matrix_elements.defjvp(lambda p, t: element_slopes(matrix_elements, p, t))
propagating_elements.defjvp(lambda p, t: element_slopes(propagating_elements, p, t))
