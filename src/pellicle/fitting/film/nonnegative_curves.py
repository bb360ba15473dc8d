"""Least squares for curves that are not negative on −1..1, given by their Chebyshev coefficients.

Nonnegative Bernstein coefficients would be enough, but are far from needed: they exclude a lamp curve such as
1 − 0.47 T₁ + 0.28 T₂ + 0.08 T₃, which is nowhere below 0.6, and a film is then found that explains it.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from pellicle.fitting.positive_definite import nonnegative

_POSITIONS = 7
_RIDGE = 1e-9
"""Added to the dual problem, as a share of its diagonal: it has more forces than coefficients."""


def nonnegative_curves(matrix, b, degrees: tuple[int, ...], slack: float):
    """Minimise ½ xᵀ `matrix` x − bᵀ x, where x are Chebyshev coefficients of curves that are not negative.

    A curve that bends is held at `_POSITIONS` positions from end to end. So no curve that is nowhere negative
    is excluded; between two positions a parabola may be below zero by an eighth of its coefficient of T₂.

    **Arguments:** `matrix` (n, n), positive definite; `b` (n,); `degrees` of the curves, which have n
    coefficients together; `slack`, by which a curve may be negative before it is held.

    **Returns:** the derivative of x by b (n, n), and x (n,).

    **Source:** J. Nocedal and S. Wright, Numerical optimization (2006), section 16.4 (the dual problem).
    """
    rows = _rows(degrees)
    inverse, unbounded = nonnegative(matrix, b, np.zeros(len(b), bool), slack)
    across, values = rows @ inverse, rows @ unbounded
    gram = across @ rows.T
    gram = gram + jnp.diag(_RIDGE * jnp.diagonal(gram))
    held = values < -slack
    missing = jnp.where(held, -values, -jnp.maximum(values, 0.0))
    reduced, force = nonnegative(gram, missing, np.ones(len(rows), bool), 0.0, held)
    return inverse - across.T @ reduced @ across, unbounded + across.T @ force


def _rows(degrees: tuple[int, ...]) -> np.ndarray:
    """Values of curves at their positions, (positions, coefficients), as multiples of the coefficients."""
    rows, first, count = [], 0, sum(degree + 1 for degree in degrees)
    for degree in degrees:
        at = np.cos(np.linspace(0.0, np.pi, degree + 1 if degree < 2 else _POSITIONS))
        own = np.polynomial.chebyshev.chebvander(at, degree)
        rows.append(np.pad(own, ((0, 0), (first, count - first - degree - 1))))
        first += degree + 1
    return np.vstack(rows)
