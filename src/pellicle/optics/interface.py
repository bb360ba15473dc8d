"""Waves at a flat interface between two media.

No angle is computed inside a layer. The transverse index a = n₀ sin θ₀ is the same in every medium, and
a medium enters by the normal component of its index, q = √(n² − a²).

A medium with principal axes along those of the laboratory (`anisotropy.Principal`) stands for its p waves
here, q = (n_x/n_z) √(n_z² − a²), with n_x² in place of n² in the boundary condition. For s waves it is an
isotropic medium of index n_y (`principal_axes.seen_by`).
"""

from functools import reduce
from operator import and_
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from pellicle.optics.anisotropy import Index, Medium, Principal, each_index, tangential_permittivity
from pellicle.optics.pair import (
    Number,
    Pair,
    abs2,
    conj,
    is_real,
    namespace,
    real,
    sqrt,
    stop_gradient,
    where,
)

_NUMBERS = int | float | complex | np.ndarray | np.generic | jax.Array


class Transverse(NamedTuple):
    """The transverse index, and its distance from the index of the ambient to full precision."""

    index: Any  # a = n₀ sin θ
    ambient: Any  # n₀
    shortfall: Any  # n₀ − a


class Inside(NamedTuple):
    """Light that comes from within a medium, such as a plate; it takes the place of an angle of incidence."""

    a: Any  # its transverse index, unchanged since the ambient


def transverse(ambient: Any, angle: Any) -> tuple[Any, Any]:
    """Return the transverse index a and q₀ = n₀ cos θ.

    **Arguments:** `angle` of incidence in radians, or `Inside`. None is normal incidence: a is then the
    literal 0.0, so that nothing oblique is computed. Otherwise it is a `Transverse`.
    """
    if angle is None:
        return 0.0, normal(ambient, 0.0)
    if isinstance(angle, Inside):
        return angle.a, normal(ambient, angle.a)
    # the cosine of a float32 π/2 is negative, and would bring T below 0 and R above 1
    xp = namespace(angle)
    cosine = xp.cos(angle)
    least = float(jnp.finfo(cosine.dtype).eps) ** 1.25
    cosine = cosine + stop_gradient(xp.maximum(least - cosine, 0.0))
    a, q0 = ambient * xp.sin(angle), ambient * cosine
    return Transverse(a, ambient, q0 * q0 / (ambient + a)), q0


def normal_square(index: Index, a: Any) -> Number:
    """Return q² = (n − a)(n + a), which does not cancel near the critical angle.

    With a `Transverse` it does not cancel near grazing incidence either, where
    n − a = (n − n₀) + (n₀ − a): a medium equal to the ambient has the q of the ambient there.
    """
    if isinstance(index, Principal):
        if isinstance(a, float) and a == 0.0:
            return index.x * index.x
        ratio = index.x / index.z
        return ratio * ratio * normal_square(index.z, a)
    if isinstance(a, Transverse):
        difference = where(a.shortfall < a.index, index - a.ambient + a.shortfall, index - a.index)
        return difference * (index + a.index)
    return (index - a) * (index + a)


def normal(index: Index, a: Any) -> Number:
    """Return q = √(n² − a²), Im q ≥ 0. A real index is a promise that the wave propagates (n ≥ a)."""
    if isinstance(a, float) and a == 0.0:
        return index.x if isinstance(index, Principal) else index
    return sqrt(normal_square(index, a))


def equal_media(ambient: Index, *others: Index) -> Any:
    """True where all other media are exactly equal to the ambient."""
    pairs: list[tuple[Number, Number]] = []
    for other in others:
        if isinstance(other, Principal) or isinstance(ambient, Principal):
            # p waves propagate in both alike where n_x and n_z are equal
            one, another = (n if isinstance(n, Principal) else Principal(n, n, n) for n in (other, ambient))
            pairs += [(one.x, another.x), (one.z, another.z)]
        else:
            pairs.append((other, ambient))
    return reduce(and_, [abs2(a - b) == 0 for a, b in pairs])


def zero_where(test: Any, amplitude: Number) -> Number:
    """Set an amplitude to exactly 0 where `test` is true, without a rounding error; its slope stays."""
    exact = where(test, amplitude, 0.0 * amplitude)
    return amplitude - jax.tree.map(stop_gradient, exact)


def propagates(medium: Any, ambient: Any, angle: Any) -> bool:
    """True if no wave is totally reflected at the medium, judged from concrete numbers only.

    Then most of the work for a transparent film can be left out. `angle` of incidence is in degrees.
    Traced values and materials give False.

    >>> propagates(1.46, 1.0, 60.0), propagates(1.2, 1.5, 60.0)
    (True, False)
    """
    arguments = (medium, ambient, angle)
    if any(isinstance(x, Tracer) or not isinstance(x, _NUMBERS) for x in arguments):
        return False
    index, n0, theta = map(np.asarray, arguments)  # by NumPy: under a trace, JAX would trace these too
    return bool(np.all(np.real(index) > np.abs(n0 * np.sin(np.deg2rad(theta)))))


def allow_tunnelling(index: Medium) -> Any:
    """Turn a real index into a `Pair`, which does not promise that the wave propagates."""
    if isinstance(index, tuple):
        return each_index(allow_tunnelling, index)
    xp = namespace(index)
    return Pair(index, xp.zeros_like(xp.asarray(index) * 1.0)) if is_real(index) else index


def fresnel(n1: Index, q1: Number, n2: Index, q2: Number, polarisation: str) -> Number:
    """Return the amplitude reflection coefficient r from medium 1 to medium 2.

    **Arguments:** refractive indices `n1` and `n2`, their normal components `q1` and `q2`, and "s" or "p".

    **Source:** Gerardin et al. 2019, section 3.1.

    >>> round(float(fresnel(1.0, 1.0, 1.5, 1.5, "s")), 3)
    -0.2
    """
    if polarisation == "s":
        return (q1 - q2) / (q1 + q2)
    u, v = tangential_permittivity(n2) * q1, tangential_permittivity(n1) * q2
    return (u - v) / (u + v)


def normal_flux(index: Index, q: Number, polarisation: str) -> Any:
    """Return the flux along the normal per |E|²: Re q for s, Re(ε q̄) for p, up to |n|², which cancels.

    Gerardin et al. 2019 (eq. 21) use one factor for both polarisations. With an absorbing substrate that
    is wrong for p (1 % in R + T at 60°).
    """
    return real(q) if polarisation == "s" else real(tangential_permittivity(index) * conj(q))


def incident_factor(index: Index, q: Number, polarisation: str) -> Any:
    """Return the incident wave's factor in a film's transmittance: 4|q|²/Re q for s, 4|εq|²/Re(ε q̄) for p.

    For a medium that does not absorb these are 4 q and 4 ε q, without a division at grazing incidence.
    """
    if is_real(index) and is_real(q):
        return 4 * q if polarisation == "s" else 4 * tangential_permittivity(index) * q
    amplitude = q if polarisation == "s" else tangential_permittivity(index) * q
    flux = normal_flux(index, q, polarisation)
    zero = flux == 0
    return where(zero, 0.0, 4 * abs2(amplitude) / where(zero, 1.0, flux))


def reflectance(n1: Index, q1: Number, n2: Index, q2: Number, polarisation: str) -> Any:
    """Return the power reflectance |r|² of one interface; arguments as for `fresnel`."""
    return abs2(fresnel(n1, q1, n2, q2, polarisation))


def transmittance(n1: Index, q1: Number, n2: Index, q2: Number, polarisation: str) -> Any:
    """Return the power transmittance of one interface; 0 where the incident wave carries no power."""
    incident = normal_flux(n1, q1, polarisation)
    zero = incident == 0
    ratio = normal_flux(n2, q2, polarisation) / where(zero, 1.0 + 0.0 * incident, incident)
    if polarisation == "s":
        amplitude = 4 * abs2(q1) / abs2(q1 + q2)
    else:
        e1, e2 = tangential_permittivity(n1), tangential_permittivity(n2)
        amplitude = 4 * abs2(e1 * q1) / abs2(e2 * q1 + e1 * q2)
    return where(zero, 0.0, amplitude * ratio)
