"""A transparent film in a Blinn-Phong lobe.

"Thin Film Interference for Computer Graphics" (gamedev.net, 2013) sums the transmitted waves and
takes 1 − T. Its α = ρ₁₀ρ₁₂ contains the signs of both reflections, and its Δ adds the same half turns
again. Where they do not cancel, the published shader exchanges bright and dark (n = 1/1.5/2, 250 nm of
film, 550 nm, normal incidence: 0.0942 where Airy gives 0.0239). The corrected film is that of
`pellicle.optics.film`.
"""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp

from pellicle.brdf import film_colour
from pellicle.brdf.broadcasting import Evaluate, Parameters, column, weighted_sum
from pellicle.brdf.lobes import blinn_phong
from pellicle.optics.orders import AirySeries, airy_series

PUBLISHED_WAVELENGTHS = (650.0, 510.0, 475.0)
"""Wavelengths of its R, G and B in nm."""


def published(parameters: Parameters, angle: Any) -> Any:
    """Return the reflectance of the shader, with Δ added to the phase of a signed α."""
    n0, n1, n2 = (parameters[key] for key in ("ambient_n", "n", "base_n"))
    half_turns = jnp.pi * (jnp.where(n1 < n0, 1, 0) + jnp.where(n1 < n2, 1, 0))

    def transmitted(series: AirySeries):
        alpha = -series.upper * series.lower
        return series.direct / (1 + alpha * alpha - 2 * alpha * jnp.cos(series.phase + half_turns))

    return _one_minus(transmitted, parameters, angle)


def phase_average(parameters: Parameters, angle: Any) -> Any:
    """Return the mean over all phases, 1 − |β|²/(1 − α²) times the ratio of beams, as in ray optics."""
    return _one_minus(
        lambda series: series.direct / (1 - (series.upper * series.lower) ** 2), parameters, angle
    )


def _one_minus(transmitted: Callable[[AirySeries], Any], parameters: Parameters, angle: Any) -> Any:
    """Return 1 − T, the mean of s and p; 1 with total reflection at either face, as in the shader."""
    n0, n1, n2 = (parameters[key] for key in ("ambient_n", "n", "base_n"))
    angle = angle[..., None]
    a = n0 * jnp.sin(angle)
    total = (a >= n1) | (a >= n2)
    safe = jnp.where(total, 0.0, angle)
    phase = 2 * jnp.pi / parameters["wavelengths"] * column(parameters["thickness"])
    s, p = (transmitted(airy_series(n0, n1, n2, phase, safe, letter)) for letter in "sp")
    return jnp.where(total, 1.0, 1 - 0.5 * (s + p))


def blinn_phong_film(colour: film_colour.Colour = film_colour.exact) -> Evaluate:
    """Return the BRDF specular · ⟨n, h⟩₊^e R(⟨o, h⟩) + diffuse; the lobe is not normalised, as published."""

    def evaluate(parameters, i, o):
        def lobes():
            return column(blinn_phong(i, o, parameters["exponent"])) * colour(parameters, i, o)

        return weighted_sum(parameters, lobes)

    return evaluate
