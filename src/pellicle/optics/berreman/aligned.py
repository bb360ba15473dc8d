"""Layers whose principal axes are those of the laboratory: s and p each have a 2×2 matrix."""

from typing import Any

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import Principal
from pellicle.optics.berreman.matrices import Fields, Propagation, elements_and_exponents, exp, full, matrix
from pellicle.optics.characteristic import nonzero_root
from pellicle.optics.interface import normal_square
from pellicle.optics.pair import Number, real, times_i


def _numbers(medium: Any, a: Any) -> tuple[Number, Number, Number]:
    """Return q² of p and of s, and ε along x."""
    x, y, z = medium if isinstance(medium, Principal) else (medium, medium, medium)
    ratio = x * x / (z * z) if isinstance(medium, Principal) else 1.0
    return normal_square(z, a) * ratio, normal_square(y, a), x * x


def half_space(medium: Any, a: Any, like: Any) -> Number:
    """Return the reflection matrix of a substrate against free space at normal incidence."""
    Q_p, Q_s, epsilon = _numbers(medium, a)
    p, s = nonzero_root(full(Q_p)), nonzero_root(full(Q_s))
    zero = 0.0 * p
    return matrix((p - epsilon) / (p + epsilon), zero, zero, (1 - s) / (1 + s), like=like)


def propagation(medium: Any, a: Any, k: Any) -> Propagation:
    """Return the propagation through a layer of k = k₀d."""
    Q_p, Q_s, epsilon = _numbers(medium, a)
    squares = (Q_p, Q_s) if isinstance(medium, Principal) else (Q_p,)
    (c, f, exponent), *of_s = elements_and_exponents(squares, k)
    if of_s:
        ((c_s, f_s, exponent_s),) = of_s
        growth = jax.lax.stop_gradient(jnp.maximum(-real(exponent), -real(exponent_s)))
        factor_s = exp(-exponent_s - growth)
    else:
        c_s, f_s, growth, factor_s = c, f, jax.lax.stop_gradient(-real(exponent)), None
    factor = exp(-exponent - growth)
    factor_s = factor if factor_s is None else factor_s
    c, f, c_s, f_s = c * factor, times_i(-f) * factor, c_s * factor_s, times_i(-f_s) * factor_s
    down_p, up_p, down_s = f * (Q_p / epsilon), f * epsilon, f_s * Q_s

    def apply(fields: Fields) -> Fields:
        Ex, Hy, Ey, Hx = fields
        return c * Ex + down_p * Hy, c * Hy + up_p * Ex, c_s * Ey + f_s * Hx, c_s * Hx + down_s * Ey

    return Propagation(apply, growth)
