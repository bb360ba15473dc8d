"""Several coherent layers: the product of characteristic matrices, each held to size.

The fields (E, H) at a layer's lower face give those at its upper face through the same two entire
functions as one film (`film.through`), both times a positive scale; after each layer the fields are
divided by their own size. So 50 layers with an opaque one among them stay finite, and nothing is
clamped. Complex arithmetic: on separate real arrays a stack gains nothing. One `lax.scan` over the
layers: unrolled, 50 of them do not compile in minutes.

Source: Born and Wolf, Principles of Optics, section 1.6 (characteristic matrices).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from pellicle.optics.film import Wave, through
from pellicle.optics.interface import normal, power, transverse
from pellicle.optics.number import Number, SinCos, abs2, sincos, to_complex


def stack(
    ambient: Any,
    layers: Sequence[Number],
    substrate: Number,
    phases: Sequence[Any],
    angle: Any = None,
    polarisations: str = "sp",
    sincos: SinCos = sincos,
) -> tuple[Wave, ...]:
    """Waves around a stack, one for each letter of `polarisations`.

    `layers` and `phases` (k₀d = 2πd/λ of each) run from the ambient down; the other arguments are as
    for `film.film`. Every array broadcasts against every other.
    """
    a, q0 = transverse(ambient, angle)
    leaves = jax.tree_util.tree_leaves((ambient, list(layers), substrate, list(phases), a))
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in leaves))
    dtype = jnp.promote_types(jnp.result_type(*leaves), jnp.complex64)

    def full(number: Number):
        return jnp.broadcast_to(to_complex(number).astype(dtype), shape)

    index = jnp.stack([full(n) for n in layers])
    depth = jnp.stack([jnp.broadcast_to(p, shape) for p in phases]).astype(index.real.dtype)
    bottom, top, q_top = full(substrate), full(ambient), full(q0)
    q_bottom = normal(bottom, a)
    waves = []
    for polarisation in polarisations[:1] if angle is None else polarisations:
        (E, H), scale_square = _fields(index[::-1], depth[::-1], a, bottom, q_bottom, polarisation, sincos)
        (E_, H_), _ = _fields(index, depth, a, top, q_top, polarisation, sincos)
        e0, e2 = _weight(top, polarisation), _weight(bottom, polarisation)
        down, up = q_top * E / e0, q_bottom * E_ / e2
        into = 4 * jnp.real(q0) * power(bottom, q_bottom, polarisation) * scale_square
        denominator = down + H
        # the two directions share their denominator but for scale: bring the second to the first
        below = (up - H_) / (up + H_) * denominator
        waves.append(Wave(down - H, below, denominator, into / _square_weight(top, bottom, polarisation)))
    return tuple(waves)


def _weight(index, polarisation: str):
    """What divides q in the boundary condition: 1 for s, ε for p."""
    return jnp.ones_like(index) if polarisation == "s" else index * index


def _square_weight(top, bottom, polarisation: str):
    """Turns `power`, which is up to |n|², into the flux of a unit H (p) or E (s)."""
    return 1.0 if polarisation == "s" else jnp.real(top * top) * abs2(bottom * bottom)


def _fields(index, depth, a, last, q_last, polarisation: str, sincos: SinCos):
    """(E, H) at the far face for a unit wave in the last medium, layer after layer, and the scale²."""

    def through_layer(carry, layer):
        (E, H), scale_square = carry
        n, k = layer
        square, e = (n - a) * (n + a), _weight(n, polarisation)
        c, f, layer_scale = through(square, k, sincos)
        E, H = E * c - 1j * f * e * H, H * c - 1j * f * (square / e) * E
        size = jax.lax.stop_gradient(abs2(E) + abs2(H))
        shrink = jax.lax.rsqrt(size)
        return ((E * shrink, H * shrink), scale_square * layer_scale / size), None

    start = (jnp.ones_like(last), q_last / _weight(last, polarisation)), jnp.ones_like(jnp.real(last))
    carry, _ = jax.lax.scan(through_layer, start, (index, depth))
    return carry
