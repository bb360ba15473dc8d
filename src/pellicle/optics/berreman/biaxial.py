"""Layers of any permittivity: the exponential of Berreman's matrix by scaling and squaring.

Without eigenvectors, equal waves are no special case. exp(Z) − 1 is squared in place of exp(Z), so that a
thin layer among thick ones keeps its digits.

Source: N. J. Higham, Functions of Matrices (2008), chapter 10.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import Tensor
from pellicle.optics.berreman.delta import delta
from pellicle.optics.berreman.propagation import Fields, Propagation
from pellicle.optics.berreman.quartic import four_roots
from pellicle.optics.pair import Pair, to_complex

FEW, MOST = 7, 28
"""Squarings: up to FEW (a phase of 60), or up to MOST where an element of the arrays needs more."""


def dichroism(medium: Tensor, a: Any) -> Any:
    """Return by how much the extinctions Im q of the two waves differ, the larger of both directions."""
    q = four_roots(medium, a).imag
    return jnp.maximum(q[0] - q[1], q[2] - q[3])


def propagation(medium: Tensor, a: Any, k: Any, direction: Any = 1.0) -> Propagation:
    """Return the propagation through a layer of k = k₀d; `direction` as for `uniaxial.propagation`."""
    A, B, C, D, m, n = map(to_complex, delta(medium, a))
    roots = four_roots(medium, a)
    m, n = m * direction, n * direction
    extinction = jnp.where(direction > 0, jnp.max(roots.imag, axis=0), -jnp.min(roots.imag, axis=0))
    zero, one = jnp.zeros_like(A), jnp.ones_like(A)
    rows = ((m, A, n, zero), (B, m, C, zero), (zero, zero, zero, one), (C, n, D, zero))
    elements = jnp.broadcast_arrays(*(x for row in rows for x in row), k, extinction)[:16]
    matrix = jnp.stack(elements).reshape(4, 4, *elements[0].shape)
    # H in units of n E, so that rows and columns have similar sizes
    size = jax.lax.stop_gradient(jnp.abs(matrix))
    index = jnp.sqrt(jnp.maximum(jnp.max(size, axis=(0, 1)), 1.0))
    sides = (1.0, index, 1.0, index)
    balance = jnp.stack([jnp.stack([sides[j] / sides[i] + 0 * index for j in range(4)]) for i in range(4)])
    identity = jnp.eye(4, dtype=index.dtype).reshape(4, 4, *[1] * index.ndim)
    growth = jax.lax.stop_gradient(extinction * k) + 0 * index
    exponent = -1j * k * matrix * balance - growth * identity
    norm = jnp.max(jnp.sum(jnp.abs(jax.lax.stop_gradient(exponent)), axis=1), axis=0)
    count = jnp.ceil(jnp.log2(jnp.maximum(2 * norm, 1.0)))
    small = exponent * jnp.exp2(-count)

    def product(one: Any, other: Any) -> Any:
        return jnp.sum(one[:, :, None] * other[None], axis=1)

    # Horner's rule, in a loop: unrolled, it takes a minute to compile with its derivatives
    terms = 14 if jnp.finfo(growth.dtype).bits == 64 else 8

    def add_term(i: Any, rest: Any) -> Any:
        return (small + product(small, rest)) / (terms - i)

    rest = jax.lax.fori_loop(0, terms, add_term, jnp.zeros_like(small))

    def square(i: Any, rest: Any) -> Any:
        return jnp.where(i < count, 2 * rest + product(rest, rest), rest)

    rest = jax.lax.fori_loop(0, FEW, square, rest)
    more = lambda rest: jax.lax.fori_loop(FEW, MOST, square, rest)  # noqa: E731
    rest = jax.lax.cond(jnp.any(count > FEW), more, lambda rest: rest, rest)
    whole = (rest + identity) / balance

    def apply(fields: Fields) -> Fields:
        vector = [to_complex(x) for x in fields]
        results = [sum(whole[i, j] * vector[j] for j in range(4)) for i in range(4)]
        Ex, Hy, Ey, Hx = (Pair(jnp.real(x), jnp.imag(x)) for x in results)
        return Ex, Hy, Ey, Hx

    return Propagation(apply, growth)
