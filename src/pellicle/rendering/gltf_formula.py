"""Film colour of glTF: the approximation of Belcour and Barla that `KHR_materials_iridescence` publishes.

Fresnel's equations are replaced by Schlick's at both faces, polarisation and the base's extinction are left
out. three.js, Babylon.js and others use the same code.

Source: Khronos, KHR_materials_iridescence, "Implementation Notes" (2022).
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.rendering.appearance import Appearance
from pellicle.rendering.belcour_barla import series
from pellicle.rendering.formula import Formula, Key, Numbers

XYZ_TO_REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def schlick(normal: Any, cosine: Any) -> Any:
    """Reflectance of a face by Schlick's approximation, of that at normal incidence."""
    return normal + (1 - normal) * (1 - cosine) ** 5


def base_index(normal: Any) -> Any:
    """Index of a base in air, of its reflectance at normal incidence."""
    normal = jnp.clip(normal, 0.0, 0.9999)
    lit = normal > 0  # the root of 0 has no slope
    root = jnp.where(lit, jnp.sqrt(jnp.where(lit, normal, 1.0)), 0.0)
    return (1 + root) / (1 - root)


_PRODUCT = (1e-5, 0.9999)
"""Bounds of the product of both reflectances in the published code."""


def film(index: Any, base: Any, thickness: Any, cosine: Any) -> Any:
    """Reflectance (..., 3) of a film of one `index` on a base of reflectances (3,) in air, linear sRGB."""
    # without a film its index becomes that of air
    ratio = jnp.clip(thickness / 0.03, 0.0, 1.0)
    index = 1 + (index - 1) * ratio**2 * (3 - 2 * ratio)
    inside = jnp.sqrt(1 - (1 - cosine**2) / index**2)
    below = base_index(base)
    first = schlick(((index - 1) / (index + 1)) ** 2, cosine)[..., None]
    index = jnp.asarray(index)[..., None]
    second = schlick(((below - index) / (below + index)) ** 2, inside[..., None])
    shift = jnp.pi + jnp.where(below < index, jnp.pi, 0.0)
    path = 2 * index[..., 0] * thickness * inside
    shift = jnp.broadcast_to(shift, (*path.shape, 3))
    total = series(first, second, path, shift, lambda xyz: xyz @ jnp.asarray(XYZ_TO_REC709.T), _PRODUCT)
    return jnp.maximum(total, 0.0)


def colour(numbers: Numbers, thickness: Any, cosine: Any) -> Any:
    """Linear sRGB (..., 3): the film's, mixed with the base's own where `factor` is below 1."""
    base = jnp.asarray(numbers["base"])
    with_film = film(jnp.asarray(numbers["ior"]), base, jnp.asarray(thickness), jnp.asarray(cosine))
    bare = schlick(base, jnp.asarray(cosine)[..., None])
    return bare + numbers["factor"] * (with_film - bare)


def physical(look: Appearance) -> Numbers:
    """Index of the layer at 550 nm, and the reflectance of the base at normal incidence."""
    base = look.bare
    if not look.metallic:
        base = np.full(3, ((look.base[1].real - 1) / (look.base[1].real + 1)) ** 2)
    return {"ior": look.index, "base": base, "factor": 1.0}


GLTF = Formula(
    "glTF's approximation of Belcour and Barla",
    (Key("ior", 1.0, 4.0), Key("base", 1e-6, 1.0, 3), Key("factor", 0.25, 1.0)),
    colour,
    physical,
)
