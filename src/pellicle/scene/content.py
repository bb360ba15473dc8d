"""Pytrees by content, as keys of what was computed from them."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, TypeVar

import jax
import numpy as np

KEPT = 32
"""Results that a function keeps: a scene at some hundred wavelengths takes some ten kB."""

Result = TypeVar("Result")


class Content:
    """A pytree of numbers and arrays that equals another one of the same structure and numbers."""

    def __init__(self, tree: Any):
        self.tree = tree
        leaves, structure = jax.tree_util.tree_flatten(tree)
        self._key = structure, tuple(_content(leaf) for leaf in leaves)
        self._hash = hash(self._key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Content) and self._hash == other._hash and self._key == other._key


def _content(leaf: Any) -> Any:
    if isinstance(leaf, np.ndarray | np.generic | jax.Array):
        array = np.asarray(leaf)
        return type(leaf), array.dtype.str, array.shape, array.tobytes()
    return type(leaf), leaf


def remembered(function: Callable[..., Result]) -> Callable[..., Result]:
    """Keep the last results of a function of pytrees, by the content of its arguments.

    Equal scenes and grids are then prepared once. An argument may be its `Content`. The function must be
    pure, and nobody may change what it returns.
    """

    @lru_cache(maxsize=KEPT)
    def computed(*arguments: Content) -> Result:
        return function(*(own.tree for own in arguments))

    @wraps(function)
    def call(*arguments: Any) -> Result:
        return computed(*(own if isinstance(own, Content) else Content(own) for own in arguments))

    return call
