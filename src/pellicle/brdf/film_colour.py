"""RGB reflectance of one film against the cosine at which a facet is lit.

The film's colour depends on the directions only through ⟨i, h⟩, so it is computed at Chebyshev
nodes of it and each sample evaluates one polynomial: the film drops out of the cost per sample.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import angle_to_half, cosine_to_half
from pellicle.brdf.shapes import Parameters, column
from pellicle.optics import film
from pellicle.optics.interface import allow_tunnelling
from pellicle.optics.number import Number, Pair, sincos_poly

NODES = 32
"""Nodes of ⟨i, h⟩. Of 400 random films at three wavelengths the worst error is 1e-4 below 500 nm, 9e-4
below 1000 nm and 7e-3 below 1500 nm (clear films on a bright metal; the median is below 1e-9)."""


def index(n: Any, k: Any) -> Number:
    """n + ik; k None means that the medium cannot absorb."""
    return n if k is None else Pair(n, k)


def reflectance(parameters: Parameters, angle: Any) -> Any:
    """Unpolarised Airy reflectance (..., wavelengths) at angles (...) in radians, in air.

    Reads `thickness` (nm), `n`, `k`, `base_n`, `base_k`, `wavelengths` (nm), and `ambient_n` where
    the ambient is not air.
    """
    s, p = film.film(
        parameters.get("ambient_n", 1.0),
        index(parameters["n"], parameters.get("k")),
        allow_tunnelling(index(parameters["base_n"], parameters.get("base_k"))),
        2 * jnp.pi / parameters["wavelengths"] * column(parameters["thickness"]),
        angle[..., None],
        sincos=sincos_poly,
    )
    return 0.5 * (film.reflectance(s) + film.reflectance(p))


def rgb(parameters: Parameters, spectrum: Any) -> Any:
    """(..., wavelengths) → (..., 3): `weights` (wavelengths, 3) of a sensor, or each wavelength a channel."""
    weights = parameters.get("weights")
    return spectrum if weights is None else spectrum @ weights


def exact(parameters: Parameters, i: Any, o: Any) -> Any:
    """The film's RGB reflectance for light from i to o, computed for each sample."""
    return rgb(parameters, reflectance(parameters, angle_to_half(i, o)))


def coefficients(parameters: Parameters, dtype: Any, nodes: int = NODES) -> Any:
    """Chebyshev coefficients (nodes, 3) of the film's RGB reflectance in 2⟨i, h⟩ − 1."""
    turn = np.pi * (np.arange(nodes) + 0.5) / nodes
    angle = jnp.asarray(np.arccos(0.5 + 0.5 * np.cos(turn)), dtype)
    transform = 2 / nodes * np.cos(np.outer(np.arange(nodes), turn))
    transform[0] *= 0.5
    return jnp.asarray(transform, dtype) @ rgb(parameters, reflectance(parameters, angle))


def chebyshev(parameters: Parameters, i: Any, o: Any) -> Any:
    """The film's RGB reflectance by its Chebyshev polynomial; with a thickness map, `exact`."""
    if jnp.ndim(parameters["thickness"]) > 0:
        return exact(parameters, i, o)
    cosine = cosine_to_half(i, o)
    x = (4 * cosine - 2)[..., None]
    one, two = 0.0, 0.0
    series = coefficients(parameters, cosine.dtype)
    for term in range(NODES - 1, 0, -1):  # Clenshaw
        one, two = series[term] + x * one - two, one
    return series[0] + 0.5 * x * one - two
