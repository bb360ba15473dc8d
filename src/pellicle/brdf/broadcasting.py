"""How parameters and directions broadcast: a parameter is one number, or a map as large as the directions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import jax.numpy as jnp

Parameters: TypeAlias = Mapping[str, Any]
"""Key → a number, or a map (...) that broadcasts with the directions. `n` and `k` of any medium,
`wavelengths` and `weights` have a last axis of channels, or are one number for all of them."""


def column(map_: Any) -> Any:
    """A map (...) as (..., 1), to broadcast with channels; a number as it is."""
    return map_ if jnp.ndim(map_) == 0 else jnp.asarray(map_)[..., None]


def weighted_sum(
    parameters: Parameters, lobes: Callable[[], Any], below: Callable[[], Any] | None = None
) -> Any:
    """specular · lobes + diffuse · below; a weight that is not among the parameters leaves its part out."""
    parts = [column(parameters["specular"]) * lobes()] if "specular" in parameters else []
    if "diffuse" in parameters:
        weight = column(parameters["diffuse"])
        parts.append(weight if below is None else weight * below())
    return sum(parts[1:], parts[0])
