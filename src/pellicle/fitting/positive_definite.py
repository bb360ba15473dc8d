"""Small positive definite systems, solved inside compiled loops."""

import jax
import jax.numpy as jnp
from jax.scipy.linalg import cho_solve

UNROLLED = 4
"""Rows: beyond it the unrolled form's n³ scalar steps take a second and more to compile."""


def solve_positive(matrix, b):
    """x with `matrix` x = b, for a positive definite matrix of a few rows.

    A matrix that is singular to rounding gives a large step or b itself, never a NaN.
    """
    if b.shape[0] <= UNROLLED:
        return _unrolled(matrix, b, 0.0)[0]
    return _lapack(matrix, b)[0]


def solve_if_positive(matrix, b):
    """x with `matrix` x = b, and whether the matrix is positive definite; else x is of no use but finite."""
    if b.shape[0] <= UNROLLED:
        return _unrolled(matrix, b, 50 * float(jnp.finfo(matrix.dtype).eps))
    return _lapack(matrix, b)


def _lapack(matrix, b):
    x = cho_solve((jnp.linalg.cholesky(matrix), True), b)
    positive = jnp.all(jnp.isfinite(x))
    return jnp.where(positive, x, b), positive


def _unrolled(matrix, b, least):
    """A pivot below the share `least` of its diagonal element is held there; False where there is one."""
    n, tiny, positive = b.shape[0], jnp.finfo(matrix.dtype).tiny, jnp.array(True)
    lower: dict = {}
    for i in range(n):
        for j in range(i + 1):
            s = matrix[i, j] - sum(lower[i, k] * lower[j, k] for k in range(j))
            if i == j:
                floor = jnp.maximum(least * jnp.abs(matrix[i, i]), tiny)
                positive = positive & (s > floor)
                s = jnp.sqrt(jnp.maximum(s, floor))
            else:
                s = s / lower[j, j]
            lower[i, j] = s
    z: list = [None] * n
    x: list = [None] * n
    for i in range(n):
        z[i] = (b[i] - sum(lower[i, k] * z[k] for k in range(i))) / lower[i, i]
    for i in reversed(range(n)):
        x[i] = (z[i] - sum(lower[k, i] * x[k] for k in range(i + 1, n))) / lower[i, i]
    return jnp.stack(x), positive


def nonnegative(matrix, b, bounded, slack: float, free=None):
    """Minimise ½ xᵀ `matrix` x − bᵀ x with x ≥ 0 where `bounded`, for a positive definite matrix.

    Block principal pivoting: all variables that violate their sign or that of their slope change sides at
    once; where that no longer reduces their number, only the last of them, which ends in any case. Most
    problems take one or two rounds, however many variables are bounded.

    **Arguments:** `matrix` (n, n); `b` (n,); `bounded` (n,) booleans; `slack`, by which a variable may be
    negative before it counts as violating; `free`, the variables that are not at zero at first, all if None.

    **Returns:** the inverse of the matrix of the free variables, with zeros for those held at zero, and x.

    **Source:** J. Kim and H. Park, SIAM J. Sci. Comput. 33, 3261 (2011).
    """
    n, position = len(b), jnp.arange(len(b))

    def solved(free):
        inverse = _inverse(matrix, free)
        x = inverse @ b
        return inverse, x + inverse @ (b - matrix @ x)

    def violating(free, x):
        slope = matrix @ x - b
        rounding = 64 * jnp.finfo(x.dtype).eps * (jnp.abs(matrix) @ jnp.abs(x) + jnp.abs(b))
        return bounded & jnp.where(free, x < -slack, slope < -rounding)

    def unfinished(state):
        *_, count, rounds = state
        return (count > 0) & (rounds < 8 * n)

    def exchange(state):
        free, _, _, fewest, patience, _, rounds = state
        inverse, x = solved(free)
        wrong = violating(free, x)
        count = jnp.sum(wrong)
        patience = jnp.where(count < fewest, 3, patience - 1)
        last = position == jnp.max(jnp.where(wrong, position, -1))
        free = free ^ (wrong & (last | (patience > 0)))
        return free, inverse, x, jnp.minimum(count, fewest), patience, count, rounds + 1

    free = jnp.ones(n, bool) if free is None else free
    if not any(bounded):
        return solved(free)
    start = (free, jnp.zeros_like(matrix), jnp.zeros_like(b), n + 1, 3, n, 0)
    _, inverse, x, *_ = jax.lax.while_loop(unfinished, exchange, start)
    return inverse, x


def _inverse(matrix, free):
    """Inverse of the rows and columns of `matrix` that are `free`, zero elsewhere, by the sweep operator."""
    size = jax.lax.rsqrt(jnp.diagonal(matrix))
    scaled = matrix * size * size[:, None]
    position, tiny = jnp.arange(len(scaled)), jnp.finfo(scaled.dtype).tiny

    def sweep(k, scaled):
        row, column = position[:, None] == k, position == k
        across = jnp.sum(jnp.where(row, scaled, 0.0), axis=0)
        inverse = 1 / jnp.maximum(jnp.sum(jnp.where(column, across, 0.0)), tiny)
        ratio = across * inverse
        swept = scaled - across[:, None] * ratio
        swept = jnp.where(row, ratio, jnp.where(column, ratio[:, None], swept))
        swept = jnp.where(row & column, -inverse, swept)
        return jnp.where(jnp.any(free & column), swept, scaled)

    swept = jax.lax.fori_loop(0, len(scaled), sweep, scaled)
    return jnp.where(free & free[:, None], -swept * size * size[:, None], 0.0)
