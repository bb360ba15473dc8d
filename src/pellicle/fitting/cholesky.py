"""Small positive definite systems, unrolled: under vmap they fuse where LAPACK calls would not."""

from __future__ import annotations

import jax.numpy as jnp


def solve_positive(matrix, b):
    """x with `matrix` x = b, for a positive definite matrix of a few rows.

    A pivot below rounding is held at the smallest number, so a singular matrix gives a large step,
    never a NaN.
    """
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
