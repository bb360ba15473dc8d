"""RGB reflectance of a film as a function of the cosine of incidence on a facet.

The colour depends on the directions only through ⟨i, h⟩. So it is computed at Chebyshev nodes of ⟨i, h⟩,
and each sample evaluates one polynomial: the cost per sample does not depend on the film.

"Thin Film Interference for Computer Graphics" (gamedev.net, 2013) sums the transmitted waves of a transparent
film and takes 1 − T. Its α = ρ₁₀ρ₁₂ contains the signs of both reflections, and its Δ adds the same half
turns again. Where they do not cancel, the published shader exchanges bright and dark (n = 1/1.5/2, 250 nm of
film, 550 nm, normal incidence: 0.0942 where Airy gives 0.0239). The corrected film is that of
`pellicle.optics.film`.
"""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import Vectors, angle_to_half, cosine_to_half
from pellicle.brdf.lobes import Parameters, column, in_channels
from pellicle.optics import coherent, orders, response
from pellicle.optics.interface import allow_tunnelling
from pellicle.optics.pair import Number, Pair

SHORTEST = 400.0
"""Wavelength (nm) for which `node_count` counts: eyes and cameras are nearly blind below."""


_SMOOTH = 32
"""Number of nodes of ⟨i, h⟩ without interference: `node_count` of no thickness, and eight more."""


def node_count(thickest: float) -> int:
    """Return the number of nodes of ⟨i, h⟩ for an error of 1e-4 in R, for films of at most `thickest` nm.

    Measured as the worst of 400 random films (n and base from 1.05, k to 0.3, metals among the bases)
    at 445 nm: 40 nodes to 500 nm, 56 to 1000, 80 to 1500, 128 to 2000, 160 to 3000, linear in thickness
    over wavelength. For thinner films the base, not the film, determines the number.
    """
    return 8 * math.ceil((22 + 22 * thickest / SHORTEST) / 8)


Reflectance: TypeAlias = Callable[[Parameters, Any], Any]
"""(parameters, angle in radians (...), None for normal incidence) → (..., wavelengths)."""

Colour: TypeAlias = Callable[[Parameters, Vectors, Vectors], Any]
"""(parameters, i, o) → (..., 3), or a channel for each wavelength."""


def _film(parameters: Parameters, angle: Any, tunnelling: bool) -> tuple[Any, Any, Any, Any, Any]:
    """Return ambient, film, base, 2πd/λ and angle, (..., wavelengths)."""

    def index(n: str, k: str) -> Number:
        return Pair(parameters[n], parameters[k]) if parameters.get(k) is not None else parameters[n]

    base = index("base_n", "base_k")
    return (
        parameters.get("ambient_n", 1.0),
        index("n", "k"),
        allow_tunnelling(base) if tunnelling else base,
        2 * jnp.pi / parameters["wavelengths"] * column(parameters["thickness"]),
        None if angle is None else angle[..., None],
    )


def airy(polarisations: str = "sp", tunnelling: bool = True) -> Reflectance:
    """Return a function for the Airy reflectance of a film, the mean over `polarisations`.

    It reads the parameters `thickness` (nm), `n`, `k`, `base_n`, `base_k`, `wavelengths` (nm), and
    `ambient_n` if the ambient is not air; without `k` or `base_k` the medium does not absorb.
    `tunnelling=False` promises that no wave is totally reflected.
    """

    def reflectance(parameters: Parameters, angle: Any) -> Any:
        ambient, layer, base, phase, theta = _film(parameters, angle, tunnelling)
        media = (ambient, [layer], base, [phase])
        responses = coherent.responses(*media, theta, polarisations, propagating=not tunnelling)
        return response.reflectance(*responses)

    return reflectance


reflectance = airy()
"""The unpolarised reflectance, for any media."""


def without_interference(parameters: Parameters, angle: Any) -> Any:
    """Return the reflectance averaged over the film's phase: order 0 of its Fourier series."""
    film = _film(parameters, angle, tunnelling=True)
    s, p = (orders.airy_series(*film, letter) for letter in "sp")
    return 0.5 * sum(orders.reflectance(series, orders.monochromatic, count=0) for series in (s, p))


SHADER_WAVELENGTHS = (650.0, 510.0, 475.0)
"""Wavelengths of R, G and B of the published shader in nm."""


def published_shader(parameters: Parameters, angle: Any) -> Any:
    """Return the reflectance of the shader, with Δ added to the phase of a signed α."""
    n0, n1, n2 = (parameters[key] for key in ("ambient_n", "n", "base_n"))
    half_turns = jnp.pi * (jnp.where(n1 < n0, 1, 0) + jnp.where(n1 < n2, 1, 0))

    def transmitted(series: orders.AirySeries):
        alpha = -series.upper * series.lower
        return series.direct / (1 + alpha * alpha - 2 * alpha * jnp.cos(series.phase + half_turns))

    return _one_minus(transmitted, parameters, angle)


def phase_average(parameters: Parameters, angle: Any) -> Any:
    """Return the mean over all phases, 1 − |β|²/(1 − α²) times the ratio of beams, as in ray optics."""
    return _one_minus(
        lambda series: series.direct / (1 - (series.upper * series.lower) ** 2), parameters, angle
    )


def _one_minus(transmitted: Callable[[orders.AirySeries], Any], parameters: Parameters, angle: Any) -> Any:
    """Return 1 − T, the mean of s and p; 1 with total reflection at either face, as in the shader."""
    n0, n1, n2 = (parameters[key] for key in ("ambient_n", "n", "base_n"))
    angle = angle[..., None]
    a = n0 * jnp.sin(angle)
    total = (a >= n1) | (a >= n2)
    safe = jnp.where(total, 0.0, angle)
    phase = 2 * jnp.pi / parameters["wavelengths"] * column(parameters["thickness"])
    s, p = (transmitted(orders.airy_series(n0, n1, n2, phase, safe, letter)) for letter in "sp")
    return jnp.where(total, 1.0, 1 - 0.5 * (s + p))


def per_sample(reflectance: Reflectance) -> Colour:
    """Return the RGB reflectance for light from i to o, computed for each sample."""
    return lambda parameters, i, o: in_channels(parameters, reflectance(parameters, angle_to_half(i, o)))


exact = per_sample(reflectance)


def at_normal_incidence(reflectance: Reflectance) -> Colour:
    """Return the RGB reflectance at normal incidence on the facets, for all directions."""
    return lambda parameters, i, o: in_channels(parameters, reflectance(parameters, None))


def coefficients(parameters: Parameters, dtype: Any, count: int, reflectance: Reflectance) -> Any:
    """Return the Chebyshev coefficients (count, 3) of the RGB reflectance in 2⟨i, h⟩ − 1."""
    phase = np.pi * (np.arange(count) + 0.5) / count
    angle = jnp.asarray(np.arccos(0.5 + 0.5 * np.cos(phase)), dtype)
    transform = 2 / count * np.cos(np.outer(np.arange(count), phase))
    transform[0] *= 0.5
    return jnp.asarray(transform, dtype) @ in_channels(parameters, reflectance(parameters, angle))


def interpolated(count: int, reflectance: Reflectance = reflectance) -> Colour:
    """Return the RGB reflectance by a polynomial through `count` nodes; `per_sample` for a thickness map.

    At single wavelengths for values only: a Jacobian through `exact` costs less than through a long
    polynomial. Over the bands of a sensor it saves most of the time of both.
    """

    def colour(parameters, i, o):
        if jnp.ndim(parameters["thickness"]) > 0:
            return per_sample(reflectance)(parameters, i, o)
        cosine = cosine_to_half(i, o)
        series = coefficients(parameters, cosine.dtype, count, reflectance)
        if "weights" in parameters:
            # a fit computes the polynomials once for all candidates, and compiles one product
            angle = jnp.arccos(jnp.clip(2 * cosine - 1, -1.0, 1.0))
            return jnp.cos(angle[..., None] * np.arange(count)) @ series
        # one channel after the other: a last axis of three would leave vector lanes empty
        return jnp.stack([clenshaw(channel, 4 * cosine - 2) for channel in series.T], axis=-1)

    return colour


def incoherent(parameters: Parameters, i: Vectors, o: Vectors) -> Any:
    """Return the RGB reflectance without interference; over bands by a polynomial, for it has no fringes."""
    over_bands = "weights" in parameters
    return (interpolated(_SMOOTH, without_interference) if over_bands else per_sample(without_interference))(
        parameters, i, o
    )


def chebyshev(thickest: float) -> Colour:
    """Return `exact` by a polynomial with enough nodes for films of at most `thickest` nm."""
    return interpolated(node_count(thickest))


def clenshaw(series: Any, twice_x: Any) -> Any:
    """Evaluate a Chebyshev series at x by Clenshaw's recurrence."""
    current, previous = 0.0, 0.0
    for term in range(len(series) - 1, 0, -1):
        current, previous = series[term] + twice_x * current - previous, current
    return series[0] + 0.5 * twice_x * current - previous
