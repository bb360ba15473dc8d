"""Directional albedo of a BRDF. Not all models are normalised, and some create energy.

A lobe may be narrower than any grid of directions. So the integral is split by a weight that is 1 where the
half vector is at the normal and falls off over `NARROW`: the narrow part is integrated over half vectors, in
equal steps of ln tan θ_h, in which a lobe has the same width whatever its roughness, and the rest over
directions.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.brdf.directions import direction, half_vector, reflect
from pellicle.brdf.lobes import Parameters

ANGLES = (0.0, 30.0, 60.0, 80.0)
"""Angles of incidence (degrees) of `albedos`."""
NARROW = 0.1
"""Angle (radians) of the half vector from the normal where both integrals have an equal share: lobes wider
than that are resolved by the grid of directions."""
_DECADES = -6.0, 2.0
"""Range of lg tan θ_h: a lobe of α = 1e-4 has 1e-4 of its light below the first."""


def directional_albedo(
    brdf: Callable, parameters: Parameters, theta: Any, phi: Any = 0.0, *, rings: int = 128, spokes: int = 256
) -> Float[Array, " channels"]:
    """Return ∫ ρ cos θ_o dω_o, the reflected fraction of light from one direction, by channel.

    The quadrature over directions is one over the disc of sin θ, Gauss-Legendre in sin² θ and equal steps in
    azimuth; it resolves lobes around any direction wider than about a degree. That over half vectors resolves
    lobes around the mirror direction of any width. Above one the BRDF creates energy.

    **Arguments:** `brdf` is a `Model` or any function (parameters, i, o) → (..., channels); `theta` and
    `phi` are the polar angle and azimuth of the light in degrees; `rings` and `spokes` count the nodes.

    >>> from pellicle.brdf.models import model
    >>> grey = {"thickness": 0.0, "n": 1.5, "diffuse": 0.1}
    >>> directional_albedo(model("granier-heidrich-diffuse"), grey, 30.0).round(2).tolist()
    [0.49, 0.49, 0.49]
    """
    light, azimuth = direction(theta, phi), np.arange(spokes) * (360 / spokes)
    node, weight = np.polynomial.legendre.leggauss(rings)
    polar = np.rad2deg(np.arcsin(np.sqrt(0.5 + 0.5 * node)))[:, None]
    step = np.log(10) * (_DECADES[1] - _DECADES[0]) / (rings - 1)
    tilt = np.arctan(10 ** np.linspace(*_DECADES, rings))[:, None]
    h = direction(np.rad2deg(tilt), azimuth)
    i = jnp.broadcast_to(light, h.shape)
    away, towards = direction(polar, azimuth), reflect(i, h)
    # dω_o = 4 ⟨i, h⟩ dω_h, and dω_h = sin² θ cos θ d(ln tan θ) dφ
    measure = 4 * jnp.maximum(jnp.sum(i * h, axis=-1), 0.0) * jnp.maximum(towards[..., 2], 0.0) * _narrow(h)
    shares = jnp.concatenate([1 - _narrow(half_vector(i, away)), measure])
    # both integrals by one evaluation: its compilation takes most of the time
    values = brdf(parameters, jnp.concatenate([i, i]), jnp.concatenate([away, towards])) * shares[..., None]
    rows = [np.pi / 2 * weight, 2 * np.pi * step * np.sin(tilt[:, 0]) ** 2 * np.cos(tilt[:, 0])]
    return jnp.tensordot(jnp.asarray(np.concatenate(rows), values.dtype), values.mean(axis=1), axes=1)


def _narrow(h: Any) -> Any:
    """Share of the integral over half vectors at each half vector."""
    tangent = (h[..., 0] ** 2 + h[..., 1] ** 2) / jnp.maximum(h[..., 2] ** 2, 1e-12)
    return 1 / (1 + (tangent / NARROW**2) ** 2)


def albedos(brdf: Callable, parameters: Parameters) -> Float[Array, "angles channels"]:
    """Return the directional albedo at `ANGLES`."""
    albedo = partial(directional_albedo, brdf, parameters)
    return jax.vmap(albedo)(jnp.asarray(ANGLES))


def energy_warning(albedo: Any) -> str | None:
    """Return a warning with the largest of `albedos` if the BRDF creates energy, else None."""
    largest = float(np.max(albedo))
    if largest <= 1.005:  # the error of the quadrature, for lobes beside the mirror direction
        return None
    return (
        f"the BRDF creates energy: it reflects up to {largest:.2f} times the incident light, "
        "so its weights are not albedos"
    )
