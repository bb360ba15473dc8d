"""RGB reflectance of one film against the cosine at which a facet is lit.

The film's colour depends on the directions only through ⟨i, h⟩, so it is computed at Chebyshev
nodes of it and each sample evaluates one polynomial: the film drops out of the cost per sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np

from pellicle.brdf.broadcasting import Parameters, column
from pellicle.brdf.directions import angle_to_half, cosine_to_half
from pellicle.optics import coherent, orders, response
from pellicle.optics.interface import allow_tunnelling
from pellicle.optics.pair import Number, Pair

SHORTEST = 400.0
"""Wavelength (nm) at which `nodes` counts: eyes and cameras see next to nothing below."""


def node_count(thickest: float) -> int:
    """How many nodes of ⟨i, h⟩ keep a film of at most `thickest` nm within 1e-4 of its reflectance.

    Measured as the worst of 400 random films (n and base from 1.05, k to 0.3, metals among the bases)
    at 445 nm: 40 nodes to 500 nm, 56 to 1000, 80 to 1500, 128 to 2000, 160 to 3000, a line in
    thickness over wavelength. Below it is the base, not the film, that asks for nodes.
    """
    return 8 * math.ceil((22 + 22 * thickest / SHORTEST) / 8)


def index(n: Any, k: Any) -> Number:
    """n + ik; k None means that the medium cannot absorb."""
    return n if k is None else Pair(n, k)


Reflectance: TypeAlias = Callable[[Parameters, Any], Any]
"""(parameters, angle in radians (...), None for normal incidence) → (..., wavelengths)."""

Colour: TypeAlias = Callable[[Parameters, Any, Any], Any]
"""(parameters, i, o) → (..., 3), or a channel for each wavelength."""


def _lit(parameters: Parameters, angle: Any, tunnelling: bool) -> tuple[Any, Any, Any, Any, Any]:
    """Ambient, film, base, 2πd/λ and angle, (..., wavelengths)."""
    base = index(parameters["base_n"], parameters.get("base_k"))
    return (
        parameters.get("ambient_n", 1.0),
        index(parameters["n"], parameters.get("k")),
        allow_tunnelling(base) if tunnelling else base,
        2 * jnp.pi / parameters["wavelengths"] * column(parameters["thickness"]),
        None if angle is None else angle[..., None],
    )


def airy(polarisations: str = "sp", tunnelling: bool = True) -> Reflectance:
    """Airy's reflectance, the mean over `polarisations`, of a film in air.

    It reads `thickness` (nm), `n`, `k`, `base_n`, `base_k`, `wavelengths` (nm), and `ambient_n` where
    the ambient is not air; without `k` or `base_k` the medium cannot absorb. `tunnelling=False`
    promises that no wave is totally reflected.
    """

    def reflectance(parameters: Parameters, angle: Any) -> Any:
        ambient, layer, base, phase, theta = _lit(parameters, angle, tunnelling)
        return response.reflectance(
            *coherent.responses(
                ambient, [layer], base, [phase], theta, polarisations, propagating=not tunnelling
            )
        )

    return reflectance


reflectance = airy()
"""The unpolarised one, whatever the media."""


def without_interference(parameters: Parameters, angle: Any) -> Any:
    """The same averaged over the film's phase: order 0 of its Fourier series."""
    lit = _lit(parameters, angle, tunnelling=True)
    s, p = (orders.reflectance(orders.airy_series(*lit, letter), lambda _: 1.0, count=0) for letter in "sp")
    return 0.5 * (s + p)


def rgb(parameters: Parameters, spectrum: Any) -> Any:
    """(..., wavelengths) → (..., 3): `weights` (wavelengths, 3) of a sensor, or each wavelength a channel."""
    weights = parameters.get("weights")
    return spectrum if weights is None else spectrum @ weights


def per_sample(reflectance: Reflectance) -> Colour:
    """The film's RGB reflectance for light from i to o, computed for each sample."""
    return lambda parameters, i, o: rgb(parameters, reflectance(parameters, angle_to_half(i, o)))


exact = per_sample(reflectance)
incoherent = per_sample(without_interference)


def at_normal_incidence(reflectance: Reflectance) -> Colour:
    """The same as if light always met the facets along their normals."""
    return lambda parameters, i, o: rgb(parameters, reflectance(parameters, None))


def coefficients(parameters: Parameters, dtype: Any, count: int, reflectance: Reflectance) -> Any:
    """Chebyshev coefficients (count, 3) of the film's RGB reflectance in 2⟨i, h⟩ − 1."""
    turn = np.pi * (np.arange(count) + 0.5) / count
    angle = jnp.asarray(np.arccos(0.5 + 0.5 * np.cos(turn)), dtype)
    transform = 2 / count * np.cos(np.outer(np.arange(count), turn))
    transform[0] *= 0.5
    return jnp.asarray(transform, dtype) @ rgb(parameters, reflectance(parameters, angle))


def interpolated(count: int, reflectance: Reflectance = reflectance) -> Colour:
    """`per_sample` by a polynomial through so many nodes; with a thickness map, `per_sample` itself.

    For values: a Jacobian through `exact` costs less than through a long polynomial.
    """

    def colour(parameters, i, o):
        if jnp.ndim(parameters["thickness"]) > 0:
            return per_sample(reflectance)(parameters, i, o)
        cosine = cosine_to_half(i, o)
        series = coefficients(parameters, cosine.dtype, count, reflectance)
        # one channel after the other: a last axis of three would keep the processor's lanes empty
        return jnp.stack([_clenshaw(channel, 4 * cosine - 2) for channel in series.T], axis=-1)

    return colour


def chebyshev(thickest: float) -> Colour:
    """`exact` by as many nodes as films of at most `thickest` nm take."""
    return interpolated(node_count(thickest))


def _clenshaw(series: Any, twice_x: Any) -> Any:
    one, two = 0.0, 0.0
    for term in range(len(series) - 1, 0, -1):
        one, two = series[term] + twice_x * one - two, one
    return series[0] + 0.5 * twice_x * one - two
