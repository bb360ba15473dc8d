"""Layers that may be strongly dichroic: one wave is absorbed while the other passes.

A product of transfer matrices loses the surviving wave there. Such a layer is cut into 2ᵐ equal slices,
and the scattering matrix of one slice is doubled m times: nothing in it exceeds 1.

Matrices are complex arrays here, which compile to less code than pairs of real ones.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.berreman.matrices import (
    Propagation,
    inverse,
    one_minus,
    product,
)
from pellicle.optics.hoisting import stored
from pellicle.optics.pair import Number, cond, fori_loop, namespace, to_complex, to_pair, where

DIRECT = 3.0
"""Largest difference of the attenuations, as exponents of amplitudes, that takes no slices: it costs e³."""

DOUBLINGS = 22
"""Most doublings: they serve differences up to 1e7."""


class Scattering(NamedTuple):
    """Scattering matrix of a layer: light from above and from below, each (2, 2, ...)."""

    reflected: Any
    down: Any
    up: Any
    below: Any


def join(upper: Scattering, lower: Scattering) -> Scattering:
    """Return the scattering matrix of two layers (Redheffer's star product)."""
    between_down = product(inverse(one_minus(product(upper.below, lower.reflected))), upper.down)
    between_up = product(inverse(one_minus(product(lower.reflected, upper.below))), lower.up)
    between_down, between_up = stored((between_down, between_up))
    return Scattering(
        upper.reflected + product(product(upper.up, lower.reflected), between_down),
        product(lower.down, between_down),
        product(upper.up, between_up),
        lower.below + product(product(lower.down, upper.below), between_up),
    )


def transfer(propagation: Propagation, direction: Any) -> Any:
    """Return the transfer matrix (4, 4, 2, ...) of waves against free space, without its growth.

    It takes the waves down (p and s) and up at the far face to those at the near one. **Arguments:**
    `propagation` upwards in its first row and, with the opposite transverse index, in its second;
    `direction` is 1 and −1 in these. Reversed, Hy and −Hx change their signs.
    """
    xp = namespace(direction)
    unit = xp.array([[1.0, 0, 1, 0], [0, 1, 0, 1], [1, 0, -1, 0], [0, 1, 0, -1]], direction.dtype)
    Ex, Ey, Hy, Hx = unit.reshape(4, 4, *[1] * direction.ndim)  # each wave's, (4, 1, ...)
    Ex, Hy, Ey, Hx = map(to_complex, stored(propagation.apply((Ex, Hy * direction, Ey, Hx * direction))))
    Hy, Hx = direction * Hy, direction * Hx
    return stored(0.5 * xp.stack(xp.broadcast_arrays(Ex + Hy, Ey + Hx, Ex - Hy, Ey - Hx)))


def scattering(transfer: Any, loss: Any) -> Scattering:
    """Return the scattering matrix of a layer from `transfer` and e^−growth, (2, ...)."""
    upwards, downwards = transfer[:, :, 0], transfer[:, :, 1]
    through, back = inverse(upwards[:2, :2]), inverse(downwards[2:, 2:])
    return Scattering(
        reflected=product(upwards[2:, :2], through),
        down=through * loss[0],
        up=back * loss[1],
        below=-product(through, upwards[:2, 2:]),
    )


def slice_count(exponent: Any, shape: Any) -> Any:
    """Return m of 2ᵐ slices, 0 where none are needed, for the difference of the attenuations."""
    xp = namespace(exponent)
    needed = xp.broadcast_to(exponent > DIRECT, shape)
    return xp.ceil(xp.log2(xp.where(needed, exponent / DIRECT, 1.0)))


def doubled(one: Scattering, count: Any) -> Scattering:
    """Return the scattering matrix of 2^count equal layers, each `one`."""

    def double(i: Any, s: Scattering) -> Scattering:
        new = join(s, s)
        return Scattering(*(where(i < count, x, y) for x, y in zip(new, s, strict=True)))

    return fori_loop(0, DOUBLINGS, double, one)


def sliced(
    layer: Callable[[Any, Any], Propagation], k: Any, exponent: Any, below: Number
) -> tuple[Number, Number]:
    """Return reflection and transmission of a layer, by slices where it is strongly dichroic.

    **Arguments:** `layer(k, direction)` returns the propagation; `exponent`: difference of the attenuations;
    `below`: reflection of what lies below.
    """
    lower = to_complex(below)
    shape = jnp.broadcast_shapes(jnp.shape(k), jnp.shape(exponent), lower.shape[2:])
    xp = namespace(k, exponent, lower)
    lower = xp.broadcast_to(lower, (2, 2, *shape))
    count = slice_count(exponent, shape)
    needed = count > 0
    # the whole layer, where it needs no slices
    depth = k * xp.exp2(-count)
    direction = xp.array([1.0, -1.0], depth.dtype).reshape(2, *[1] * len(shape))
    propagation = layer(depth, direction)
    matrix = transfer(propagation, direction)
    loss = xp.broadcast_to(xp.exp(-propagation.growth), (2, *shape))
    upwards = matrix[:, :, 0]
    through = inverse(upwards[:2, :2] + product(upwards[:2, 2:], lower))
    direct = product(upwards[2:, :2] + product(upwards[2:, 2:], lower), through), through * loss[0]

    def by_slices(state: Any) -> Any:
        whole = doubled(scattering(matrix, loss), count)
        inside = product(inverse(one_minus(product(whole.below, lower))), whole.down)
        reflected = whole.reflected + product(product(whole.up, lower), inside)
        return where(needed, reflected, state[0]), where(needed, inside, state[1])

    reached = cond(xp.any(needed), by_slices, lambda state: state, stored(direct))
    return to_pair(reached[0]), to_pair(reached[1])
