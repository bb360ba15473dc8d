"""Two lobes of microfacets and a diffuse part: a surface without a layer.

On paints with flakes two lobes fit better than either layered model.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from pellicle.brdf import lobes
from pellicle.brdf.directions import cosine_to_half


def two_lobes(parameters: Any, i: Any, o: Any) -> Any:
    """BRDF (samples, channels) of a diffuse part and two lobes of GGX microfacets with Schlick's Fresnel.

    Each part has its own colour: `lobe_1`, `lobe_2` and `diffuse` are (channels,); `roughness_1`,
    `roughness_2` and `normal`, the reflectance at normal incidence, are numbers. `i` and `o` are unit vectors
    (samples, 3).
    """
    edge = (1 - cosine_to_half(i, o)) ** 5
    fresnel = parameters["normal"] + (1 - parameters["normal"]) * edge
    rough, smooth = (
        parameters[f"lobe_{k}"] * (lobes.microfacets(i, o, parameters[f"roughness_{k}"]) * fresnel)[:, None]
        for k in (1, 2)
    )
    return rough + smooth + parameters["diffuse"] + jnp.zeros_like(i[:, :1])
