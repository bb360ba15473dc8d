"""Ellipsometry: Ψ, Δ and the Stokes parameters N, C, S from the response to s and p, and Mueller matrices.

Convention, with n + ik and the time factor exp(−iωt): tan(Ψ) exp(iΔ) = conj(r_p / r_s), as instruments
write it; Δ is near 180° for bare silicon at small angles. N = cos 2Ψ, C = sin 2Ψ cos Δ and
S = sin 2Ψ sin Δ lie on a unit sphere, do not wrap around, and are what is fitted (Jellison and Modine
1990, Appl. Opt. 29, 959).

Mueller matrices are those of samples that do not depolarise. Stokes vectors are those of instruments: S₁ is
the intensity of p minus that of s, S₂ that at +45° minus that at −45°, and S₃ = 2 Im(E_p conj E_s) has the
sign with which the normalised matrix of an isotropic sample is

    [[ 1, −N, 0, 0], [−N, 1, 0, 0], [0, 0, C, S], [0, 0, −S, C]]

Mueller matrices of light that adds incoherently add, Jones matrices do not: averages over wavelength,
thickness or angle are taken over Mueller matrices before they are normalised.

Source: R. M. A. Azzam and N. M. Bashara, Ellipsometry and Polarized Light, section 2.12; G. E. Jellison and
F. A. Modine, Appl. Opt. 36, 8184 (1997) for the signs of Mueller matrices.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.hoisting import compute_once, slopes_once
from pellicle.optics.pair import (
    Number,
    Pair,
    abs2,
    conj,
    custom_jvp,
    imag,
    namespace,
    real,
    stop_gradient,
    to_complex,
    to_pair,
    where,
)
from pellicle.optics.response import Response, transmittance


class Stokes(NamedTuple):
    """N, C and S times the intensity, and the intensity |r_s|² + |r_p|².

    They are sums of intensities: instrumental averages are taken over them, before the division.
    """

    n: Any
    c: Any
    s: Any
    intensity: Any


def stokes(s: Response, p: Response) -> Stokes:
    """Return the Stokes sums of light reflected by layers, from their responses to s and p."""
    rs, rp = (_amplitude(to_pair(x.reflected), to_pair(x.denominator)) for x in (s, p))
    both = 2 * (conj(rp) * rs)
    return Stokes(abs2(rs) - abs2(rp), real(both), imag(both), abs2(rs) + abs2(rp))


def transmitted_stokes(s: Response, p: Response) -> Stokes:
    """Return the Stokes sums of light transmitted by layers into a transparent medium.

    The amplitudes are those of the power: |t|² = T. In a transparent medium t_p and t_s have one factor to
    those of the electric field, and the phase of 1/denominator.
    """
    powers = transmittance(s), transmittance(p)
    product = conj(to_complex(s.denominator)) * to_complex(p.denominator)
    cross = _root(powers[0] * powers[1]) * product / abs(product)
    return stokes_from_sums(*powers, cross)


def _root(power: Any) -> Any:
    """Return the square root, with a finite slope where nothing is transmitted."""
    xp, some = namespace(power), power > 0
    return xp.where(some, xp.sqrt(xp.where(some, power, 1.0)), 0.0)


@custom_jvp
def _amplitude(reflected: Number, denominator: Number) -> Any:
    """Return r = reflected / denominator, stored as a complex array that one loop computes.

    Else each sum computes it again. Two divisions by |denominator|² cost less than its stored inverse.
    """
    product, square = reflected * conj(denominator), abs2(denominator)
    return compute_once(to_complex(Pair(real(product) / square, imag(product) / square)))


@_amplitude.defjvp
def _amplitude_slope(primal: Any, tangent: Any) -> tuple[Any, Any]:
    r = _amplitude(*primal)
    return r, slopes_once(_amplitude(tangent[0] - to_pair(r) * tangent[1], primal[1]))


class CrossProducts(NamedTuple):
    """conj(x_p) x_s of the amplitudes x of one coherent group of layers."""

    reflected: Any
    passed: Any  # transmitted into the medium below
    passed_twice: Any  # transmitted down and up again
    below: Any  # reflected from below


def cross_products(s: Response, p: Response) -> CrossProducts:
    """Return the cross products of layers between media with negligible absorption.

    The product t t′ has modulus T and, except for a factor common to s and p, twice the phase of
    1/denominator.
    """
    ds, dp = to_complex(s.denominator), to_complex(p.denominator)
    product = conj(ds) * dp
    phase = product / abs(product)
    powers = transmittance(p) * transmittance(s)
    return CrossProducts(
        conj(to_complex(p.reflected) / dp) * (to_complex(s.reflected) / ds),
        _root(powers) * phase,
        powers * phase * phase,
        conj(to_complex(p.below) / dp) * (to_complex(s.below) / ds),
    )


def stokes_from_sums(s: Any, p: Any, cross: Any) -> Stokes:
    """Return the Stokes sums from sums over orders of |x_s|², |x_p|² and conj(x_p) x_s (thick plates)."""
    return Stokes(s - p, 2 * real(cross), 2 * imag(cross), s + p)


def normalised(sums: Stokes) -> tuple[Any, Any, Any]:
    """Return N, C, S on the unit sphere; all 0 where nothing is reflected and Ψ and Δ are undefined."""
    dark = sums.intensity < jnp.finfo(jnp.result_type(sums.intensity)).tiny
    # scaled first: the derivative of 1/x contains 1/x², which overflows where little is reflected
    size = stop_gradient(where(dark, 0.0, 1 / where(dark, 1.0, sums.intensity)))
    inverse = where(dark, 0.0, 1 / where(dark, 1.0, sums.intensity * size))
    n, c, s = (x * size * inverse for x in sums[:3])
    return n, c, s


def psi_delta(n: Any, c: Any, s: Any) -> tuple[Any, Any]:
    """Return Ψ in 0 to 90 and Δ in 0 to 360 degrees from N, C, S.

    Where Ψ is 0 or 90, Δ is 0 and its derivatives are 0; where nothing is reflected, all are 0.

    >>> [round(float(x), 1) for x in psi_delta(0.0, -1.0, 0.0)]
    [45.0, 180.0]
    """
    xp, square = namespace(n, c, s), c * c + s * s
    pole = square == 0
    dark = pole & (n == 0)
    across = xp.sqrt(xp.where(pole, 1.0, square)) * xp.where(pole, 0.0, 1.0)
    psi = 0.5 * xp.arctan2(across, xp.where(dark, 1.0, n))
    delta = xp.arctan2(xp.where(pole, 0.0, s), xp.where(pole, 1.0, c))
    wrapped = xp.mod(xp.rad2deg(delta), 360.0)
    # −1e-17 + 360 rounds to 360: such a Δ is 0, with its slope unchanged
    full_turn = stop_gradient(xp.where(wrapped >= 360.0, wrapped, 0.0))
    return xp.rad2deg(psi), wrapped - full_turn


def alpha_beta(n: Any, c: Any, analyser: Any) -> tuple[Any, Any]:
    """Return α and β of a rotating-analyser ellipsometer from N and C; both are blind to the sign of Δ.

    The detector signal is 1 + α cos 2a + β sin 2a, where one polariser turns by a and the other, before
    or behind the sample, stands at `analyser`, in degrees strictly between 0 and 90. Both angles count
    from the plane of incidence, and β has the sign of cos Δ. With A for `analyser`,
    α = (tan²Ψ − tan²A)/(tan²Ψ + tan²A) and β = 2 tanΨ cosΔ tanA/(tan²Ψ + tan²A). Written as
    α = (cos 2A − N)/(1 − N cos 2A) and β = C sin 2A/(1 − N cos 2A) they are finite at Ψ = 0 and 90.
    The function is its own inverse: `alpha_beta(alpha, beta, analyser)` returns N and C.

    **Source:** D. E. Aspnes and A. A. Studna, Appl. Opt. 14, 220 (1975).

    >>> [round(float(x), 6) for x in alpha_beta(*alpha_beta(0.2, -0.6, 30.0), 30.0)]
    [0.2, -0.6]
    """
    twice = 2 * jnp.deg2rad(analyser)
    denominator = 1 - n * jnp.cos(twice)
    return (jnp.cos(twice) - n) / denominator, c * jnp.sin(twice) / denominator


def mueller(jones: Any) -> Any:
    """Return the Mueller matrix (..., 4, 4) of a Jones matrix (..., 2, 2) [[pp, ps], [sp, ss]].

    Rows of the Jones matrix are outgoing, columns incident. The element 1,1 is the mean of the power
    reflectances (or transmittances) of s and p.
    """
    rows = mueller_elements(*(jones[..., i, j] for i in range(2) for j in range(2)))
    xp = namespace(rows)
    return xp.stack([xp.stack(xp.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)


def mueller_elements(pp: Number, ps: Number, sp: Number, ss: Number) -> list[list[Any]]:
    """Return the Mueller matrix, as rows of arrays, of the elements of a Jones matrix."""
    pp, ps, sp, ss = map(to_pair, (pp, ps, sp, ss))
    a, b, c, d = (abs2(x) for x in (pp, ps, sp, ss))
    out_p, out_s = pp * conj(ps), sp * conj(ss)  # both incident polarisations, one outgoing
    in_p, in_s = pp * conj(sp), ps * conj(ss)  # one incident, both outgoing
    same, crossed = pp * conj(ss), ps * conj(sp)
    return [
        [0.5 * (a + b + c + d), 0.5 * (a - b + c - d), real(out_p + out_s), -imag(out_p + out_s)],
        [0.5 * (a + b - c - d), 0.5 * (a - b - c + d), real(out_p - out_s), -imag(out_p - out_s)],
        [real(in_p + in_s), real(in_p - in_s), real(same + crossed), imag(crossed - same)],
        [imag(in_p + in_s), imag(in_p - in_s), imag(same + crossed), real(same - crossed)],
    ]


def normalised_mueller(matrix: Any) -> Any:
    """Return a Mueller matrix (..., 4, 4) divided by its element 1,1; all 0 where there is no light."""
    return matrix * inverse_intensity(matrix[..., :1, :1])


def inverse_intensity(intensity: Any) -> Any:
    """Return 1/m11; 0 where there is no light."""
    dark = intensity < jnp.finfo(intensity.dtype).tiny
    # scaled first: the derivative of 1/x contains 1/x², which overflows where there is little light
    size = stop_gradient(where(dark, 0.0, 1 / where(dark, 1.0, intensity)))
    return size * where(dark, 0.0, 1 / where(dark, 1.0, intensity * size))
