"""Choice between NumPy and JAX for formulas that serve both.

Refractive indices of known media are computed once, by NumPy, which compiles nothing: JAX takes 30 to 90 ms
to trace and load even a program of a few operations. Within traced programs the same formulas use JAX.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def namespace(*arrays: Any) -> Any:
    """Return `numpy` where an array is NumPy's and none is JAX's, else `jax.numpy`. Accepts pytrees."""
    leaves = jax.tree_util.tree_leaves(arrays)
    if any(isinstance(leaf, jax.Array) for leaf in leaves):
        return jnp
    return np if any(isinstance(leaf, np.ndarray | np.generic) for leaf in leaves) else jnp


class custom_jvp:
    """`jax.custom_jvp`, which calls the function itself with NumPy arrays."""

    def __init__(self, function: Callable[..., Any]):
        self.function, self.traced = function, jax.custom_jvp(function)
        self.defjvp = self.traced.defjvp
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return (self.function if namespace(*arguments) is np else self.traced)(*arguments)


def fori_loop(lower: int, upper: int, step: Callable[[Any, Any], Any], state: Any) -> Any:
    """`jax.lax.fori_loop`, or a loop in Python where the state is NumPy's."""
    if namespace(state) is not np:
        return jax.lax.fori_loop(lower, upper, step, state)
    for i in range(lower, upper):
        state = step(i, state)
    return state
