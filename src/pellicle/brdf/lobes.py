"""Lobes around the mirror direction, Blinn-Phong and GGX microfacets with Smith's shadowing, and their sums.

The normal is z. Values and gradients are finite at the edge of a lobe, where both are zero. A parameter of a
BRDF is one number, or a map of samples, which broadcasts against directions.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.brdf.directions import Vectors, cosine_to_half, half_vector
from pellicle.optics.pair import sqrt

Parameters: TypeAlias = Mapping[str, Any]
"""Key → a number, or a map (...) that broadcasts with the directions. `n` and `k` of any medium
and `wavelengths` have a last axis of wavelengths, or are one number for all of them. `weights` (wavelengths,
channels) are the bands of a sensor; without them each wavelength is a channel."""

Evaluate: TypeAlias = Callable[[Parameters, Vectors, Vectors], Any]
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


def power(cosine: Any, exponent: Any) -> Float[Array, "..."]:
    """Return cos₊^e: 0 with zero slope where the cosine is not positive."""
    positive = cosine > 0
    return jnp.where(positive, jnp.exp(exponent * jnp.log(jnp.where(positive, cosine, 1.0))), 0.0)


def cosine_to_mirror(i: Vectors, o: Vectors) -> Float[Array | np.ndarray, "..."]:
    """Return ⟨r, o⟩ with r the mirror direction of i."""
    return i[..., 2] * o[..., 2] - i[..., 0] * o[..., 0] - i[..., 1] * o[..., 1]


def blinn_phong(i: Vectors, o: Vectors, exponent: Any) -> Float[Array, "..."]:
    """Return ⟨n, h⟩₊^e, as published: 1 at the peak (J. F. Blinn, SIGGRAPH 1977)."""
    return power(half_vector(i, o)[..., 2], exponent)


def ggx(h: Vectors, alpha: Any) -> Float[Array, "..."]:
    """Return D(h) in 1/sr, the density of facets with normal h, so that ∫ D ⟨n, h⟩ dω = 1.

    `alpha` is the roughness, above 0. sin² θ is taken from the components of h: 1 − cos² θ would lose a
    narrow lobe in float32.

    **Source:** B. Walter et al. 2007.
    """
    square = alpha * alpha
    spread = square * h[..., 2] ** 2 + h[..., 0] ** 2 + h[..., 1] ** 2
    exists = spread > 0  # there is no half vector where i = −o
    return jnp.where(exists, square / (jnp.pi * jnp.where(exists, spread, 1.0) ** 2), 0.0)


def smith(i: Vectors, o: Vectors, alpha: Any) -> Float[Array, "..."]:
    """Return G₂/(4⟨i, n⟩⟨o, n⟩): Smith's height-correlated shadowing and masking of GGX, over its Jacobian.

    It is 0 where both directions are on or below the horizon.

    **Source:** E. Heitz, JCGT 3 (2014), eq. 99.
    """
    ci, co = i[..., 2], o[..., 2]
    square = alpha * alpha

    def projected_root(c):  # c √(1 + α² tan² θ)
        return sqrt(c * c + square * (1 - c * c))

    denominator = co * projected_root(ci) + ci * projected_root(co)
    positive = denominator > 0
    return jnp.where(positive, 0.5 / jnp.where(positive, denominator, 1.0), 0.0)


def microfacets(i: Vectors, o: Vectors, alpha: Any) -> Float[Array, "..."]:
    """Return D G₂/(4⟨i, n⟩⟨o, n⟩) in 1/sr, the BRDF of mirror-like GGX facets."""
    return ggx(half_vector(i, o), alpha) * smith(i, o, alpha)


def two_lobes(parameters: Any, i: Vectors, o: Vectors) -> Any:
    """BRDF (samples, channels) of a diffuse part and two lobes of GGX microfacets with Schlick's Fresnel.

    Each part has its own colour: `lobe_1`, `lobe_2` and `diffuse` are (channels,); `roughness_1`,
    `roughness_2` and `normal`, the reflectance at normal incidence, are numbers. `i` and `o` are unit vectors
    (samples, 3).
    """
    edge = (1 - cosine_to_half(i, o)) ** 5
    fresnel = parameters["normal"] + (1 - parameters["normal"]) * edge
    rough, smooth = (
        parameters[f"lobe_{k}"] * (microfacets(i, o, parameters[f"roughness_{k}"]) * fresnel)[:, None]
        for k in (1, 2)
    )
    return rough + smooth + parameters["diffuse"] + jnp.zeros_like(i[:, :1])
