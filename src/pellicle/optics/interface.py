"""Waves at a flat boundary between two media.

No angle is ever computed inside a layer. The transverse index a = n₀ sin θ₀ is the same in every
medium, and what a medium contributes is the normal component of its index, q = √(n² − a²).
"""

from __future__ import annotations

from functools import reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from pellicle.optics.pair import Number, Pair, abs2, conj, is_real, real, sqrt, where

_NUMBERS = int | float | complex | np.ndarray | np.generic | jax.Array


class Transverse(NamedTuple):
    """The transverse index, and by how much it falls short of the ambient's, to its last digit."""

    index: Any  # a = n₀ sin θ
    ambient: Any  # n₀
    short: Any  # n₀ − a


class Inside(NamedTuple):
    """In place of an angle of incidence: light that comes from within a medium, such as a plate, with
    the transverse index a that it had outside."""

    a: Any


def transverse(ambient: Any, angle: Any) -> tuple[Any, Any]:
    """a (a `Transverse`) and q₀ = n₀ cos θ for the angle of incidence (radians); None is normal incidence.

    With None the transverse index is the literal 0.0, so nothing oblique is computed.
    """
    if angle is None:
        return 0.0, ambient
    if isinstance(angle, Inside):
        return angle.a, normal(ambient, angle.a)
    # the cosine of a float32 π/2 is negative, and would turn T below 0 and R above 1
    cosine = jnp.cos(angle)
    least = float(jnp.finfo(cosine.dtype).eps) ** 1.25
    cosine = cosine + jax.lax.stop_gradient(jnp.maximum(least - cosine, 0.0))
    a, q0 = ambient * jnp.sin(angle), ambient * cosine
    return Transverse(a, ambient, q0 * q0 / (ambient + a)), q0


def normal_square(index: Number, a: Any) -> Number:
    """q² = (n − a)(n + a): no cancellation near the critical angle.

    With a `Transverse` none near grazing incidence either, where n − a = (n − n₀) + (n₀ − a): a medium
    that equals the ambient has the ambient's own q there.
    """
    if isinstance(a, Transverse):
        less = where(a.short < a.index, index - a.ambient + a.short, index - a.index)
        return less * (index + a.index)
    return (index - a) * (index + a)


def equal_media(ambient: Any, *others: Number):
    """Where all these media are the ambient itself, to the last digit."""
    return reduce(jnp.logical_and, [abs2(other - ambient) == 0 for other in others])


def zero_where(test, amplitude: Number) -> Number:
    """An amplitude that is exactly 0 where `test` holds, and not by rounding; its slope stays."""
    exact = where(test, amplitude, 0.0 * amplitude)
    return amplitude - jax.tree.map(jax.lax.stop_gradient, exact)


def normal(index: Number, a: Any) -> Number:
    """q = √(n² − a²), Im q ≥ 0. A real index is a promise that the wave propagates (n ≥ a)."""
    return index if isinstance(a, float) and a == 0.0 else sqrt(normal_square(index, a))


def propagates(medium: Any, ambient: Any, angle: Any) -> bool:
    """Whether numbers that are known before anything is traced say that no wave is totally reflected at
    the medium, at an angle of incidence in degrees: then most of a transparent film need not be computed."""
    given = (medium, ambient, angle)
    if any(isinstance(x, Tracer) or not isinstance(x, _NUMBERS) for x in given):
        return False
    index, n0, theta = map(np.asarray, given)  # where JAX traces, it would trace an array of its own too
    return bool(np.all(np.real(index) > np.abs(n0 * np.sin(np.deg2rad(theta)))))


def allow_tunnelling(index: Number) -> Number:
    """A real index as a Pair: it makes no promise that the wave propagates."""
    return Pair(index, jnp.zeros_like(jnp.asarray(index) * 1.0)) if is_real(index) else index


def fresnel(n1: Number, q1: Number, n2: Number, q2: Number, polarisation: str) -> Number:
    """Amplitude reflection coefficient from medium 1 to 2, 's' or 'p' (Gerardin et al. 2019, section 3.1)."""
    if polarisation == "s":
        return (q1 - q2) / (q1 + q2)
    u, v = n2 * n2 * q1, n1 * n1 * q2
    return (u - v) / (u + v)


def normal_flux(index: Number, q: Number, polarisation: str):
    """Flux along the normal per |E|²: Re q for s, Re(ε q̄) for p, up to |n|² which cancels.

    Gerardin et al. 2019 (eq. 21) use one factor for both polarisations; with an absorbing
    substrate that is wrong for p (1 % in R + T at 60°).
    """
    return real(q) if polarisation == "s" else real(index * index * conj(q))


def incident_factor(index: Number, q: Number, polarisation: str):
    """4 |q|²/Re q for s, 4 |εq|²/Re(ε q̄) for p: an incident wave's part in what a film transmits.

    For a medium that does not absorb 4 q and 4 ε q, which need no division at grazing incidence.
    """
    if is_real(index) and is_real(q):
        return 4 * q if polarisation == "s" else 4 * index * index * q
    amplitude = q if polarisation == "s" else index * index * q
    flux = normal_flux(index, q, polarisation)
    nothing = flux == 0
    return jnp.where(nothing, 0.0, 4 * abs2(amplitude) / jnp.where(nothing, 1.0, flux))


def reflectance(n1: Number, q1: Number, n2: Number, q2: Number, polarisation: str):
    """|r|² of one boundary."""
    return abs2(fresnel(n1, q1, n2, q2, polarisation))


def transmittance(n1: Number, q1: Number, n2: Number, q2: Number, polarisation: str):
    """Power transmittance of one boundary; 0 where the incident wave carries no power."""
    carried = normal_flux(n1, q1, polarisation)
    nothing = carried == 0
    ratio = normal_flux(n2, q2, polarisation) / where(nothing, 1.0 + 0.0 * carried, carried)
    if polarisation == "s":
        amplitude = 4 * abs2(q1) / abs2(q1 + q2)
    else:
        amplitude = 4 * abs2(n1 * n1 * q1) / abs2(n2 * n2 * q1 + n1 * n1 * q2)
    return jnp.where(nothing, 0.0, amplitude * ratio)
