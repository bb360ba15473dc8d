"""Tangential fields at the interfaces of a coherent stack, scaled so that none overflows.

The fields are followed upwards from the wave that leaves into the substrate, as in `pellicle.optics.stack`:
in that direction the wave that grows is the physical one, and rounding errors decay against it. Source:
Born and Wolf, Principles of Optics, section 1.6; Macleod, Thin-Film Optical Filters, chapter 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.characteristic import Characteristic, matrix_elements
from pellicle.optics.interface import Transverse, normal, normal_square, transverse
from pellicle.optics.pair import Number, Pair, abs2, imag, real, times_i


class Media(NamedTuple):
    """Numbers of a stack that s and p share; those of layers have them along the first axis."""

    ambient: Number
    permittivity: Pair  # of the layers
    squares: Pair  # q² of the layers
    phases: Any  # k₀d of the layers
    elements: Characteristic  # of the layers
    substrate: Pair
    q_top: Number
    q_bottom: Pair
    a: Any  # transverse index


class InterfaceFields(NamedTuple):
    """Fields of one polarisation at the lower face of each layer, and the ratios between them.

    U and V are E and H along the interfaces for s, H and E for p. Those of different layers have different
    scales: at the upper face of a layer the field is (U, V) of the layer above times the root of `size`.
    """

    U: Pair
    V: Pair
    size: Any  # of the fields at the layer's upper face
    weight: Any  # 1 for s, the permittivity for p
    top: tuple[Pair, Pair]  # at the first interface
    denominator: Pair  # 2 Y₀ U of the incident wave, Y₀ the ambient's admittance
    admittance: Number  # Y₀


def media(
    ambient: Number, layers: Sequence[Number], substrate: Number, phases: Sequence[Any], angle: Any
) -> Media:
    """Prepare a stack; arguments as for `coherent.responses`, except that no real index is a promise."""
    a, q_top = transverse(ambient, angle)
    leaves = jax.tree_util.tree_leaves((ambient, list(layers), substrate, list(phases), a))
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in leaves))
    dtype = jnp.finfo(jnp.promote_types(jnp.result_type(*leaves), jnp.float32)).dtype

    def full(number: Any) -> Any:
        return jnp.broadcast_to(jnp.asarray(number, dtype), shape)

    def rows(numbers: Sequence[Any]) -> Any:
        return jnp.stack([full(n) for n in numbers]) if numbers else jnp.zeros((0, *shape), dtype)

    index = Pair(rows([real(n) for n in layers]), rows([imag(n) for n in layers]))
    bottom = Pair(full(real(substrate)), full(imag(substrate)))
    squares, depth = normal_square(index, a), rows(phases)
    squares = Pair(real(squares), imag(squares))
    return Media(
        ambient,
        index * index,
        squares,
        depth,
        matrix_elements(squares, depth),
        bottom * bottom,
        q_top,
        normal(bottom, a),
        a.index if isinstance(a, Transverse) else a,
    )


def interface_fields(stack: Media, polarisation: str) -> InterfaceFields:
    """Return the fields of one polarisation, "s" or "p", at the interfaces of a stack."""
    s = polarisation == "s"
    one = Pair(jnp.ones_like(stack.substrate.re), jnp.zeros_like(stack.substrate.re))
    weight = 0.0 * stack.permittivity + 1.0 if s else stack.permittivity
    bottom = stack.q_bottom if s else stack.q_bottom / stack.substrate
    admittance = stack.q_top if s else stack.q_top / (stack.ambient * stack.ambient)
    c, g = stack.elements.c, times_i(-stack.elements.f)

    def through_layer(fields, layer):
        (U, V), (c, across, back) = fields, layer
        above = U * c + across * V, V * c + back * U
        size = jax.lax.stop_gradient(abs2(above[0]) + abs2(above[1]))
        shrink = jax.lax.rsqrt(size)
        return (above[0] * shrink, above[1] * shrink), (U, V, size)

    layers = (c, g * weight, g * (stack.squares / weight))
    bottom_fields = (one, bottom * one)
    top, (U, V, size) = jax.lax.scan(through_layer, bottom_fields, layers, reverse=True)
    denominator = admittance * top[0] + top[1]
    return InterfaceFields(U, V, size, weight, top, denominator, admittance)
