"""One coherent layer on a substrate, with value and gradient finite everywhere.

The layer enters only through the two entire functions of `pellicle.optics.characteristic`. So zero thickness,
grazing incidence, an exactly critical film, a matched index, a millimetre of metal and tunnelling need
no special case. This is the Airy formula of Gerardin et al. 2019 (eqs. 11 and 12) multiplied out; each
line below is the same for real, complex and Pair numbers.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from pellicle.optics.characteristic import (
    element_slopes,
    half_expm1,
    is_real_array,
    matrix_elements,
    propagating_elements,
    root,
)
from pellicle.optics.elementary import sincos, sincos_squares
from pellicle.optics.hoisting import hoist, is_reused
from pellicle.optics.interface import (
    equal_media,
    incident_factor,
    normal,
    normal_flux,
    normal_square,
    transverse,
    zero_where,
)
from pellicle.optics.pair import Number, abs2, conj, is_real, real, times_i, where
from pellicle.optics.response import Amplitudes, Response


class AmplitudesAndSquares(NamedTuple):
    """Amplitudes A c − iB f of one polarisation, and their squared moduli, which cost less on their own."""

    values: Amplitudes
    squares: Amplitudes


@partial(jax.custom_jvp, nondiff_argnums=(3,))
def _amplitudes(
    sides: tuple[Amplitudes, ...], Q: Number, k: Any, propagating: bool
) -> tuple[tuple[AmplitudesAndSquares, ...], Any]:
    """What `sides`, a pair (A, B) for each amplitude of each polarisation, make of a layer; and |scale|².

    A grid of thicknesses spends its time in multiplications at each point: in the functions of the
    phase, and here. So what knows nothing of the thickness is multiplied out and held, and squares are
    taken of what is left.
    """
    if propagating:
        return _by_wave(sides, Q, k)
    if is_real_array(Q):
        c, f, scale_square, _ = matrix_elements(Q, k)
        g = times_i(-f)
        return tuple(_plain([A * c + B * g for A, B in hoist(three, k)]) for three in sides), scale_square
    q = root(Q)
    half, scale_square = half_expm1(q, k)
    pairs = [[(A, A - B / q) for A, B in three] for three in sides]
    if is_reused(pairs, k):
        return tuple(_on_grid(three, half, k) for three in pairs), scale_square
    return tuple(_plain([A + half * C for A, C in three]) for three in pairs), scale_square


def _plain(values: list[Number]) -> AmplitudesAndSquares:
    return AmplitudesAndSquares(Amplitudes(*values), Amplitudes(*(abs2(x) for x in values)))


def _by_wave(sides: tuple[Amplitudes, ...], Q: Any, k: Any) -> tuple[tuple[AmplitudesAndSquares, ...], Any]:
    """Where the wave propagates without loss: |A c − iB f|² of real A and B is a sum of two squares."""
    q = jnp.sqrt(Q)
    phase = k * hoist(q, k)
    sine, cosine = sincos(phase)
    sine_square, cosine_square = sincos_squares(phase)

    def one(three: Amplitudes) -> AmplitudesAndSquares:
        pairs = hoist([(A, B / q) for A, B in three], k)
        found = _plain([A * cosine + times_i(-sine) * V for A, V in pairs])
        if not all(is_real(x) for pair in pairs for x in pair):
            return found
        weights = hoist([(A * A, V * V) for A, V in pairs], k)
        return AmplitudesAndSquares(
            found.values, Amplitudes(*(a * cosine_square + b * sine_square for a, b in weights))
        )

    return tuple(one(three) for three in sides), jnp.ones_like(cosine)


def _on_grid(pairs: list[tuple[Number, Number]], half: Number, k: Any) -> AmplitudesAndSquares:
    """A + half C for each (A, C). The squares are those of A e^{−iθ} + half |C|, with θ the phase of C.

    Where C is nothing but rounding, so is θ: all that is made of C must be made of the same C, which
    holds because it is held.
    """
    pairs = hoist(pairs, k)
    squares = (abs2(turned + half * size) for turned, size in hoist([_turned(*pair) for pair in pairs], k))
    return AmplitudesAndSquares(Amplitudes(*(A + half * C for A, C in pairs)), Amplitudes(*squares))


def _turned(A: Number, C: Number) -> tuple[Number, Any]:
    """A e^{−iθ} and |C|; where C is 0, θ may be anything."""
    square = abs2(C)
    nothing = square == 0
    size = jnp.sqrt(jnp.where(nothing, 1.0, square))
    return where(nothing, A + 0.0 * C, A * conj(C) / size), jnp.where(nothing, 0.0, size)


def _amplitudes_slope(propagating, primal, tangent):
    """By the derivatives of c and f. What is known not to vary costs nothing."""
    (sides, Q, k), (dsides, dQ, dk) = primal, tangent
    dQ, dk = jax.tree.map(_filled, (dQ, dk), is_leaf=_is_nothing)
    (c, f, _, _), (dc, df, dscale, _) = element_slopes(
        propagating_elements if propagating else matrix_elements, (Q, k), (dQ, dk)
    )
    g, dg = times_i(-f), times_i(-df)

    def slope(side, turn):
        dA, dB = (None if _all_nothing(x) else jax.tree.map(_filled, x, is_leaf=_is_nothing) for x in turn)
        found = side[0] * dc + side[1] * dg
        found = found if dA is None else found + dA * c
        return found if dB is None else found + dB * g

    def slopes_of(found: AmplitudesAndSquares, three, turns) -> AmplitudesAndSquares:
        moved = [slope(side, turn) for side, turn in zip(three, turns, strict=True)]
        squares = (2 * real(conj(x) * dx) for x, dx in zip(found.values, moved, strict=True))
        return AmplitudesAndSquares(Amplitudes(*moved), Amplitudes(*squares))

    found, scale_square = _amplitudes(sides, Q, k, propagating)
    moved = tuple(slopes_of(*each) for each in zip(found, sides, dsides, strict=True))
    return (found, scale_square), (moved, dscale)


def _is_nothing(x: Any) -> bool:
    return isinstance(x, SymbolicZero)


def _filled(x: Any) -> Any:
    return jnp.zeros(x.shape, x.dtype) if _is_nothing(x) else x


def _all_nothing(x: Any) -> bool:
    return all(map(_is_nothing, jax.tree.leaves(x, is_leaf=_is_nothing)))


_amplitudes.defjvp(_amplitudes_slope, symbolic_zeros=True)


def film(
    ambient: Any,
    layer: Number,
    substrate: Number,
    phase: Any,
    angle: Any = None,
    polarisations: str = "sp",
    propagating: bool = False,
) -> tuple[Response, ...]:
    """Return the response of one layer, one for each letter of `polarisations`.

    Arguments broadcast. `ambient`, `layer` and `substrate` are numbers of any type, the ambient real
    but for light from within a plate (`interface.Inside` in place of the angle); `phase` is
    k₀d = 2πd/λ; `angle` is in radians, None being normal incidence, where s and p are one and only
    the first polarisation is computed. `propagating` promises that no wave is totally reflected in
    a layer of real index.

    With A, B, A′, B′ below, D = A c − iB f and N = A′ c − iB′ f; reversing the light turns the sign
    of A′. Denominators carry no division: at grazing incidence T is 0, not 0/0.
    Between equal media A′ is exactly 0, and nothing between them (no thickness, or the same medium
    again) reflects exactly nothing, at 90° too.
    """
    a, q0 = transverse(ambient, angle)
    e0, e1, e2, q1_square = ambient * ambient, layer * layer, substrate * substrate, normal_square(layer, a)
    q2 = normal(substrate, a)
    bare, empty = equal_media(ambient, substrate), equal_media(ambient, layer, substrate)
    letters = polarisations[:1] if angle is None else polarisations
    sides, fluxes = [], []
    for polarisation in letters:
        if polarisation == "s":
            A, B, A_, B_ = q0 + q2, q0 * q2 + q1_square, q0 - q2, q0 * q2 - q1_square
        else:
            u, v = e0 * e2 * q1_square / e1, e1 * q0 * q2
            A, B, A_, B_ = e0 * q2 + e2 * q0, u + v, e2 * q0 - e0 * q2, v - u
        A_, B_ = zero_where(bare, A_), zero_where(empty, B_)
        flux = incident_factor(ambient, q0, polarisation) * normal_flux(substrate, q2, polarisation)
        if is_real(A):  # and positive: over A, which cancels, a product less at each point
            over = 1 / A
            A, A_, B, B_, flux = 1.0, A_ * over, B * over, B_ * over, flux * over * over
        sides.append(Amplitudes((A_, B_), (-A_, B_), (A, B)))
        fluxes.append(flux)
    results, scale_square = _amplitudes(tuple(sides), q1_square, phase, propagating and is_real(layer))
    responses = []
    for (values, squares), flux in zip(results, fluxes, strict=True):
        reflected, below, denominator = values
        passed = hoist(flux, scale_square)
        responses.append(Response(reflected, below, denominator, squares, passed, scale_square))
    return tuple(responses)
