"""Berreman's matrix Δ of a medium, and the reflection of light from a substrate of any orientation."""

from __future__ import annotations

from typing import Any, NamedTuple

from pellicle.optics.anisotropy import Tensor
from pellicle.optics.berreman.matrices import inverse, matrix, one_minus, stacked
from pellicle.optics.hoisting import stored
from pellicle.optics.pair import Number


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
