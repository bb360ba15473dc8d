"""Normal indices of the four waves in a medium of any permittivity: the roots of det(Δ − q)."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import Tensor
from pellicle.optics.berreman.delta import delta
from pellicle.optics.pair import to_complex

STEPS = 30
"""Steps of the simultaneous iteration. It converges cubically, and linearly to equal roots."""


def coefficients(epsilon: Tensor, a: Any) -> Any:
    """Return the coefficients of q³, q², q and 1 of det(Δ − q), an array (4, ...); that of q⁴ is 1."""
    A, B, C, D, m, n = map(to_complex, delta(epsilon, a))
    last = D * (A * B - m * m) + 2 * C * n * m - A * C * C - B * n * n
    return jnp.stack(jnp.broadcast_arrays(-2 * m, m * m - A * B - D, 2 * (m * D - C * n), last))


def four_roots(epsilon: Tensor, a: Any) -> Any:
    """Return the four roots, an array (4, ...), in the order of falling Im q: two down, then two up.

    For signs and sizes: they are not differentiated, and are those of a medium with a little absorption, so
    that also a wave without losses decays in the direction in which it carries power.
    """
    eps = float(jnp.finfo(jnp.result_type(*jax.tree.leaves(epsilon))).eps)
    lossy = Tensor(*(to_complex(x) * (1 + 1j * eps**0.4) for x in epsilon))
    c3, c2, c1, c0 = c = jax.lax.stop_gradient(coefficients(lossy, a))
    size = 1 + jnp.max(jnp.abs(c), axis=0) ** 0.5
    start = jnp.stack([size * jnp.exp(1j * (0.4 + 0.5 * jnp.pi * j)) for j in range(4)])

    def improve(_: Any, x: Any) -> Any:
        value = (((x + c3) * x + c2) * x + c1) * x + c0
        slope = ((4 * x + 3 * c3) * x + 2 * c2) * x + c1
        gap = x[:, None] - x[None]
        repulsion = jnp.sum(jnp.where(gap == 0, 0, 1 / jnp.where(gap == 0, 1, gap)), axis=1)
        divisor = slope - value * repulsion
        return x - jnp.where(divisor == 0, 0, value / jnp.where(divisor == 0, 1, divisor))

    roots = jax.lax.fori_loop(0, STEPS, improve, start.astype(c.dtype))
    return jnp.take_along_axis(roots, jnp.argsort(-roots.imag, axis=0), axis=0)


def downward_pair(epsilon: Tensor, a: Any) -> tuple[Any, Any]:
    """Return the sum and the product of the normal indices of the two downward waves.

    The quartic is split into two quadratic factors, whose coefficients are smooth where waves of one
    direction are equal. Newton's method finds them; a last step with a constant matrix carries the
    derivatives.
    """
    roots = four_roots(epsilon, a)
    c3, c2, c1, c0 = coefficients(epsilon, a)

    def step(S: Any, P: Any, c3: Any, c2: Any, c1: Any, c0: Any) -> tuple[Any, Any]:
        S_up = -c3 - S
        P_up = c2 - P - S * S_up
        first, second = S * P_up + S_up * P + c1, P * P_up - c0
        turn = 2 * S + c3  # ∂P_up/∂S = S − S_up
        a11, a12, a21, a22 = P_up - P + S * turn, S_up - S, P * turn, P_up - P
        a11, a12, a21, a22 = map(jax.lax.stop_gradient, (a11, a12, a21, a22))
        determinant = a11 * a22 - a12 * a21
        scale = jnp.where(determinant == 0, 0, 1 / jnp.where(determinant == 0, 1, determinant))
        return S - (a22 * first - a12 * second) * scale, P - (a11 * second - a21 * first) * scale

    S, P = roots[0] + roots[1], roots[0] * roots[1]
    for _ in range(4):
        S, P = jax.lax.stop_gradient(step(S, P, c3, c2, c1, c0))
    return step(S, P, c3, c2, c1, c0)
