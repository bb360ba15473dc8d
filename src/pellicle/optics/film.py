"""Closed-form response of one coherent layer on a substrate, with finite values and gradients everywhere.

The layer enters only through the two entire functions of `pellicle.optics.characteristic`. So zero
thickness, grazing incidence, a layer exactly at its critical angle, a matched index, a millimetre of metal
and tunnelling need no special case. This is the Airy formula of Gerardin et al. 2019 (eqs. 11 and 12)
multiplied out; the same lines serve real, complex and `Pair` numbers.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from pellicle.optics.anisotropy import Index, tangential_permittivity
from pellicle.optics.characteristic import (
    element_slopes,
    half_expm1,
    is_real_array,
    matrix_elements,
    nonzero_root,
    propagating_elements,
)
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
from pellicle.optics.pair import Number, abs2, conj, custom_jvp, is_real, namespace, real, times_i, where
from pellicle.optics.response import Amplitudes, Response
from pellicle.optics.special import sincos, sincos_squares


class AmplitudesAndSquares(NamedTuple):
    """Amplitudes A c − iB f of one polarisation, and their squared moduli, which cost less on their own."""

    values: Amplitudes
    squares: Amplitudes


@partial(custom_jvp, nondiff_argnums=(3,))
def _amplitudes(
    sides: tuple[Amplitudes, ...], Q: Number, k: Any, propagating: bool
) -> tuple[tuple[AmplitudesAndSquares, ...], Any]:
    """Return the amplitudes A c − iB f for each pair (A, B) in `sides`, and |scale|².

    A grid of thicknesses spends its time on what is computed at each point: the functions of the phase,
    and the products here. So factors that do not depend on the thickness are multiplied out and hoisted,
    and the squares are formed from the rest.
    """
    if propagating:
        return _propagating_amplitudes(sides, Q, k)
    if is_real_array(Q):
        c, f, scale_square, _ = matrix_elements(Q, k)
        g = times_i(-f)
        return tuple(_squared([A * c + B * g for A, B in hoist(side, k)]) for side in sides), scale_square
    q = nonzero_root(Q)
    half, scale_square = half_expm1(q, k)
    pairs = [[(A, A - B / q) for A, B in side] for side in sides]
    if is_reused(pairs, k):
        return tuple(_grid_amplitudes(side, half, k) for side in pairs), scale_square
    return tuple(_squared([A + half * C for A, C in side]) for side in pairs), scale_square


def _squared(values: list[Number]) -> AmplitudesAndSquares:
    return AmplitudesAndSquares(Amplitudes(*values), Amplitudes(*(abs2(x) for x in values)))


def _propagating_amplitudes(
    sides: tuple[Amplitudes, ...], Q: Any, k: Any
) -> tuple[tuple[AmplitudesAndSquares, ...], Any]:
    """Amplitudes in a lossless layer: |A c − iB f|² of real A and B is a sum of two squares."""
    xp = namespace(Q, k)
    q = xp.sqrt(Q)
    phase = k * hoist(q, k)
    sine, cosine = sincos(phase)
    sine_square, cosine_square = sincos_squares(phase)

    def one(side: Amplitudes) -> AmplitudesAndSquares:
        pairs = hoist([(A, B / q) for A, B in side], k)
        both = _squared([A * cosine + times_i(-sine) * V for A, V in pairs])
        if not all(is_real(x) for pair in pairs for x in pair):
            return both
        weights = hoist([(A * A, V * V) for A, V in pairs], k)
        squares = Amplitudes(*(a * cosine_square + b * sine_square for a, b in weights))
        return AmplitudesAndSquares(both.values, squares)

    return tuple(one(side) for side in sides), xp.ones_like(cosine)


def _grid_amplitudes(pairs: list[tuple[Number, Number]], half: Number, k: Any) -> AmplitudesAndSquares:
    """Return A + half C for each (A, C), with squares |A e^{−iθ} + half |C||², θ the phase of C.

    Where C is only a rounding error, so is θ. Everything made of C must then be made of the same C: it is
    the same because it is hoisted.
    """
    pairs = hoist(pairs, k)
    rotated = hoist([_rotated(A, C) for A, C in pairs], k)
    squares = (abs2(A + half * size) for A, size in rotated)
    return AmplitudesAndSquares(Amplitudes(*(A + half * C for A, C in pairs)), Amplitudes(*squares))


def _rotated(A: Number, C: Number) -> tuple[Number, Any]:
    """Return A e^{−iθ} and |C|, θ the phase of C; where C is 0, θ may be anything."""
    square = abs2(C)
    xp, zero = namespace(square), square == 0
    size = xp.sqrt(xp.where(zero, 1.0, square))
    return where(zero, A + 0.0 * C, A * conj(C) / size), xp.where(zero, 0.0, size)


def _amplitude_slopes(propagating: bool, primal: Any, tangent: Any) -> Any:
    """JVP of `_amplitudes` by the derivatives of c and f; symbolic zeros cost nothing."""
    (sides, Q, k), (dsides, dQ, dk) = primal, tangent
    dQ, dk = jax.tree.map(_instantiate, (dQ, dk), is_leaf=_is_symbolic_zero)
    elements = propagating_elements if propagating else matrix_elements
    (c, f, _, _), (dc, df, dscale, _) = element_slopes(elements, (Q, k), (dQ, dk))
    g, dg = times_i(-f), times_i(-df)

    def slope(pair: Any, dpair: Any) -> Number:
        total = pair[0] * dc + pair[1] * dg
        for d, factor in zip(dpair, (c, g), strict=True):
            if not all(map(_is_symbolic_zero, jax.tree.leaves(d, is_leaf=_is_symbolic_zero))):
                total = total + jax.tree.map(_instantiate, d, is_leaf=_is_symbolic_zero) * factor
        return total

    def slopes_of(result: AmplitudesAndSquares, side: Any, dside: Any) -> AmplitudesAndSquares:
        slopes = [slope(pair, dpair) for pair, dpair in zip(side, dside, strict=True)]
        squares = (2 * real(conj(x) * dx) for x, dx in zip(result.values, slopes, strict=True))
        return AmplitudesAndSquares(Amplitudes(*slopes), Amplitudes(*squares))

    results, scale_square = _amplitudes(sides, Q, k, propagating)
    slopes = tuple(slopes_of(*each) for each in zip(results, sides, dsides, strict=True))
    return (results, scale_square), (slopes, dscale)


def _is_symbolic_zero(x: Any) -> bool:
    return isinstance(x, SymbolicZero)


def _instantiate(x: Any) -> Any:
    return jnp.zeros(x.shape, x.dtype) if _is_symbolic_zero(x) else x


_amplitudes.defjvp(_amplitude_slopes, symbolic_zeros=True)


def film(
    ambient: Index,
    layer: Index,
    substrate: Index,
    phase: Any,
    angle: Any = None,
    polarisations: str = "sp",
    propagating: bool = False,
) -> tuple[Response, ...]:
    """Return the response of one layer, for each letter of `polarisations`.

    With A, B, A′, B′ as in the code, the denominator is D = A c − iB f and the numerator N = A′ c − iB′ f;
    reversing the light changes the sign of A′. Denominators contain no division: at grazing incidence T
    is 0, not 0/0. Between equal media A′ is exactly 0, and where nothing is between them (no thickness,
    or the same medium again) exactly nothing is reflected, at 90° too.

    **Arguments:** as for `coherent.responses`, with one `layer` and its `phase` k₀d = 2πd/λ.

    **Source:** Gerardin et al. 2019, eqs. 11 and 12.
    """
    a, q0 = transverse(ambient, angle)
    e0, e1, e2 = map(tangential_permittivity, (ambient, layer, substrate))
    q1_square, q2 = normal_square(layer, a), normal(substrate, a)
    bare, empty = equal_media(ambient, substrate), equal_media(ambient, layer, substrate)
    sides, fluxes = [], []
    for polarisation in polarisations[:1] if angle is None else polarisations:
        if polarisation == "s":
            A, B, A_, B_ = q0 + q2, q0 * q2 + q1_square, q0 - q2, q0 * q2 - q1_square
        else:
            u, v = e0 * e2 * q1_square / e1, e1 * q0 * q2
            A, B, A_, B_ = e0 * q2 + e2 * q0, u + v, e2 * q0 - e0 * q2, v - u
        A_, B_ = zero_where(bare, A_), zero_where(empty, B_)
        flux = incident_factor(ambient, q0, polarisation) * normal_flux(substrate, q2, polarisation)
        if is_real(A):  # and positive: divided by A, which cancels, one product less at each point
            inverse = 1 / A
            A, A_, B, B_, flux = 1.0, A_ * inverse, B * inverse, B_ * inverse, flux * inverse * inverse
        sides.append(Amplitudes((A_, B_), (-A_, B_), (A, B)))
        fluxes.append(flux)
    results, scale_square = _amplitudes(tuple(sides), q1_square, phase, propagating and is_real(layer))
    responses = []
    for (values, squares), flux in zip(results, fluxes, strict=True):
        reflected, below, denominator = values
        passed = hoist(flux, scale_square)
        responses.append(Response(reflected, below, denominator, squares, passed, scale_square))
    return tuple(responses)
