"""Strongly dichroic layers: one wave is absorbed while the other passes.

A product of transfer matrices loses the surviving wave there. Such a layer is cut into 2ᵐ equal slices,
and the scattering matrix of one slice is doubled m times: nothing in it exceeds 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.berreman.matrices import Matrix, inverse, one_minus, plus
from pellicle.optics.berreman.propagation import Propagation, select
from pellicle.optics.pair import Pair, imag, real

DIRECT = 3.0
"""Largest difference of the attenuations, as exponents of amplitudes, that takes no slices: it costs e³."""

DOUBLINGS = 22
"""Most doublings: they serve differences up to 1e7."""


class Scattering(NamedTuple):
    """Scattering matrix of a layer: light from above and from below."""

    reflected: Matrix
    down: Matrix
    up: Matrix
    below: Matrix


def join(upper: Scattering, lower: Scattering) -> Scattering:
    """Return the scattering matrix of two layers (Redheffer's star product)."""
    between_down = inverse(one_minus(upper.below @ lower.reflected)) @ upper.down
    between_up = inverse(one_minus(lower.reflected @ upper.below)) @ lower.up
    return Scattering(
        plus(upper.reflected, upper.up @ lower.reflected @ between_down),
        lower.down @ between_down,
        upper.up @ between_up,
        plus(lower.below, lower.down @ upper.below @ between_up),
    )


def scattering(propagation: Propagation, direction: Any) -> Scattering:
    """Return the scattering matrix of a layer.

    **Arguments:** `propagation` upwards in its first row and, with the opposite transverse index, in its
    second; `direction` is 1 and −1 in these. Reversed, Hy and −Hx change their signs.
    """
    waves = []  # down p, s, up p, s at the far face, for each of them at the near face
    for E, H in (((1, 0), (1, 0)), ((0, 1), (0, 1)), ((1, 0), (-1, 0)), ((0, 1), (0, -1))):
        zero = 0.0 * direction
        near = (E[0] + zero, H[0] * direction, E[1] + zero, H[1] * direction)
        Ex, Hy, Ey, Hx = propagation.apply(near)
        Hy, Hx = direction * Hy, direction * Hx
        waves.append((0.5 * (Ex + Hy), 0.5 * (Ey + Hx), 0.5 * (Ex - Hy), 0.5 * (Ey - Hx)))

    def block(side: int, row: int, column: int) -> Matrix:
        elements = (waves[column + j][row + i] for i in range(2) for j in range(2))
        return Matrix(*(Pair(real(x)[side], imag(x)[side]) for x in elements))

    through, back = inverse(block(0, 0, 0)), inverse(block(1, 2, 2))
    loss = jnp.exp(-propagation.growth)
    return Scattering(
        reflected=block(0, 2, 0) @ through,
        down=Matrix(*(x * loss[0] for x in through)),
        up=Matrix(*(x * loss[1] for x in back)),
        below=Matrix(*(-x for x in through @ block(0, 0, 2))),
    )


def sliced(
    layer: Callable[[Any, Any], Propagation],
    k: Any,
    exponent: Any,
    below: Matrix,
    direct: Matrix,
    through: Matrix,
) -> tuple[Matrix, Matrix]:
    """Return reflection and transmission of a layer, by slices where it is strongly dichroic.

    **Arguments:** `layer(k, direction)` returns the propagation; `exponent`: difference of the attenuations;
    `below`: reflection of what lies below; `direct` and `through`: the result without slices.
    """
    shape = jnp.broadcast_shapes(*map(jnp.shape, jax.tree.leaves((k, exponent, below, direct, through))))

    def spread(matrix: Matrix) -> Matrix:
        parts = ((jnp.broadcast_to(part(x), shape) for part in (real, imag)) for x in matrix)
        return Matrix(*(Pair(*both) for both in parts))

    state = spread(direct), spread(through)
    needed = exponent > DIRECT
    count = jnp.ceil(jnp.log2(jnp.where(needed, exponent / DIRECT, 1.0)))

    def by_slices(state: Any) -> Any:
        depth = jnp.where(needed, k, 0.0) * jnp.exp2(-count)
        direction = jnp.array([1.0, -1.0], depth.dtype).reshape(2, *[1] * len(shape))
        one = Scattering(*map(spread, scattering(layer(depth, direction), direction)))

        def double(i: Any, s: Scattering) -> Scattering:
            twice, more = join(s, s), i < count
            return Scattering(*(select(more, new, old) for new, old in zip(twice, s, strict=True)))

        whole = jax.lax.fori_loop(0, DOUBLINGS, double, one)
        inside = inverse(one_minus(whole.below @ below)) @ whole.down
        reflected = plus(whole.reflected, whole.up @ below @ inside)
        return select(needed, spread(reflected), state[0]), select(needed, spread(inside), state[1])

    return jax.lax.cond(jnp.any(needed), by_slices, lambda state: state, state)
