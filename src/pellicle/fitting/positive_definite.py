"""Small positive definite systems, solved inside compiled loops.

Apart from the solver, which imports Optimistix: a cached program needs no solver.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax.scipy.linalg import cho_solve

UNROLLED = 4
"""Rows: beyond it the unrolled form's n³ scalar steps take a second and more to compile."""


def solve_positive(matrix, b):
    """x with `matrix` x = b, for a positive definite matrix of a few rows.

    A matrix that is singular to rounding gives a large step or b itself, never a NaN.
    """
    return _unrolled(matrix, b) if b.shape[0] <= UNROLLED else _lapack(matrix, b)


def _lapack(matrix, b):
    x = cho_solve((jnp.linalg.cholesky(matrix), True), b)
    return jnp.where(jnp.all(jnp.isfinite(x)), x, b)


def _unrolled(matrix, b):
    """A pivot below rounding is held at the smallest number."""
    n, tiny = b.shape[0], jnp.finfo(matrix.dtype).tiny
    lower: dict = {}
    for i in range(n):
        for j in range(i + 1):
            s = matrix[i, j] - sum(lower[i, k] * lower[j, k] for k in range(j))
            lower[i, j] = jnp.sqrt(jnp.maximum(s, tiny)) if i == j else s / lower[j, j]
    z: list = [None] * n
    x: list = [None] * n
    for i in range(n):
        z[i] = (b[i] - sum(lower[i, k] * z[k] for k in range(i))) / lower[i, i]
    for i in reversed(range(n)):
        x[i] = (z[i] - sum(lower[k, i] * x[k] for k in range(i + 1, n))) / lower[i, i]
    return jnp.stack(x)
