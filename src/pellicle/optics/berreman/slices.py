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
from pellicle.optics.berreman.propagation import Fields, Propagation, select
from pellicle.optics.pair import Number, Pair, imag, real

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


def wave_columns(propagation: Propagation, reverse: bool) -> list[tuple[Number, Number, Number, Number]]:
    """Return the waves (down p, s, up p, s) at the far face, for each of the four waves at the near face.

    `reverse` undoes the signs of Hy and −Hx with which `uniaxial.propagation` propagates upwards.
    """
    sign = -1 if reverse else 1
    columns = []
    for E, H in (((1, 0), (1, 0)), ((0, 1), (0, 1)), ((1, 0), (-1, 0)), ((0, 1), (0, -1))):
        fields: Fields = (
            Pair(1.0 * E[0], 0.0),
            Pair(1.0 * sign * H[0], 0.0),
            Pair(1.0 * E[1], 0.0),
            Pair(1.0 * sign * H[1], 0.0),
        )
        Ex, Hy, Ey, Hx = propagation.apply(fields)
        Hy, Hx = sign * Hy, sign * Hx
        columns.append((0.5 * (Ex + Hy), 0.5 * (Ey + Hx), 0.5 * (Ex - Hy), 0.5 * (Ey - Hx)))
    return columns


def scattering(up: Propagation, down: Propagation) -> Scattering:
    """Return the scattering matrix of a layer from its propagation up and down."""

    def block(columns: Any, rows: int, first: int) -> Matrix:
        one, two = columns[first], columns[first + 1]
        return Matrix(one[rows], two[rows], one[rows + 1], two[rows + 1])

    forward, backward = wave_columns(up, False), wave_columns(down, True)
    through = inverse(block(forward, 0, 0))
    back = inverse(block(backward, 2, 2))
    loss, loss_back = jnp.exp(-up.growth), jnp.exp(-down.growth)
    return Scattering(
        reflected=block(forward, 2, 0) @ through,
        down=Matrix(*(x * loss for x in through)),
        up=Matrix(*(x * loss_back for x in back)),
        below=Matrix(*(-x for x in through @ block(forward, 0, 2))),
    )


def sliced(
    layer: Callable[[Any, bool], Propagation],
    k: Any,
    exponent: Any,
    below: Matrix,
    direct: Matrix,
    through: Matrix,
) -> tuple[Matrix, Matrix]:
    """Return reflection and transmission of a layer, by slices where it is strongly dichroic.

    **Arguments:** `layer(k, upwards)` returns the propagation; `exponent`: difference of the attenuations;
    `below`: reflection of what lies below; `direct` and `through`: the result without slices.
    """
    shape = jnp.broadcast_shapes(
        *(jnp.shape(x) for x in jax.tree.leaves((k, exponent, below, direct, through)))
    )

    def spread(matrix: Matrix) -> Matrix:
        return Matrix(
            *(Pair(jnp.broadcast_to(real(x), shape), jnp.broadcast_to(imag(x), shape)) for x in matrix)
        )

    state = spread(direct), spread(through)
    needed = exponent > DIRECT
    count = jnp.ceil(jnp.log2(jnp.where(needed, exponent / DIRECT, 1.0)))

    def by_slices(state: Any) -> Any:
        depth = jnp.where(needed, k, 0.0) * jnp.exp2(-count)
        one = Scattering(*map(spread, scattering(layer(depth, False), layer(depth, True))))

        def double(i: Any, s: Scattering) -> Scattering:
            twice, more = join(s, s), i < count
            return Scattering(*(select(more, new, old) for new, old in zip(twice, s, strict=True)))

        whole = jax.lax.fori_loop(0, DOUBLINGS, double, one)
        inside = inverse(one_minus(whole.below @ below)) @ whole.down
        reflected = plus(whole.reflected, whole.up @ below @ inside)
        return select(needed, spread(reflected), state[0]), select(needed, spread(inside), state[1])

    return jax.lax.cond(jnp.any(needed), by_slices, lambda state: state, state)
