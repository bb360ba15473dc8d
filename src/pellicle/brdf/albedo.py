"""Directional albedo of a BRDF. Not all models are normalised, and some create energy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.brdf.broadcasting import Parameters
from pellicle.brdf.directions import direction

ANGLES = (0.0, 30.0, 60.0, 80.0)
"""Angles of incidence (degrees) at which `max_albedo` evaluates the albedo."""


def directional_albedo(
    brdf: Callable, parameters: Parameters, theta: Any, phi: Any = 0.0, *, rings: int = 128, spokes: int = 256
) -> Float[Array, " channels"]:
    """Return ∫ ρ cos θ_o dω_o, the reflected fraction of light from one direction, by channel.

    The quadrature is over the disc of sin θ, Gauss-Legendre in sin² θ and equal steps in azimuth. It
    resolves lobes wider than about a degree. Above one the BRDF creates energy.

    **Arguments:** `brdf` is a `Model` or any function (parameters, i, o) → (..., channels); `theta` and
    `phi` are the polar angle and azimuth of the light in degrees; `rings` and `spokes` count the nodes.

    >>> from pellicle.brdf.models import model
    >>> grey = {"thickness": 0.0, "n": 1.5, "diffuse": 0.1}
    >>> directional_albedo(model("granier-heidrich-diffuse"), grey, 30.0).round(2).tolist()
    [0.49, 0.49, 0.49]
    """
    node, weight = np.polynomial.legendre.leggauss(rings)
    polar = np.rad2deg(np.arcsin(np.sqrt(0.5 + 0.5 * node)))[:, None]
    o = direction(polar, np.arange(spokes) * (360 / spokes))
    i = jnp.broadcast_to(direction(theta, phi), o.shape)
    values = brdf(parameters, i, o)
    return (np.pi / 2) * jnp.tensordot(jnp.asarray(weight, values.dtype), values.mean(axis=1), axes=1)


def max_albedo(brdf: Callable, parameters: Parameters) -> float:
    """Return the largest directional albedo over `ANGLES` and channels; above 1, energy is created."""
    albedo = jax.jit(jax.vmap(lambda theta: directional_albedo(brdf, parameters, theta)))
    return float(jnp.max(albedo(jnp.asarray(ANGLES))))


def energy_warning(brdf: Callable, parameters: Parameters) -> str | None:
    """Return a warning with the largest albedo if the BRDF creates energy, else None."""
    albedo = max_albedo(brdf, parameters)
    if albedo <= 1.005:  # the error of the quadrature, for lobes wider than a degree
        return None
    return (
        f"the BRDF creates energy: it reflects up to {albedo:.2f} times the incident light, "
        "so its weights are not albedos"
    )
