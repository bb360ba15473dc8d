"""What a grid computes once: coefficients held outside the loop over its points."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata

from pellicle.optics.pair import Number


def is_reused(value: Number, beside: Any) -> bool:
    """Whether each element of `value` meets so many of `beside` that holding it takes little memory."""
    own = jnp.broadcast_shapes(*(jnp.shape(x) for x in jax.tree.leaves(value)))
    return 8 * math.prod(own) <= math.prod(jnp.broadcast_shapes(own, jnp.shape(beside)))


def hoist(value: Number, beside: Any) -> Number:
    """The same numbers, computed once and not again at every point of an array `beside` that they meet.

    XLA moves what it takes for cheap into the loop that uses it and repeats it there at each point; where
    two loops use it, each computes it anew, and not always to the same rounding. It does not look into
    a function that is not to be inlined.
    """
    if not is_reused(value, beside):
        return value
    leaves, tree = jax.tree.flatten(value)
    with set_xla_metadata(inlineable="false"):
        # as one array: with many, the compiler gives up on vector instructions
        rows = _itself(jnp.stack(jnp.broadcast_arrays(*leaves)))
    return jax.tree.unflatten(tree, list(rows))


@jax.jit
def _itself(rows: Any) -> Any:
    return rows
