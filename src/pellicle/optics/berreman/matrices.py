"""2×2 matrices of numbers: real arrays, complex arrays or `Pair`s of arrays (2, 2, ...).

One formula for all elements compiles to a fraction of the code of a formula for each of them.

They propagate the tangential fields through a homogeneous layer. The fields are ψ = (Ex, Hy, Ey, −Hx) with H
in units of E over the impedance of free space and the time factor exp(−iωt); they obey dψ/dz = i k₀ Δ ψ.
Source: D. W. Berreman, J. Opt. Soc. Am. 62, 502 (1972).
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.characteristic import (
    Characteristic,
    element_slopes,
    is_real_array,
    matrix_elements,
    scale_exponent,
)
from pellicle.optics.hoisting import stored
from pellicle.optics.pair import Number, Pair, custom_jvp, imag, is_real, namespace, real
from pellicle.optics.special import sincos


class Elements(NamedTuple):
    """Elements of a matrix ((pp, ps), (sp, ss))."""

    pp: Number
    ps: Number
    sp: Number
    ss: Number


def stacked(*numbers: Number, like: Any = 0.0) -> Number:
    """Return numbers along a new first axis, as a real array or a `Pair`.

    Behind that axis there are at least as many as `like` has, a pytree of arrays.
    """
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in jax.tree.leaves(numbers)))
    rank = max(map(jnp.ndim, jax.tree.leaves(like)))
    whole = len(numbers), *[1] * (rank - len(shape)), *shape
    xp = namespace(numbers, like)

    def joined(part: Callable[[Number], Any]) -> Any:
        return xp.stack([xp.broadcast_to(part(x), shape) for x in numbers]).reshape(whole)

    return joined(real) if is_real(numbers) else Pair(joined(real), joined(imag))


def unstacked(number: Number, count: int) -> list[Number]:
    """Return the numbers along the first axis."""

    def row(x: Any, i: int) -> Any:
        return x[i] if namespace(x) is np else jax.lax.index_in_dim(x, i, keepdims=False)

    return [jax.tree.map(lambda x, i=i: row(x, i), number) for i in range(count)]


def matrix(*elements: Number, like: Any = 0.0) -> Number:
    """Return the matrix of the elements pp, ps, sp and ss; `like` as for `stacked`."""
    every = stacked(*elements, like=like)
    return jax.tree.map(lambda x: x.reshape(2, 2, *x.shape[1:]), every)


def elements(matrix: Number) -> Elements:
    """Return the elements of a matrix."""
    return Elements(*(x for row in unstacked(matrix, 2) for x in unstacked(row, 2)))


def block(matrix: Number, rows: slice, columns: slice) -> Number:
    """Return rows and columns of a matrix."""
    return jax.tree.map(lambda x: x[rows, columns], matrix)


def product(one: Number, other: Number) -> Number:
    """Return the product of two matrices."""
    every, first, second = slice(None), slice(0, 1), slice(1, 2)
    return block(one, every, first) * block(other, first, every) + block(one, every, second) * block(
        other, second, every
    )


def inverse(matrix: Number) -> Number:
    """Return the inverse."""
    pp, ps, sp, ss = elements(matrix)
    determinant = stored(1 / (pp * ss - ps * sp))
    signs = _constant(((1, -1), (-1, 1)), matrix)
    return jax.tree.map(lambda x: x[::-1, ::-1].swapaxes(0, 1) * signs, matrix) * determinant


def one_minus(matrix: Number) -> Number:
    """Return 1 − matrix."""
    return _constant(((1, 0), (0, 1)), matrix) - matrix


def one_plus(matrix: Number) -> Number:
    """Return 1 + matrix."""
    return _constant(((1, 0), (0, 1)), matrix) + matrix


def _constant(rows: tuple[tuple[int, int], ...], matrix: Number) -> Any:
    like = real(matrix)
    return namespace(like).array(rows, like.dtype).reshape(2, 2, *[1] * (like.ndim - 2))


Fields = tuple[Number, Number, Number, Number]
"""Ex, Hy, Ey and −Hx."""


class Propagation(NamedTuple):
    """exp(−i k₀ d Δ), which takes the fields at the lower face to the upper one, times exp(−growth)."""

    apply: Callable[[Fields], Fields]
    growth: Any  # real: the exponent of the mode that grows most


def full(number: Number) -> Pair:
    """Return a number as a `Pair` of two arrays, which promises nothing."""
    return Pair(namespace(number).asarray(real(number)) * 1.0, imag(number) + 0.0 * real(number))


def exp(z: Number) -> Number:
    """Return the exponential of a real array or a `Pair`."""
    xp = namespace(z)
    if not isinstance(z, Pair):
        return xp.exp(real(z))
    sine, cosine = sincos(z.im)
    if z.re is None:
        return Pair(cosine, sine)
    size = xp.exp(z.re)
    return Pair(size * cosine, size * sine)


def elements_and_exponents(squares: Sequence[Number], k: Any) -> Iterator[tuple[Number, Number, Number]]:
    """Return c and f times e^x, and x, whose slope is that of the scale, of each Q: see `matrix_elements`."""
    Q = stacked(*squares, like=k)
    scaled = _stored_elements(Q, k)
    exponent = stored((_real_exponent if is_real_array(Q) else scale_exponent)(Q, k))
    return zip(*(unstacked(x, len(squares)) for x in (scaled.c, scaled.f, exponent)), strict=True)


@custom_jvp
def _stored_elements(Q: Number, k: Any) -> Characteristic:
    return stored(matrix_elements(Q, k))


@_stored_elements.defjvp
def _stored_element_slopes(primal: Any, tangent: Any) -> tuple[Characteristic, Characteristic]:
    values, slopes = element_slopes(_stored_elements, primal, tangent)
    return values, stored(slopes)


@custom_jvp
def _real_exponent(Q: Any, k: Any) -> Any:
    """Return x for a real Q: 0 where the wave propagates, −k√−Q where it is evanescent."""
    xp = namespace(Q, k)
    return xp.where(Q < 0, -k * xp.sqrt(xp.abs(Q)), 0.0)


@_real_exponent.defjvp
def _real_exponent_slope(primal: Any, tangent: Any) -> tuple[Any, Any]:
    (Q, k), (dQ, dk) = primal, tangent
    varies = (Q < 0) & (jnp.abs(k * k * Q) >= 0.01)  # as in `matrix_elements`
    root = jnp.sqrt(jnp.where(varies, -Q, 1.0))
    return _real_exponent(Q, k), jnp.where(varies, (Q * dk + 0.5 * k * dQ) / root, 0.0)
