"""Layers of any permittivity: Berreman's matrix Δ, its four waves and its exponential.

The normal indices of the waves are the roots of det(Δ − q). The exponential, by scaling and squaring, needs
no eigenvectors, so that equal waves are no special case. exp(Z) − 1 is squared in place of exp(Z), so that a
thin layer among thick ones keeps its digits.

Source: N. J. Higham, Functions of Matrices (2008), chapter 10.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.anisotropy import Tensor
from pellicle.optics.berreman.matrices import Fields, Propagation, inverse, matrix, one_minus, stacked
from pellicle.optics.hoisting import stored
from pellicle.optics.pair import Number, Pair, cond, fori_loop, namespace, stop_gradient, to_complex, where


class Delta(NamedTuple):
    """Elements of Δ = ((m, A, n, 0), (B, m, C, 0), (0, 0, 0, 1), (C, n, D, 0)), for (Ex, Hy, Ey, −Hx)."""

    A: Number
    B: Number
    C: Number
    D: Number
    m: Number
    n: Number


def delta(epsilon: Tensor, a: Any) -> Delta:
    """Return Δ of a permittivity at a transverse index a."""
    a = getattr(a, "index", a)
    inverse_zz = 1 / epsilon.zz
    x, y = epsilon.xz * inverse_zz, epsilon.yz * inverse_zz
    return Delta(
        A=1 - a * a * inverse_zz,
        B=epsilon.xx - epsilon.xz * x,
        C=epsilon.xy - epsilon.xz * y,
        D=epsilon.yy - epsilon.yz * y - a * a,
        m=-a * x,
        n=-a * y,
    )


def half_space(of: Delta, total: Number, product: Number, like: Any) -> Number:
    """Return the reflection matrix Γ of a substrate against free space at normal incidence.

    **Arguments:** sum and product of the normal indices q₁ and q₂ of its two downward waves. As no more is
    needed of these, equal waves are no special case.

    With H = Y E of the tangential fields, (Δ − q₁)(Δ − q₂) = 0 on downward waves is linear in Y:
    [S(S − 2m)A − n²] Y₁ = S (AB + m² + P − Sm, AC + mn − Sn) + n (C, D + P) for its first row, and
    S Y₂ = (C, D + P) + n Y₁. Γ = (1 − Y)(1 + Y)⁻¹ = 2 (1 + Y)⁻¹ − 1 is finite where Y is not.
    """
    A, B, C, D, m, n = of
    S, P = total, product
    scale = S * (S - 2 * m) * A - n * n
    second = C, D + P
    first = S * (A * B + m * (m - S) + P) + n * second[0], S * (A * C + n * (m - S)) + n * second[1]
    below = scale * second[0] + n * first[0], scale * second[1] + n * first[1]
    one_plus_Y = matrix(scale + first[0], first[1], below[0], scale * S + below[1], like=like)
    columns = stacked(2 * scale, 2 * scale * S, like=like)
    return -one_minus(inverse(stored(one_plus_Y)) * columns)


STEPS = 30
"""Steps of the simultaneous iteration. It converges cubically, and linearly to equal roots."""


def coefficients(epsilon: Tensor, a: Any) -> Any:
    """Return the coefficients of q³, q², q and 1 of det(Δ − q), an array (4, ...); that of q⁴ is 1."""
    A, B, C, D, m, n = map(to_complex, delta(epsilon, a))
    last = D * (A * B - m * m) + 2 * C * n * m - A * C * C - B * n * n
    xp = namespace(last)
    return xp.stack(xp.broadcast_arrays(-2 * m, m * m - A * B - D, 2 * (m * D - C * n), last))


def four_roots(epsilon: Tensor, a: Any) -> Any:
    """Return the four roots, an array (4, ...), in the order of falling Im q: two down, then two up.

    For signs and sizes: they are not differentiated, and are those of a medium with a little absorption, so
    that also a wave without losses decays in the direction in which it carries power.
    """
    eps = float(jnp.finfo(jnp.result_type(*jax.tree.leaves(epsilon))).eps)
    lossy = Tensor(*(to_complex(x) * (1 + 1j * eps**0.4) for x in epsilon))
    c3, c2, c1, c0 = c = stop_gradient(coefficients(lossy, a))
    xp = namespace(c)
    size = 1 + abs(c).max(axis=0) ** 0.5
    start = xp.stack([size * np.exp(1j * (0.4 + 0.5 * np.pi * j)) for j in range(4)])

    def improve(_: Any, x: Any) -> Any:
        value = (((x + c3) * x + c2) * x + c1) * x + c0
        slope = ((4 * x + 3 * c3) * x + 2 * c2) * x + c1
        gap = x[:, None] - x[None]
        repulsion = xp.where(gap == 0, 0, 1 / xp.where(gap == 0, 1, gap)).sum(axis=1)
        divisor = slope - value * repulsion
        return x - where(divisor == 0, 0, value / where(divisor == 0, 1, divisor))

    roots = fori_loop(0, STEPS, improve, start.astype(c.dtype))
    return xp.take_along_axis(roots, xp.argsort(-roots.imag, axis=0), axis=0)


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
        a11, a12, a21, a22 = map(stop_gradient, (a11, a12, a21, a22))
        determinant = a11 * a22 - a12 * a21
        scale = where(determinant == 0, 0, 1 / where(determinant == 0, 1, determinant))
        return S - (a22 * first - a12 * second) * scale, P - (a11 * second - a21 * first) * scale

    S, P = roots[0] + roots[1], roots[0] * roots[1]
    for _ in range(4):
        S, P = map(stop_gradient, step(S, P, c3, c2, c1, c0))
    return step(S, P, c3, c2, c1, c0)


FEW, MOST = 7, 28
"""Squarings: up to FEW (a phase of 60), or up to MOST where an element of the arrays needs more."""


def dichroism(medium: Tensor, a: Any) -> Any:
    """Return by how much the extinctions Im q of the two waves differ, the larger of both directions."""
    q = four_roots(medium, a).imag
    return namespace(q).maximum(q[0] - q[1], q[2] - q[3])


def propagation(medium: Tensor, a: Any, k: Any, direction: Any = 1.0) -> Propagation:
    """Return the propagation through a layer of k = k₀d; `direction` as for `uniaxial.propagation`."""
    A, B, C, D, m, n = map(to_complex, delta(medium, a))
    roots = four_roots(medium, a)
    m, n = m * direction, n * direction
    xp = namespace(roots)
    extinction = xp.where(direction > 0, roots.imag.max(axis=0), -roots.imag.min(axis=0))
    zero, one = xp.zeros_like(A), xp.ones_like(A)
    rows = ((m, A, n, zero), (B, m, C, zero), (zero, zero, zero, one), (C, n, D, zero))
    elements = xp.broadcast_arrays(*(x for row in rows for x in row), k, extinction)[:16]
    matrix = xp.stack(elements).reshape(4, 4, *elements[0].shape)
    # H in units of n E, so that rows and columns have similar sizes
    size = stop_gradient(abs(matrix))
    index = xp.sqrt(xp.maximum(size.max(axis=(0, 1)), 1.0))
    sides = (1.0, index, 1.0, index)
    balance = xp.stack([xp.stack([sides[j] / sides[i] + 0 * index for j in range(4)]) for i in range(4)])
    identity = xp.eye(4, dtype=index.dtype).reshape(4, 4, *[1] * index.ndim)
    growth = stop_gradient(extinction * k) + 0 * index
    exponent = -1j * k * matrix * balance - growth * identity
    norm = abs(stop_gradient(exponent)).sum(axis=1).max(axis=0)
    count = xp.ceil(xp.log2(xp.maximum(2 * norm, 1.0)))
    small = exponent * xp.exp2(-count)

    def product(one: Any, other: Any) -> Any:
        return (one[:, :, None] * other[None]).sum(axis=1)

    # Horner's rule, in a loop: unrolled, it takes a minute to compile with its derivatives
    terms = 14 if jnp.finfo(growth.dtype).bits == 64 else 8

    def add_term(i: Any, rest: Any) -> Any:
        return (small + product(small, rest)) / (terms - i)

    rest = fori_loop(0, terms, add_term, xp.zeros_like(small))

    def square(i: Any, rest: Any) -> Any:
        return where(i < count, 2 * rest + product(rest, rest), rest)

    rest = fori_loop(0, FEW, square, rest)
    more = lambda rest: fori_loop(FEW, MOST, square, rest)  # noqa: E731
    rest = cond(xp.any(count > FEW), more, lambda rest: rest, rest)
    whole = (rest + identity) / balance

    def apply(fields: Fields) -> Fields:
        vector = [to_complex(x) for x in fields]
        results = [sum(whole[i, j] * vector[j] for j in range(4)) for i in range(4)]
        Ex, Hy, Ey, Hx = (Pair(x.real, x.imag) for x in results)
        return Ex, Hy, Ey, Hx

    return Propagation(apply, growth)
