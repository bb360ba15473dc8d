"""Broadcasting of BRDF parameters against directions: a parameter is one number, or a map of samples."""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import jax.numpy as jnp

Parameters: TypeAlias = Mapping[str, Any]
"""Key → a number, or a map (...) that broadcasts with the directions. `n` and `k` of any medium
and `wavelengths` have a last axis of wavelengths, or are one number for all of them. `weights` (wavelengths,
channels) are the bands of a sensor; without them each wavelength is a channel."""

Evaluate: TypeAlias = Callable[[Parameters, Any, Any], Any]
"""(parameters, i, o) → (..., channels), without a test of the horizon."""


def column(samples: Any) -> Any:
    """Reshape a map (...) to (..., 1), so that it broadcasts with channels; return a number unchanged."""
    return samples if jnp.ndim(samples) == 0 else jnp.asarray(samples)[..., None]


def in_channels(parameters: Parameters, spectrum: Any) -> Any:
    """Weight a spectrum (..., wavelengths) by the bands of a sensor, `weights`, if there are any."""
    weights = parameters.get("weights")
    return spectrum if weights is None else spectrum @ weights


def weighted_sum(
    parameters: Parameters, lobes: Callable[[], Any], base: Callable[[], Any] | None = None
) -> Any:
    """Return specular · lobes + diffuse · base; a weight absent from the parameters leaves its term out.

    `base` None is a grey base, of value 1.
    """
    terms = [column(parameters["specular"]) * lobes()] if "specular" in parameters else []
    if "diffuse" in parameters:
        weight = column(parameters["diffuse"])
        terms.append(weight if base is None else weight * base())
    return sum(terms[1:], terms[0])
