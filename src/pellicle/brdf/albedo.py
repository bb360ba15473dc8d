"""How much light a BRDF sends back: the models here are not all normalised, and some create energy."""

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
"""Angles of incidence (degrees) at which `max_albedo` looks."""


def directional_albedo(
    brdf: Callable, parameters: Parameters, theta: Any, phi: Any = 0.0, *, rings: int = 128, spokes: int = 256
) -> Float[Array, "3"]:
    """∫ ρ cos θ_o dω_o for light from (theta, phi), degrees: the fraction sent back, RGB.

    Quadrature on the disc of sin θ: Gauss-Legendre in sin² θ, equal steps in azimuth; it resolves
    lobes wider than about a degree. Above one the BRDF creates energy.
    """
    node, weight = np.polynomial.legendre.leggauss(rings)
    polar = np.rad2deg(np.arcsin(np.sqrt(0.5 + 0.5 * node)))[:, None]
    o = direction(polar, np.arange(spokes) * (360 / spokes))
    i = jnp.broadcast_to(direction(theta, phi), o.shape)
    values = brdf(parameters, i, o)
    return (np.pi / 2) * jnp.tensordot(jnp.asarray(weight, values.dtype), values.mean(axis=1), axes=1)


def max_albedo(brdf: Callable, parameters: Parameters) -> float:
    """The greatest directional albedo over `ANGLES` and channels; above 1 says that energy is created."""
    at = jax.jit(jax.vmap(lambda theta: directional_albedo(brdf, parameters, theta)))
    return float(jnp.max(at(jnp.asarray(ANGLES))))


def energy_warning(brdf: Callable, parameters: Parameters) -> str | None:
    """A sentence with the number where the BRDF sends back more light than it gets, else None."""
    most = max_albedo(brdf, parameters)
    if most <= 1.005:  # the quadrature's own error, for lobes wider than a degree
        return None
    return (
        f"the BRDF creates energy: it sends back up to {most:.2f} times its light; its weights are no albedos"
    )
