"""Groups of layers that are repeated: powers of their characteristic matrix, and linear drifts.

A matrix of a layer or a group turns the fields (E, H) at its lower face into those at its upper face. It is
kept as ((row of E, row of H), |scale|²), each row an array whose first axis has its two columns, divided by
its norm. Its power is computed by squaring, so that neither time nor the size of a program grows with the
number of repeats but by its logarithm.
"""

from typing import Any

import equinox as eqx
import jax
import numpy as np

from pellicle.optics.pair import abs2, inverse_root, scan, stop_gradient, where


class Repeats(eqx.Module):
    """Groups among coherent layers.

    **Arguments:** `runs`, (repeats, layers) from the ambient down, which together are all layers; `drift` of
    each layer, the relative change of its thickness from the first repeat to the last, or None.
    """

    runs: tuple[tuple[int, int], ...] = eqx.field(static=True)
    drift: tuple[Any, ...]

    @property
    def count(self) -> int:
        """Largest number of repeats."""
        return max((count for count, _ in self.runs), default=1)


def places(count: int) -> np.ndarray:
    """Return the places of repeats in a linear drift, −½ to ½; 0 for a single one."""
    return np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)


def matrix_power(identity: Any, matrix: Any, count: int) -> Any:
    """Return the power `count` of a matrix, in the form of the module."""

    def step(power: Any, bit: Any) -> tuple[Any, None]:
        square = _times(power, power)
        more = _times(square, matrix)
        return jax.tree.map(lambda x, y: where(bit, x, y), more, square), None

    return scan(step, identity, np.array([digit == "1" for digit in f"{count:b}"]))[0]


def _times(first: Any, second: Any) -> Any:
    ((a, b), (c, d)), scale = first
    (E, H), other = second
    E, H = a * E + b * H, c * E + d * H
    size = stop_gradient((abs2(E) + abs2(H)).sum(axis=0))
    shrink = inverse_root(size)
    return (E * shrink, H * shrink), scale * other / size
