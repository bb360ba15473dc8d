"""One coherent layer on a substrate, with value and gradient finite everywhere.

The layer enters only through two entire functions of Q = q₁², c = cos(k₀d √Q) and
f = sin(k₀d √Q)/√Q, both times a positive scale that keeps them finite and cancels in R and T. So
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

from pellicle.optics.interface import carried, normal, normal_square, power, transverse
from pellicle.optics.number import Number, Pair, SinCos, abs2, hold, imag, real, sincos, sqrt, times_i, where


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def through(Q: Number, k: Any, sincos: SinCos = sincos) -> tuple[Number, Number, Any]:
    """c = cos(k√Q) and f = sin(k√Q)/√Q, both times a positive scale, and the scale squared.

    A real Q may have either sign: negative is a tunnelling layer.
    """
    if not isinstance(Q, Pair) and not jnp.iscomplexobj(Q):
        return _through_real(Q, k, sincos)
    q = sqrt(Q)
    flat = abs2(q) == 0
    over, q, flat = hold(1 / where(flat, 1.0 + 0.0 * q, q), q, flat)
    decay = -2 * (k * imag(q))
    m = jnp.expm1(decay)
    sine, cosine = sincos(k * real(q))
    h = 1 + 0.5 * m
    join = Pair if isinstance(Q, Pair) else jax.lax.complex
    c, s = join(h * cosine, 0.5 * m * sine), join(h * sine, -0.5 * m * cosine)
    # its own exponential: 1 + m would lose a transmittance of 1e-22
    return c, where(flat, k + 0.0 * s, s * over), jnp.exp(decay)


def _through_real(Q, k, sincos):
    q = jnp.sqrt(jnp.abs(Q))
    flat = q == 0
    over, wave, q, flat = hold(1 / jnp.where(flat, 1.0, q), Q >= 0, q, flat)
    sine, cosine = sincos(k * q)
    decay = jnp.where(wave, 0.0, -2 * (k * q))
    m = jnp.expm1(decay)
    c = jnp.where(wave, cosine, 1 + 0.5 * m)
    return c, jnp.where(flat, k, jnp.where(wave, sine, -0.5 * m) * over), jnp.exp(decay)


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def through_wave(Q: Number, k: Any, sincos: SinCos = sincos) -> tuple[Number, Number, Any]:
    """The same where Q is real and positive: the wave always propagates."""
    (q,) = hold(jnp.sqrt(Q))
    sine, cosine = sincos(k * q)
    return cosine, sine * hold(1 / q)[0], jnp.ones_like(cosine)


def _slopes(fn, sincos, primal, tangent):
    """dc = −f(Q dk + k dQ/2), df = c dk + (kc − f)/(2Q) dQ, the last slope by Taylor near zero.

    The scale cancels in R and T, so it counts as a constant and no square root is differentiated.
    """
    (Q, k), (dQ, dk) = primal, tangent
    c, f, scale = fn(Q, k, sincos)
    w = k * k * Q
    near = abs2(w) < 1e-3
    small, far = where(near, w, 0.0 * w), where(near, 1.0 + 0.0 * w, Q + 0.0 * w)
    taylor = 1.0 + 0.0 * small  # (k cos − sin/√Q)/2Q = −k³/6 (1 − w/10 (1 − w/28 (...)))
    for j in range(5, 0, -1):
        taylor = 1 - small * taylor * ((j + 1) / (j * (2 * j + 2) * (2 * j + 3)))
    taylor = taylor * (k * k * k * (-1 / 6) * jnp.sqrt(where(near, scale, 1.0)))  # scaled as c and f are
    slope = where(near, taylor, (k * c - f) * (0.5 / far))
    return (c, f, scale), (-f * (Q * dk + 0.5 * k * dQ), c * dk + slope * dQ, jnp.zeros_like(scale))


through.defjvp(lambda s, p, t: _slopes(through, s, p, t))
through_wave.defjvp(lambda s, p, t: _slopes(through_wave, s, p, t))


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
    """
    a, q0 = transverse(ambient, angle)
    e0, e1, e2, q1_square = ambient * ambient, layer * layer, substrate * substrate, normal_square(layer, a)
    q2 = normal(substrate, a)
    c, f, scale_square = through(q1_square, phase, sincos)
    g = times_i(-f)
    waves = []
    for polarisation in polarisations[:1] if angle is None else polarisations:
        if polarisation == "s":
            A, B, A_, B_ = q0 + q2, q0 * q2 + q1_square, q0 - q2, q0 * q2 - q1_square
        else:
            u, v = e0 * e2 * q1_square / e1, e1 * q0 * q2
            A, B, A_, B_ = e0 * q2 + e2 * q0, u + v, e2 * q0 - e0 * q2, v - u
        into = carried(ambient, q0, polarisation) * power(substrate, q2, polarisation) * scale_square
        waves.append(Wave(A_ * c + B_ * g, B_ * g - A_ * c, A * c + B * g, into))
    return tuple(waves)


def reflectance(wave: Wave):
    """R = |r|² for light from the ambient."""
    return abs2(wave.reflected) / abs2(wave.denominator)


def reflectance_below(wave: Wave):
    """R for light from the substrate."""
    return abs2(wave.below) / abs2(wave.denominator)


def transmittance(wave: Wave):
    """T, the power into the substrate. A lossless substrate sends the same fraction back."""
    return wave.transmitted / abs2(wave.denominator)
