"""Derivatives of functions that act at each wavelength on its own.

Forward mode carries a tangent for each parameter of a fit through all of the optics. But between the
parameters and a signal stand a few numbers at each wavelength: the indices and phases of the layers. So the
slopes in these are computed once, and a tangent is a sum of products with them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from pellicle.optics.hoisting import not_inlined


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def pointwise(function: Callable[[Any], Any], numbers: Any) -> Any:
    """Return function(numbers), differentiated by its slopes in those arrays of `numbers` that vary.

    **Arguments:** `function` returns a pytree of arrays and acts along all common axes element by element;
    `numbers` is a pytree of real arrays, which broadcast against each other.
    """
    return function(numbers)


@partial(pointwise.defjvp, symbolic_zeros=True)
def _pointwise_slope(function: Callable[[Any], Any], primal: Any, tangent: Any) -> tuple[Any, Any]:
    leaves, structure = jax.tree.flatten(primal[0])
    tangents = jax.tree.leaves(tangent[0], is_leaf=lambda x: isinstance(x, SymbolicZero))
    varying = [i for i, t in enumerate(tangents) if not isinstance(t, SymbolicZero)]

    if not varying:
        value = function(primal[0])
        return value, jax.tree.map(jnp.zeros_like, value)

    def value_and_slopes(*leaves: Any) -> Any:
        def along(i: int) -> Any:
            of_one = lambda x: function(structure.unflatten([*leaves[:i], x, *leaves[i + 1 :]]))  # noqa: E731
            return jax.jvp(of_one, (leaves[i],), (jnp.ones_like(leaves[i]),))

        values, slopes = zip(*(along(i) for i in varying), strict=True)
        return values[0], slopes

    # compiled apart: else the slopes are computed again for each parameter
    value, slopes = not_inlined(value_and_slopes, *leaves)

    def change(*slopes: Any) -> Any:
        return sum(slope * tangents[i] for i, slope in zip(varying, slopes, strict=True))

    return value, jax.tree.map(change, *slopes)
