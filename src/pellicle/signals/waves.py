"""Signals of simulated light: traced functions of Stokes sums, Jones and Mueller matrices.

Apart from the other modules of signals, which import no JAX.
"""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.optics import ellipsometry
from pellicle.optics.ellipsometry import inverse_intensity, mueller_elements
from pellicle.optics.hoisting import stack_rows, stored
from pellicle.optics.pair import Number, abs2, conj, imag, inverse_root, namespace, real, where

Matrix = Sequence[Sequence[Any]]
"""Elements of a Mueller matrix, row by row."""


def columns(rows: Any, chosen: Sequence[int]) -> Any:
    """Some columns of simulated rows (..., points, rows)."""
    return _side_by_side([rows[..., i] for i in chosen])


def _side_by_side(columns: Sequence[Any]) -> Any:
    """Columns (..., points) along a last axis."""
    return namespace(columns).moveaxis(stack_rows(columns), 0, -1)


def in_frame(frame: Any, rows: Any) -> Any:
    """Components of rows (..., points, channels) in a frame (points, channels, channels), if there is one."""
    return rows if frame is None else namespace(frame, rows).einsum("pij,...pj->...pi", frame, rows)


def lengths(rows: Any, keep: bool = True) -> tuple[Any, Any]:
    """Squared length of N, C, S and its inverse root, 0 where nothing is reflected."""
    square = (rows**2).sum(axis=-1, keepdims=keep)
    return square, where(square > 0, inverse_root(where(square > 0, square, 1.0)), 0.0)


def with_depolarisation(rows: Any, count: int) -> Any:
    """The first `count` of N, C, S (..., points, 3) on their sphere, and 1 − N² − C² − S²."""
    square, inverse = lengths(rows, keep=False)
    return _side_by_side([*(rows[..., i] * inverse for i in range(count)), 1 - square])


def on_spheres(rows: Any) -> Any:
    """N, C, S side by side (..., points, 3 · ratios), each brought to its sphere."""
    vectors = rows.reshape(*rows.shape[:-1], -1, 3)
    return (vectors * lengths(vectors)[1]).reshape(rows.shape)


def stokes_of_jones(x: Number, y: Number) -> list[Any]:
    """Stokes sums of a ratio x/y: |y|² − |x|², the parts of 2 conj(x) y, and |y|² + |x|², with
    conj(x/y) = tan Ψ exp(iΔ); smooth where x = 0."""
    cross = 2 * (conj(x) * y)
    return [abs2(y) - abs2(x), real(cross), imag(cross), abs2(y) + abs2(x)]


def stokes_of_mueller(m: Matrix) -> list[Any]:
    """Stokes sums of x_pp and x_ss: over all orders, |x_ss|² ± |x_pp|² and 2 conj(x_pp) x_ss."""
    return [-m[0][1] - m[1][0], m[2][2] + m[3][3], m[2][3] - m[3][2], m[0][0] + m[1][1]]


def ratio_sums_of_mueller(m: Matrix) -> list[Any]:
    """Stokes sums of AnE, Aps and Asp (`signals.generalised`), averaged over light that adds incoherently.

    Every product of two elements of a Jones matrix in one row, in one column or on one diagonal is a sum of
    elements of the Mueller matrix (`optics.ellipsometry.mueller_elements`).
    """
    even, odd = 0.5 * (m[0][0] + m[1][1]), 0.5 * (m[0][1] + m[1][0])
    other_even, other_odd = 0.5 * (m[0][0] - m[1][1]), 0.5 * (m[0][1] - m[1][0])
    pp, ss, sp, ps = even + odd, even - odd, other_even + other_odd, other_even - other_odd  # |r|²
    ane = [ss - pp, m[2][2] + m[3][3], m[2][3] - m[3][2], ss + pp]
    aps = [pp - sp, m[2][0] + m[2][1], m[3][0] + m[3][1], pp + sp]
    asp = [ss - ps, m[2][0] - m[2][1], m[3][1] - m[3][0], ss + ps]
    return [*ane, *aps, *asp]


def angles_of_sums(sums: Sequence[Any]) -> list[Any]:
    """N, C and S of each ratio from its four Stokes sums; 0 where both amplitudes are."""
    stokes = (ellipsometry.Stokes(*sums[i : i + 4]) for i in range(0, len(sums), 4))
    return [row for one in stokes for row in ellipsometry.normalised(one)]


def isotropic_matrix(n: Any, c: Any, s: Any, m22: Any = None, m44: Any = None) -> Matrix:
    """The normalised Mueller matrix of an isotropic sample; m22 and m44 are of a cone of light."""
    xp = namespace(n)
    one, none = xp.ones_like(n), xp.zeros_like(n)
    m22, m44 = one if m22 is None else m22, c if m44 is None else m44
    return [[one, -n, none, none], [-n, m22, none, none], [none, none, c, s], [none, none, -s, m44]]


def normalised_elements(elements: Sequence[Any]) -> list[Any]:
    """The elements m12 to m44 over m11, of all 16."""
    factor = stored(inverse_intensity(elements[0]))
    return [element * factor for element in elements[1:]]


def all_elements(jones: Any) -> list[Any]:
    """The 16 elements of the Mueller matrix of a Jones matrix, row by row."""
    xp = namespace(jones)
    return [xp.atleast_1d(x) for row in mueller_elements(*jones) for x in row]


def angles(sphere: np.ndarray) -> np.ndarray:
    """Ψ and Δ in degrees side by side (..., 2), of N, C, S (..., 3); Δ is 0 where Ψ is 0 or 90."""
    psi, delta = ellipsometry.psi_delta(*np.moveaxis(sphere, -1, 0))
    return np.stack(np.broadcast_arrays(psi, delta), axis=-1)


def without_mixing(rows: Sequence[Any]) -> list[Any]:
    """N, C, S of AnE, and of Aps and Asp where r_ps = r_sp = 0."""
    xp = namespace(rows[0])
    one, none = xp.ones_like(rows[0]), xp.zeros_like(rows[0])
    return [*rows, *(one, none, none) * 2]


def drawn_angles(rows: Any, folded: bool) -> Any:
    """Ψ and Δ of each N, C, S (points, 3 · ratios), (2 · ratios, points); a folded Δ ends at 180 degrees."""
    psi, delta = ellipsometry.psi_delta(*jnp.moveaxis(rows.reshape(len(rows), -1, 3), -1, 0))
    psi, delta = jnp.broadcast_arrays(psi, jnp.minimum(delta, 360.0 - delta) if folded else delta)
    return jnp.stack([psi, delta], axis=-1).reshape(len(rows), -1).T
