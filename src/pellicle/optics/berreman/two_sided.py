"""Reflection and transmission of layers of any orientation from both sides, as on a plate.

Each layer has a scattering matrix of waves against free space at normal incidence, E = d + u and H = d − u in
the tangential fields; those of all layers and of both outer faces are joined by Redheffer's star product.

Source: L. Li, J. Opt. Soc. Am. A 13, 1024 (1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import Medium, mixes_polarisations
from pellicle.optics.berreman.slices import Scattering, doubled, join, scattering, slice_count, transfer
from pellicle.optics.berreman.stack import method_of
from pellicle.optics.hoisting import stored
from pellicle.optics.interface import Inside, transverse
from pellicle.optics.pair import Number, to_complex


def two_sided(
    above: Number,
    layers: Sequence[Medium],
    below: Number,
    phases: Sequence[Any],
    angle: Any,
    dichroic: bool = True,
) -> Scattering:
    """Return the Jones matrices of reflection and transmission of layers between two isotropic media.

    **Arguments** as for `pellicle.optics.berreman.stack.polarised`; `above` and `below` are indices
    and may absorb.

    **Returns:** complex arrays (2, 2, ...) for electric fields of p and s, rows outgoing, columns incident:
    from above `reflected` and `down`, from below `below` and `up`. The field of a p wave along x is p cos θ
    where it travels down and −p cos θ where it travels up.
    """
    a, q_above = transverse(above, angle if isinstance(angle, Inside) else jnp.asarray(angle) * 1.0)
    _, q_below = transverse(below, Inside(a))
    every = a, q_above, q_below, above, below, list(layers), list(phases)
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in jax.tree.leaves(every)))
    whole = _upper_face(above, q_above, shape)
    for medium, k in zip(layers, phases, strict=True):
        whole = stored(join(whole, _layer(medium, a, k, shape, dichroic)))
    return stored(join(whole, _lower_face(below, q_below, shape)))


def _layer(medium: Medium, a: Any, k: Any, shape: tuple[int, ...], dichroic: bool) -> Scattering:
    method, mixes = method_of(medium), mixes_polarisations(medium)
    k = jnp.broadcast_to(k, shape)
    count = None
    if dichroic and mixes:
        count = slice_count(method.dichroism(medium, a) * jax.lax.stop_gradient(k), shape)
        k = k * jnp.exp2(-count)
    direction = jnp.array([1.0, -1.0], k.dtype).reshape(2, *[1] * len(shape))
    # waves along the axes of the laboratory are alike in both directions
    propagation = method.propagation(medium, a, k, direction) if mixes else method.propagation(medium, a, k)
    loss = jnp.broadcast_to(jnp.exp(-propagation.growth), (2, *shape))
    waves = transfer(propagation, direction)
    one = scattering(jnp.broadcast_to(waves, (4, 4, 2, *shape)), loss)
    if count is None:
        return one
    return jax.lax.cond(jnp.any(count > 0), lambda s: doubled(s, count), lambda s: s, stored(one))


def _upper_face(index: Number, q: Number, shape: tuple[int, ...]) -> Scattering:
    """From a half space above into free space: the admittance is ε/q for p and q for s."""
    index, q = to_complex(index), to_complex(q)
    epsilon = index * index
    p, s = 1 / (q + epsilon), 1 / (q + 1)
    r_p, r_s = (q - epsilon) * p, (q - 1) * s
    return Scattering(
        reflected=_diagonal(r_p, r_s, shape),
        down=_diagonal(2 * index * q * p, 2 * q * s, shape),
        up=_diagonal(-2 * index * p, 2 * s, shape),
        below=_diagonal(r_p, -r_s, shape),
    )


def _lower_face(index: Number, q: Number, shape: tuple[int, ...]) -> Scattering:
    """From free space into a half space below: the upper face seen from its other side.

    p waves change the sign of Ex between both sides.
    """
    reflected, down, up, below = _upper_face(index, q, shape)
    signs = jnp.array([-1.0, 1.0], jnp.real(up).dtype).reshape(2, 1, *[1] * len(shape))
    return Scattering(reflected=below, down=up * signs, up=down * signs, below=reflected)


def _diagonal(p: Any, s: Any, shape: tuple[int, ...]) -> Any:
    p, s = jnp.broadcast_to(p, shape), jnp.broadcast_to(s, shape)
    zero = jnp.zeros_like(p)
    return jnp.stack([p, zero, zero, s]).reshape(2, 2, *shape)
