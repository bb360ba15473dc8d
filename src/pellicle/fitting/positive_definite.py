"""Small positive definite systems, solved side by side or inside compiled loops."""

import jax
import numpy as np

from pellicle.fitting.normal_equations import times
from pellicle.optics.pair import fori_loop, namespace, while_loop


def solve_positive(matrix, b, least=0.0):
    """x (..., n) with `matrix` (..., n, n) x = `b`, and whether each small matrix is positive definite.

    A pivot below the share `least` of its diagonal element is held there, and the matrix is not positive
    definite: x is then of no use, a large step, but never a NaN. Arrays of NumPy or of JAX.

    Eliminated in a loop of the compiled program, which an unrolled form makes half as long again.
    """
    xp, n = namespace(matrix), b.shape[-1]
    position, tiny = np.arange(n), np.finfo(matrix.dtype).tiny
    floor = xp.maximum(least * xp.abs(xp.diagonal(matrix, axis1=-2, axis2=-1)), tiny)

    def at(array, k, axis=-1):
        if xp is np:
            return array.take(k, axis)
        return jax.lax.dynamic_index_in_dim(array, k, axis, keepdims=False)

    def eliminated(k, carry):
        rest, positive = carry
        row, least = at(rest, k, -2), at(floor, k)
        pivot = at(row, k)
        below = xp.where(position > k, at(rest, k), 0) / xp.maximum(pivot, least)[..., None]
        return rest - below[..., None] * row[..., None, :], positive & (pivot > least)

    def substituted(i, x):
        k = n - 1 - i
        row = at(rest, k, -2)
        known = xp.sum(row[..., :n] * x, axis=-1)
        x_k = (row[..., n] - known) / xp.maximum(at(row, k), at(floor, k))
        return xp.where(position == k, x_k[..., None], x)

    system = xp.concatenate([matrix, b[..., None]], axis=-1)
    rest, positive = fori_loop(0, n, eliminated, (system, xp.ones(b.shape[:-1], bool)))
    return fori_loop(0, n, substituted, xp.zeros_like(b)), positive


def nonnegative(matrix, b, bounded, slack: float, free=None):
    """Minimise ½ xᵀ `matrix` x − bᵀ x with x ≥ 0 where `bounded`, for positive definite matrices.

    Block principal pivoting: all variables that violate their sign or that of their slope change sides at
    once; where that no longer reduces their number, only the last of them, which ends in any case. Most
    problems take one or two rounds, however many variables are bounded.

    **Arguments:** `matrix` (..., n, n); `b` (..., n); `bounded` (n,) booleans; `slack`, by which a variable
    may be negative before it counts as violating; `free` (..., n), the variables that are not at zero at
    first, all if None. Arrays of NumPy or of JAX.

    **Returns:** the inverse of the matrix of the free variables, with zeros for those held at zero, and x.

    **Source:** J. Kim and H. Park, SIAM J. Sci. Comput. 33, 3261 (2011).
    """
    xp, n = namespace(matrix, b), b.shape[-1]
    position = np.arange(n)

    def solved(free):
        inverse = _inverse(matrix, free)
        x = times(inverse, b)
        return inverse, x + times(inverse, b - times(matrix, x))

    def violating(free, x):
        slope = times(matrix, x) - b
        rounding = 64 * np.finfo(x.dtype).eps * (times(xp.abs(matrix), xp.abs(x)) + xp.abs(b))
        return bounded & xp.where(free, x < -slack, slope < -rounding)

    def unfinished(state):
        *_, count, rounds = state
        return xp.any(count > 0) & (rounds < 8 * n)

    def exchange(state):
        free, _, _, fewest, patience, _, rounds = state
        inverse, x = solved(free)
        wrong = violating(free, x)
        count = xp.sum(wrong, axis=-1)
        patience = xp.where(count < fewest, 3, patience - 1)
        last = position == xp.max(xp.where(wrong, position, -1), axis=-1, keepdims=True)
        free = free ^ (wrong & (last | (patience[..., None] > 0)))
        return free, inverse, x, xp.minimum(count, fewest), patience, count, rounds + 1

    free = xp.ones(b.shape, bool) if free is None else free
    if not any(bounded):
        return solved(free)
    many = xp.full(b.shape[:-1], n)
    start = (free, xp.zeros_like(matrix), xp.zeros_like(b), many + 1, xp.full_like(many, 3), many, 0)
    _, inverse, x, *_ = while_loop(unfinished, exchange, start)
    return inverse, x


def _inverse(matrix, free):
    """Inverse of the rows and columns of `matrix` that are `free`, zero elsewhere, by the sweep operator."""
    xp, n = namespace(matrix, free), matrix.shape[-1]
    size = 1 / xp.sqrt(xp.diagonal(matrix, axis1=-2, axis2=-1))
    sizes = size[..., None] * size[..., None, :]
    position, tiny = np.arange(n), np.finfo(matrix.dtype).tiny

    def sweep(k, scaled):
        row, column = position[:, None] == k, position == k
        across = xp.sum(xp.where(row, scaled, 0.0), axis=-2)
        pivot = xp.sum(xp.where(column, across, 0.0), axis=-1, keepdims=True)
        inverse = 1 / xp.maximum(pivot, tiny)
        ratio = across * inverse
        swept = scaled - across[..., None] * ratio[..., None, :]
        swept = xp.where(row, ratio[..., None, :], xp.where(column, ratio[..., None], swept))
        swept = xp.where(row & column, -inverse[..., None], swept)
        return xp.where(xp.any(free & column, axis=-1)[..., None, None], swept, scaled)

    swept = fori_loop(0, n, sweep, matrix * sizes)
    return xp.where(free[..., None] & free[..., None, :], -swept * sizes, 0.0)
