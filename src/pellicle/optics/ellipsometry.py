"""Ellipsometry: the ratio of the two polarisations' reflection, as angles and as a point on a sphere.

Convention, with n + ik and the time factor exp(−iωt): tan(Ψ) exp(iΔ) = conj(r_p / r_s), which is what
instruments write; Δ is near 180° for bare silicon at small angles. N = cos 2Ψ, C = sin 2Ψ cos Δ and
S = sin 2Ψ sin Δ lie on a unit sphere, have no wrap-around, and are what is fitted (Jellison and Modine
1990, Appl. Opt. 29, 959).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.pair import abs2, conj, imag, real, to_complex
from pellicle.optics.response import Response, transmittance


class Stokes(NamedTuple):
    """N, C and S, each times the intensity, and the intensity |r_s|² + |r_p|².

    They are sums of intensities: what an instrument averages is averaged here, before the division.
    """

    n: Any
    c: Any
    s: Any
    intensity: Any


def stokes(s: Response, p: Response) -> Stokes:
    """From the responses of the same layers to both polarisations."""
    rs, rp = s.reflected / s.denominator, p.reflected / p.denominator
    both = 2 * (conj(rp) * rs)
    return Stokes(abs2(rs) - abs2(rp), real(both), imag(both), abs2(rs) + abs2(rp))


class CrossProducts(NamedTuple):
    """conj(x_p) x_s of one sheet's amplitudes x: reflected, passed both ways, and reflected from below."""

    reflected: Any
    passed_twice: Any
    below: Any


def cross_products(s: Response, p: Response) -> CrossProducts:
    """From the responses of the same layers to both polarisations, between media that absorb next to nothing.

    Their t t′ has the size T and, but for what s and p have in common, twice the phase of 1/denominator.
    """
    ds, dp = to_complex(s.denominator), to_complex(p.denominator)
    apart = jnp.conj(ds) * dp
    turn = apart / jnp.abs(apart)
    return CrossProducts(
        jnp.conj(to_complex(p.reflected) / dp) * (to_complex(s.reflected) / ds),
        transmittance(p) * transmittance(s) * turn * turn,
        jnp.conj(to_complex(p.below) / dp) * (to_complex(s.below) / ds),
    )


def stokes_from_sums(s: Any, p: Any, cross: Any) -> Stokes:
    """From sums of intensities |x_s|², |x_p|² and of conj(x_p) x_s: what comes back from plates."""
    return Stokes(s - p, 2 * jnp.real(cross), 2 * jnp.imag(cross), s + p)


def normalised(given: Stokes) -> tuple[Any, Any, Any]:
    """N, C, S on the unit sphere; all 0 where nothing is reflected, so that Ψ and Δ have no meaning."""
    dark = given.intensity < jnp.finfo(jnp.result_type(given.intensity)).tiny
    # scaled to size first: the derivative of 1/x holds 1/x², which overflows where little is reflected
    size = jax.lax.stop_gradient(jnp.where(dark, 0.0, 1 / jnp.where(dark, 1.0, given.intensity)))
    over = jnp.where(dark, 0.0, 1 / jnp.where(dark, 1.0, given.intensity * size))
    n, c, s = (x * size * over for x in given[:3])
    return n, c, s


def psi_delta(n: Any, c: Any, s: Any) -> tuple[Any, Any]:
    """Ψ in 0 to 90 and Δ in 0 to 360 degrees.

    Where Ψ is 0 or 90, Δ is 0 and its derivatives are 0; where nothing is reflected, all are 0.
    """
    square = c * c + s * s
    pole = square == 0
    dark = pole & (n == 0)
    across = jnp.sqrt(jnp.where(pole, 1.0, square)) * jnp.where(pole, 0.0, 1.0)
    psi = 0.5 * jnp.arctan2(across, jnp.where(dark, 1.0, n))
    delta = jnp.arctan2(jnp.where(pole, 0.0, s), jnp.where(pole, 1.0, c))
    turned = jnp.mod(jnp.rad2deg(delta), 360.0)
    # −1e-17 + 360 rounds to 360: such a Δ is 0, with the slope that it has
    whole = jax.lax.stop_gradient(jnp.where(turned >= 360.0, turned, 0.0))
    return jnp.rad2deg(psi), turned - whole


def alpha_beta(n: Any, c: Any, analyser: Any) -> tuple[Any, Any]:
    """α and β of a rotating-analyser ellipsometer from N and C; S does not enter, so neither does Δ's sign.

    The detector sees 1 + α cos 2a + β sin 2a while one polariser turns by a and the other, before or
    behind the sample, stands at `analyser`, in degrees between 0 and 90, neither included; both angles
    count from the plane of incidence, and β has the sign of cos Δ. With A for `analyser`
    α = (tan²Ψ − tan²A)/(tan²Ψ + tan²A) and β = 2 tanΨ cosΔ tanA/(tan²Ψ + tan²A) (the instrument of
    D. E. Aspnes and A. A. Studna, Appl. Opt. 14, 220 (1975)), here as α = (cos 2A − N)/(1 − N cos 2A)
    and β = C sin 2A/(1 − N cos 2A), which are finite at Ψ = 0 and 90. The function is its own inverse:
    `alpha_beta(alpha, beta, analyser)` returns N and C.
    """
    twice = 2 * jnp.deg2rad(analyser)
    over = 1 - n * jnp.cos(twice)
    return (jnp.cos(twice) - n) / over, c * jnp.sin(twice) / over
