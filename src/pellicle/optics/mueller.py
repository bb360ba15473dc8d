"""Mueller matrices of samples that do not depolarise, from their Jones matrices.

Stokes vectors are those of instruments: S₁ is the intensity of p minus that of s, S₂ that at +45° minus that
at −45°, and S₃ has the sign with which the normalised matrix of an isotropic sample is

    [[ 1, −N, 0, 0], [−N, 1, 0, 0], [0, 0, C, S], [0, 0, −S, C]]

with N, C, S of `pellicle.optics.ellipsometry`. In fields that oscillate as exp(−iωt), S₃ is
2 Im(E_p conj E_s).

Mueller matrices of light that adds incoherently add, Jones matrices do not: averages over wavelength,
thickness or angle are taken over Mueller matrices before they are normalised.

Source: R. M. A. Azzam and N. M. Bashara, Ellipsometry and Polarized Light, section 2.12; G. E. Jellison and
F. A. Modine, Appl. Opt. 36, 8184 (1997) for the signs.
"""

from typing import Any

import jax
import jax.numpy as jnp

from pellicle.optics.pair import Number, abs2, conj, imag, real, to_pair


def mueller(jones: Any) -> Any:
    """Return the Mueller matrix (..., 4, 4) of a Jones matrix (..., 2, 2) [[pp, ps], [sp, ss]].

    Rows of the Jones matrix are outgoing, columns incident. The element 1,1 is the mean of the power
    reflectances (or transmittances) of s and p.
    """
    rows = mueller_elements(*(jones[..., i, j] for i in range(2) for j in range(2)))
    return jnp.stack([jnp.stack(jnp.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)


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


def normalised(matrix: Any) -> Any:
    """Return a Mueller matrix (..., 4, 4) divided by its element 1,1; all 0 where there is no light."""
    return matrix * inverse_intensity(matrix[..., :1, :1])


def inverse_intensity(intensity: Any) -> Any:
    """Return 1/m11; 0 where there is no light."""
    dark = intensity < jnp.finfo(intensity.dtype).tiny
    # scaled first: the derivative of 1/x contains 1/x², which overflows where there is little light
    size = jax.lax.stop_gradient(jnp.where(dark, 0.0, 1 / jnp.where(dark, 1.0, intensity)))
    return size * jnp.where(dark, 0.0, 1 / jnp.where(dark, 1.0, intensity * size))
