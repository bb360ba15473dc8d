"""2×2 matrices of numbers: real arrays, complex arrays or `Pair`s of arrays (2, 2, ...).

One formula for all elements compiles to a fraction of the code of a formula for each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.hoisting import stored
from pellicle.optics.pair import Number, Pair, imag, is_real, real


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

    def joined(part: Callable[[Number], Any]) -> Any:
        return jnp.stack([jnp.broadcast_to(part(x), shape) for x in numbers]).reshape(whole)

    return joined(real) if is_real(numbers) else Pair(joined(real), joined(imag))


def unstacked(number: Number, count: int) -> list[Number]:
    """Return the numbers along the first axis."""

    def at(i: int) -> Number:
        return jax.tree.map(lambda x: jax.lax.index_in_dim(x, i, keepdims=False), number)

    return [at(i) for i in range(count)]


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
    return jax.tree.map(lambda x: jnp.swapaxes(x[::-1, ::-1], 0, 1) * signs, matrix) * determinant


def one_minus(matrix: Number) -> Number:
    """Return 1 − matrix."""
    return _constant(((1, 0), (0, 1)), matrix) - matrix


def one_plus(matrix: Number) -> Number:
    """Return 1 + matrix."""
    return _constant(((1, 0), (0, 1)), matrix) + matrix


def _constant(rows: tuple[tuple[int, int], ...], matrix: Number) -> Any:
    like = real(matrix)
    return jnp.array(rows, like.dtype).reshape(2, 2, *[1] * (like.ndim - 2))
