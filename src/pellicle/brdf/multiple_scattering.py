"""Light reflected more than once between GGX microfacets, as a lobe beside that of single reflections.

C. Kulla and A. Conty, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH course 2017: a lobe
(1 − E(i))(1 − E(o))/(π(1 − Ē)) returns what a single reflection by mirror-like facets loses, where E is its
directional albedo and Ē the mean of E. The colour F̄² Ē/(1 − F̄(1 − Ē)) counts the reflections of the mean F̄ of
the film's colour (Fdez-Agüera's form of theirs): all of them have the same colour, whatever their angle.

A white surface then returns all light, within 5e-4 for α from 0.003 to 1.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.brdf.broadcasting import Parameters, column
from pellicle.brdf.film_colour import Colour, clenshaw
from pellicle.optics.pair import sqrt

_LOSS = np.array(
    [
        (0.18623, 0.21441, 0.04861, 0.01358, 0.00201, -0.00322, -0.00211),
        (0.18848, 0.20496, 0.08327, 0.01931, 0.01177, -0.00802, -0.00388),
        (-0.06091, 0.00304, 0.01867, 0.04136, 0.00756, -0.00511, -0.00377),
        (-0.05018, -0.03782, 0.02868, 0.02778, 0.01497, -0.00519, -0.00309),
        (-0.02258, -0.00917, 0.00379, 0.03185, 0.01012, -0.00249, -0.00251),
        (-0.00104, -0.02763, 0.00921, 0.01619, 0.01184, -0.00219, -0.00181),
        (-0.00141, -0.00572, -0.0036, 0.01542, 0.00637, -0.00096, -0.00113),
        (0.00322, -0.00859, 0.00203, 0.00547, 0.0052, -0.00076, -0.00075),
        (-0.00058, 0.00132, -0.00258, 0.00445, 0.00203, -0.00052, -0.00029),
        (0.00061, -0.00089, 0.00024, 0.00082, 0.00106, -0.00024, -0.00019),
        (-0.00042, 0.00097, -0.00075, 0.00059, 0.00027, -0.00023, 1e-05),
    ]
)
"""Chebyshev coefficients of 1 − E in 2√(μ/(μ + α)) − 1 and 2α − 1, by `scripts/derive_ggx_albedo.py`."""
_LEAST = 1e-6
"""Loss below which there is none: the error of the polynomial for nearly smooth facets."""
_NODE, _WEIGHT = (np.polynomial.legendre.leggauss(24)[k] for k in (0, 1))
_COSINE, _SHARE = 0.5 * (_NODE + 1), 0.5 * (_NODE + 1) * _WEIGHT
"""Cosines of angles over the hemisphere, and their shares of light from all of it."""


def loss(cosine: Any, alpha: Any) -> Any:
    """Return 1 − E(μ): the light from a cosine that single reflections by mirror-like facets lose."""
    cosine = jnp.maximum(cosine, 0.0)
    both = cosine + alpha
    x = 2 * sqrt(cosine / jnp.where(both > 0, both, 1.0)) - 1
    powers = [jnp.ones_like(alpha), 2 * alpha - 1]
    while len(powers) < _LOSS.shape[1]:
        powers.append(2 * powers[1] * powers[-1] - powers[-2])
    series = jnp.stack(powers, axis=-1) @ jnp.asarray(_LOSS.T, x.dtype)
    return jnp.maximum(clenshaw(jnp.moveaxis(series, -1, 0), 2 * x), _LEAST)


def mean_loss(alpha: Any) -> Any:
    """Return 1 − Ē, the mean of `loss` over light from the whole hemisphere."""
    cosine, share = (jnp.asarray(x, alpha.dtype) for x in (_COSINE, _SHARE))
    return loss(cosine, alpha[..., None]) @ share


def mean_colour(parameters: Parameters, colour: Colour, dtype: Any) -> Any:
    """Return F̄, the mean of the film's colour over light from the whole hemisphere, (..., channels)."""
    sine = np.sqrt(1 - _COSINE**2)
    # a map of thicknesses has its own mean at each point
    axes = (-1, *(1,) * jnp.ndim(parameters["thickness"]), 3)
    i, o = (
        jnp.asarray(np.stack([side * sine, 0 * sine, _COSINE], axis=-1).reshape(axes), dtype)
        for side in (1, -1)
    )
    values = colour(parameters, i, o)
    if jnp.ndim(values) < len(axes):  # at normal incidence on all facets
        return values
    return jnp.tensordot(jnp.asarray(_SHARE, values.dtype), values, axes=1)


def lobe(parameters: Parameters, i: Any, o: Any, colour: Colour) -> Any:
    """Return the BRDF of light reflected more than once, times the parameter `multiple_scattering`."""
    alpha = jnp.asarray(parameters["roughness"], i.dtype)
    lost = mean_loss(alpha)
    shape = loss(i[..., 2], alpha) * loss(o[..., 2], alpha) / (jnp.pi * lost)
    mean, lost = mean_colour(parameters, colour, i.dtype), column(lost)
    coloured = mean * mean * (1 - lost) / (1 - mean * lost)
    return column(parameters["multiple_scattering"] * shape) * coloured
