"""One coherent layer on a substrate, with value and gradient finite everywhere.

The layer enters only through two entire functions of Q = q₁², c = cos(k₀d √Q) and
f = sin(k₀d √Q)/√Q, both times a scale that keeps them finite and cancels in r, R and T. So
zero thickness, grazing incidence, an exactly critical film, a matched index, a millimetre of metal
and tunnelling need no special case, and no root of the film's is ever differentiated. This is the
Airy formula of Gerardin et al. 2019 (eqs. 11 and 12) multiplied out; each line below is the same
for real, complex and Pair numbers.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from pellicle.optics.exponentials import exponentials
from pellicle.optics.interface import carried, normal, normal_square, nothing_where, power, same, transverse
from pellicle.optics.number import (
    Number,
    Pair,
    SinCos,
    abs2,
    hold,
    imag,
    real,
    sincos,
    sqrt,
    times_i,
    where,
)


class Passage(NamedTuple):
    """A layer's two functions, both times a scale that cancels in r and in T."""

    c: Number  # cos(kq), q = √Q
    f: Number  # sin(kq)/q
    scale_square: Any  # |scale|²
    rise: Number  # ∂f/∂k, for derivatives only: cos(kq), or e^{2ikq} where the scale moves


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def through(Q: Number, k: Any, sincos: SinCos = sincos) -> Passage:
    """c and f times e^{ikq}: c = 1 + M/2 and f = −iM/2q with M = e^{2ikq} − 1.

    A real Q may have either sign: negative is a tunnelling layer, and where the wave propagates the
    scale of a real Q is 1.
    """
    if _real_array(Q):
        return _through_real(Q, k, sincos)
    q = _root(Q)
    half, scale_square = _half(q, k, sincos)
    c, f = 1 + half, times_i(-half) * (1 / q)
    return Passage(c, f, scale_square, where(_near(Q, k), c, 1 + 2 * half))


def _root(Q: Number) -> Number:
    """√Q; one of exactly 0 is replaced by one whose distance from 0 is beneath all digits."""
    q = sqrt(Q)
    return hold(where(abs2(q) == 0, 1e-15 + 0.0 * q, q))[0]


def _half(q: Number, k: Any, sincos: SinCos) -> tuple[Number, Any]:
    """½(e^{2ikq} − 1), to the last digit where it is small, and |e^{ikq}|²."""
    scale_square, m = exponentials(-2 * (k * imag(q)))  # 1 + m would lose a transmittance of 1e-22
    sine, cosine = sincos(k * real(q))
    square, product = sine * sine, sine * cosine
    join = Pair if isinstance(q, Pair) else jax.lax.complex
    return join(m * (0.5 - square) - square, product + m * product), scale_square


def _through_real(Q, k, sincos):
    q = jnp.sqrt(jnp.abs(Q))
    flat = q == 0
    over, wave, q, flat = hold(1 / jnp.where(flat, 1.0, q), Q >= 0, q, flat)
    sine, cosine = sincos(k * q)
    scale_square, m = exponentials(jnp.where(wave, 0.0, -2 * (k * q)))
    c = jnp.where(wave, cosine, 1 + 0.5 * m)
    f = jnp.where(flat, k, jnp.where(wave, sine, -0.5 * m) * over)
    return Passage(c, f, scale_square, jnp.where(wave | _near(Q, k), c, scale_square))


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def through_wave(Q: Number, k: Any, sincos: SinCos = sincos) -> Passage:
    """The same where Q is real and positive: the wave always propagates."""
    (q,) = hold(jnp.sqrt(Q))
    sine, cosine = sincos(k * q)
    return Passage(cosine, sine * hold(1 / q)[0], jnp.ones_like(cosine), cosine)


def _near(Q, k):
    """Where the derivative of the scale would be infinite, or nearly."""
    return abs2(k * k * Q) < 1e-4


def _slopes(fn, sincos, primal, tangent):
    """Derivatives by hand: no root of the film's is differentiated where it is small.

    The scale cancels in R and T, so its derivative is ours to choose. It counts as a constant near
    zero and where a real wave propagates: dc = −f (Q dk + k dQ/2) and df = c dk + (kc − f)/2Q dQ, the
    last slope by Taylor near zero. Elsewhere it moves: dc = i e^{2ikq}/q (Q dk + k dQ/2) and
    df = e^{2ikq} dk + (k e^{2ikq} − f)/2Q dQ. So under a millimetre of metal, or across a wide gap,
    no derivatives as large as k remain that would have to cancel.
    """
    (Q, k), (dQ, dk) = primal, tangent
    c, f, scale_square, rise = out = fn(Q, k, sincos)
    w, near = k * k * Q, _near(Q, k)
    small, far = where(near, w, 0.0 * w), where(near, 1.0 + 0.0 * w, Q + 0.0 * w)
    taylor = 1.0 + 0.0 * small  # (tan φ/φ − 1) 3/φ² with φ² = w: times c, so that the scale is c's
    for ratio in (10922 / 26949, 691 / 1705, 62 / 153, 17 / 42, 2 / 5):
        taylor = 1 + small * taylor * ratio
    slope = where(near, taylor * c * (k * k * k * (-1 / 6)), (k * rise - f) * (0.5 / far))
    way, df = Q * dk + 0.5 * k * dQ, rise * dk + slope * dQ
    if fn is through_wave:
        dc = -f * way
        return out, Passage(dc, df, jnp.zeros_like(scale_square), dc)
    held = near | (Q >= 0) if _real_array(Q) else near
    over = _over_root(Q)
    over = where(held, 0.0 * over, over)
    dc, turn = where(held, -f, rise * over) * way, over * way  # the turn is i d(kq)
    return out, Passage(dc, df, 2 * real(turn) * scale_square, where(held, dc, 2 * rise * turn))


def _over_root(Q: Number) -> Number:
    """i/√Q, finite at 0; of a real Q 1/√−Q, for it serves only a tunnelling layer."""
    q = jnp.sqrt(jnp.abs(Q)) if _real_array(Q) else sqrt(Q)
    over = 1 / where(abs2(q) == 0, 1.0 + 0.0 * q, q)
    return hold(over if _real_array(Q) else times_i(over))[0]


def _real_array(Q: Number) -> bool:
    return not isinstance(Q, Pair) and not jnp.iscomplexobj(Q)


through.defjvp(lambda s, p, t: _slopes(through, s, p, t))
through_wave.defjvp(lambda s, p, t: _slopes(through_wave, s, p, t))


Sides = tuple[tuple[Number, Number], ...]


def _combined(sides: Sides, Q: Number, k: Any, through, sincos: SinCos) -> tuple[list[Number], Any]:
    """A c − iB f for each (A, B), and the scale squared."""
    if through is through_wave or _real_array(Q):
        c, f, scale_square, _ = through(Q, k, sincos)
        g = times_i(-f)
        return [A * c + B * g for A, B in sides], scale_square
    found, scale_square = _amplitudes(sides, Q, k, sincos)
    return list(found), scale_square


@partial(jax.custom_jvp, nondiff_argnums=(3,))
def _amplitudes(sides: Sides, Q: Number, k: Any, sincos: SinCos) -> tuple[tuple[Number, ...], Any]:
    """The same where Q is no real array: as c = 1 + M/2 and −if = −M/2q, it is A + M/2 (A − B/q), whose
    bracket knows nothing of the thickness: one product at each point."""
    q = _root(Q)
    over = 1 / q
    half, scale_square = _half(q, k, sincos)
    return tuple(A + half * (A - B * over) for A, B in sides), scale_square


def _amplitudes_slope(sincos, primal, tangent):
    """By the derivatives of c and f. What is known not to vary costs nothing."""
    (sides, Q, k), (dsides, dQ, dk) = primal, tangent
    dQ, dk = jax.tree.map(_filled, (dQ, dk), is_leaf=_is_nothing)
    (c, f, _, _), (dc, df, dscale, _) = _slopes(through, sincos, (Q, k), (dQ, dk))
    g, dg = times_i(-f), times_i(-df)
    moved = []
    for (A, B), turns in zip(sides, dsides, strict=True):
        dA, dB = (None if _all_nothing(x) else jax.tree.map(_filled, x, is_leaf=_is_nothing) for x in turns)
        slope = A * dc + B * dg
        slope = slope if dA is None else slope + dA * c
        moved.append(slope if dB is None else slope + dB * g)
    return _amplitudes(sides, Q, k, sincos), (tuple(moved), dscale)


def _is_nothing(x: Any) -> bool:
    return isinstance(x, SymbolicZero)


def _filled(x: Any) -> Any:
    return jnp.zeros(x.shape, x.dtype) if _is_nothing(x) else x


def _all_nothing(x: Any) -> bool:
    return all(map(_is_nothing, jax.tree.leaves(x, is_leaf=_is_nothing)))


_amplitudes.defjvp(_amplitudes_slope, symbolic_zeros=True)


class Wave(NamedTuple):
    """One polarisation of the light around a layer: amplitudes over a common denominator."""

    reflected: Number  # r = reflected / denominator, for light from the ambient
    below: Number  # the same for light from the substrate
    denominator: Number
    transmitted: Any  # power into the substrate, times |denominator|²


def film(
    ambient: Any,
    layer: Number,
    substrate: Number,
    phase: Any,
    angle: Any = None,
    polarisations: str = "sp",
    through=through,
    sincos: SinCos = sincos,
) -> tuple[Wave, ...]:
    """Waves around one layer, one for each letter of `polarisations`.

    Arguments broadcast. `ambient`, `layer` and `substrate` are numbers of any type, the ambient real
    but for light from within a plate (`interface.Inside` in place of the angle); `phase` is
    k₀d = 2πd/λ; `angle` is in radians, None being normal incidence, where s and p are one and only
    the first polarisation is computed. `through` is `through`, or `through_wave`
    where the layer is real and total reflection impossible.

    With A, B, A′, B′ below, D = A c − iB f and N = A′ c − iB′ f; reversing the light turns the sign
    of A′. Denominators carry no division: at grazing incidence T is 0, not 0/0.
    Between equal media A′ is exactly 0, and nothing between them (no thickness, or the same medium
    again) reflects exactly nothing, at 90° too.
    """
    a, q0 = transverse(ambient, angle)
    e0, e1, e2, q1_square = ambient * ambient, layer * layer, substrate * substrate, normal_square(layer, a)
    q2 = normal(substrate, a)
    bare, empty = same(ambient, substrate), same(ambient, layer, substrate)
    letters = polarisations[:1] if angle is None else polarisations
    sides, powers = [], []
    for polarisation in letters:
        if polarisation == "s":
            A, B, A_, B_ = q0 + q2, q0 * q2 + q1_square, q0 - q2, q0 * q2 - q1_square
        else:
            u, v = e0 * e2 * q1_square / e1, e1 * q0 * q2
            A, B, A_, B_ = e0 * q2 + e2 * q0, u + v, e2 * q0 - e0 * q2, v - u
        A_, B_ = nothing_where(bare, A_), nothing_where(empty, B_)
        sides += [(A_, B_), (-A_, B_), (A, B)]
        powers.append(carried(ambient, q0, polarisation) * power(substrate, q2, polarisation))
    found, scale_square = _combined(tuple(sides), q1_square, phase, through, sincos)
    trios = zip(found[0::3], found[1::3], found[2::3], powers, strict=True)
    return tuple(Wave(down, below, whole, into * scale_square) for down, below, whole, into in trios)


def reflectance(wave: Wave):
    """R = |r|² for light from the ambient."""
    return abs2(wave.reflected) / abs2(wave.denominator)


def reflectance_below(wave: Wave):
    """R for light from the substrate."""
    return abs2(wave.below) / abs2(wave.denominator)


def transmittance(wave: Wave):
    """T, the power into the substrate. A lossless substrate sends the same fraction back."""
    return wave.transmitted / abs2(wave.denominator)
