"""Response of several coherent layers: the product of characteristic matrices, rescaled layer by layer.

The fields (E, H) at a layer's lower face give those at its upper face by the elements of
`characteristic.matrix_elements`, times their scale. After each layer the fields are divided by their
norm, so that 50 layers with an opaque one among them stay finite without clamping. Complex arithmetic:
separate real arrays bring nothing here. One `lax.scan` runs over the layers; unrolled, 50 of them do not
compile in minutes. Two or three smooth layers take `pellicle.optics.few_layers`.

Source: Born and Wolf, Principles of Optics, section 1.6 (characteristic matrices).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from pellicle.optics.characteristic import matrix_elements
from pellicle.optics.interface import (
    equal_media,
    incident_factor,
    normal,
    normal_flux,
    normal_square,
    transverse,
    zero_where,
)
from pellicle.optics.pair import Number, abs2, to_complex
from pellicle.optics.response import Amplitudes, Response


def stack(
    ambient: Any,
    layers: Sequence[Number],
    substrate: Number,
    phases: Sequence[Any],
    angle: Any = None,
    polarisations: str = "sp",
    roughness: Sequence[Any] | None = None,
) -> tuple[Response, ...]:
    """Return the response of a stack, for each letter of `polarisations`.

    **Arguments:** as for `coherent.responses`. Every array broadcasts against every other.
    """
    a, q0 = transverse(ambient, angle)
    leaves = jax.tree_util.tree_leaves((ambient, list(layers), substrate, list(phases), a, roughness))
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in leaves))
    dtype = jnp.promote_types(jnp.result_type(*leaves), jnp.complex64)

    def full(number: Number) -> Any:
        return jnp.broadcast_to(to_complex(number).astype(dtype), shape)

    def rows(numbers: Sequence[Any]) -> Any:
        return jnp.stack([full(n) for n in numbers]) if numbers else jnp.zeros((0, *shape), dtype)

    index, depth = rows(layers), jnp.real(rows(phases))
    bottom, top, q_top = full(substrate), full(ambient), full(q0)
    q_bottom = normal(bottom, a)
    empty = equal_media(ambient, substrate, *layers)
    responses = []
    for polarisation in polarisations[:1] if angle is None else polarisations:
        e0, e2 = _weight(top, polarisation), _weight(bottom, polarisation)
        down_faces = up_faces = None
        if roughness is not None:
            weight = jnp.concatenate([e0[None], _weight(index, polarisation), e2[None]])
            q = jnp.concatenate([q_top[None], normal(index, a), q_bottom[None]])
            rough = jnp.real(rows(roughness))
            down_faces = _rough_faces(q[:-1], weight[:-1], q[1:], weight[1:], rough)[:, ::-1]
            up_faces = _rough_faces(q[1:], weight[1:], q[:-1], weight[:-1], rough)
        below = (index[::-1], depth[::-1], q_bottom / e2, down_faces)
        (E, H), scale_square = _fields(*below, a, polarisation)
        (E_, H_), _ = _fields(index, depth, q_top / e0, up_faces, a, polarisation)
        down, up = q_top * E / e0, q_bottom * E_ / e2
        flux = incident_factor(ambient, q0, polarisation) * normal_flux(bottom, q_bottom, polarisation)
        denominator = down + H
        # both directions have the same denominator except for its scale: rescale the second to the first
        reversed_ = (up - H_) / (up + H_) * denominator
        amplitudes = (zero_where(empty, down - H), reversed_, denominator)
        squares = Amplitudes(*(abs2(amplitude) for amplitude in amplitudes))
        responses.append(Response(*amplitudes, squares, flux / abs2(e0 * e2), scale_square))
    return tuple(responses)


def _weight(index: Any, polarisation: str) -> Any:
    """Return the divisor of q in the boundary condition: 1 for s, ε for p."""
    return jnp.ones_like(index) if polarisation == "s" else index * index


def _rough_faces(q: Any, weight: Any, q_below: Any, weight_below: Any, rough: Any) -> Any:
    """Return the factors (2, faces, ...) of the fields (E, H) on their way up through each rough face.

    Névot and Croce 1980 (Rev. Phys. Appl. 15, 761): r exp(−x) with x = 2 k₀²σ² q q′, and
    t exp(k₀²σ² (q − q′)²/2). In terms of fields this is diagonal, with the entire function
    (1 − e^−x)/x, so that a smooth face, or one at a critical angle, is no special case.
    """
    square = rough * rough
    damping = square * _expm1_ratio(2 * square * q * q_below)
    passed = jnp.exp(-0.5 * square * (q - q_below) ** 2)
    E = 1 + damping * q_below * (q_below * weight / weight_below - q)
    H = 1 + damping * q * (q * weight_below / weight - q_below)
    return jnp.stack([E * passed, H * passed])


def _expm1_ratio(x: Any) -> Any:
    """Return (1 − e^−x)/x, by its Taylor series near 0."""
    near = abs2(x) < 0.01
    small, far = jnp.where(near, x, 0), jnp.where(near, 1, x)
    taylor = jnp.ones_like(x)
    for j in range(12, 1, -1):
        taylor = 1 - small * taylor / j
    return jnp.where(near, taylor, (1 - jnp.exp(-far)) / far)


def _fields(index: Any, depth: Any, admittance: Any, faces: Any, a: Any, polarisation: str) -> Any:
    """Return (E, H) at the far face for a unit wave in the last medium, and |scale|²."""

    def through_layer(carry, layer):
        (E, H), scale_square = carry
        n, k, face = layer
        if face is not None:
            E, H = E * face[0], H * face[1]
        square, e = normal_square(n, a), _weight(n, polarisation)
        c, f, layer_scale, _ = matrix_elements(square, k)
        E, H = E * c - 1j * f * e * H, H * c - 1j * f * (square / e) * E
        size = jax.lax.stop_gradient(abs2(E) + abs2(H))
        shrink = jax.lax.rsqrt(size)
        return ((E * shrink, H * shrink), scale_square * layer_scale / size), None

    start = (jnp.ones_like(admittance), admittance), jnp.ones_like(jnp.real(admittance))
    inner = None if faces is None else jnp.moveaxis(faces[:, :-1], 0, 1)
    ((E, H), scale_square), _ = jax.lax.scan(through_layer, start, (index, depth, inner))
    return ((E, H) if faces is None else (E * faces[0, -1], H * faces[1, -1])), scale_square
