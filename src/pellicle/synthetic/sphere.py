"""Pictures of a surface: a sphere under a directional light, and the BRDF in the plane of incidence."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import direction, frame
from pellicle.brdf.models import Model
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

WAVES = 24
"""Number of plane waves in the noise that a free thickness follows over the sphere."""


class Relief(NamedTuple):
    """Smooth noise over the sphere: height and slope, both 0 to 1, and direction of the slope (degrees)."""

    height: np.ndarray
    slope: np.ndarray
    azimuth: np.ndarray


def render(
    surface: Surface, light: tuple[float, float] = (35.0, 60.0), size: int = 360, seed: int = 0
) -> Any:
    """Render a unit sphere from the front: linear RGB (size, size, 3), NaN outside the sphere.

    `light` is the polar angle from the line of sight and the azimuth, in degrees. The image is the
    radiance at an irradiance of π: a white diffuse surface facing the light is 1. A free thickness follows
    smooth noise between its bounds; a free deviation of the normals follows the slope of that noise, up to
    its upper bound, in the direction of the slope. Other free parameters take their start values.
    """
    across = (np.arange(size) + 0.5) * 2 / size - 1
    x, y = np.meshgrid(across, -across)
    inside = x * x + y * y < 1
    normal = np.stack([x[inside], y[inside], np.sqrt(1 - x[inside] ** 2 - y[inside] ** 2)], axis=-1)
    theta, phi = np.rad2deg(np.arccos(normal[:, 2])), np.rad2deg(np.arctan2(normal[:, 1], normal[:, 0]))
    axes = np.asarray(jax.jit(frame)(theta, phi))
    i, o = (axes @ np.asarray(direction(*at)) for at in (light, (0.0, 0.0)))
    parameters = numbers(surface, relief(normal, axes, np.random.default_rng(seed)))
    brdf = np.asarray(_evaluate(surface.brdf, parameters, i, o))
    image = np.full((size, size, brdf.shape[-1]), np.nan)
    image[inside] = np.pi * brdf * np.clip(i[:, 2:], 0.0, None)
    return image


def in_plane(surface: Surface, incidence: float, leaving: np.ndarray) -> np.ndarray:
    """The BRDF (angles, channels) in the plane of incidence, at angles `leaving` in degrees.

    Positive angles are on the side of the mirror direction.
    """
    i = direction(incidence, 0.0)
    o = direction(np.abs(leaving), np.where(leaving >= 0, 180.0, 0.0))
    return np.asarray(_evaluate(surface.brdf, numbers(surface, None), jnp.broadcast_to(i, o.shape), o))


@partial(jax.jit, static_argnums=0)  # one program; compiled one by one its operations take seconds
def _evaluate(brdf: Model, parameters: dict[str, Any], i: Any, o: Any) -> Any:
    return brdf(parameters, i, o)


def relief(normal: np.ndarray, axes: np.ndarray, rng: np.random.Generator) -> Relief:
    """Noise of a few bumps over the sphere, at normals (..., 3) with frames (..., 3, 3)."""
    waves = rng.normal(0.0, 3.0, (WAVES, 3))
    phase = normal @ waves.T + rng.uniform(0, 2 * np.pi, WAVES)
    height, gradient = np.cos(phase).sum(-1), -np.sin(phase) @ waves
    along, beside = ((axes[:, row] * gradient).sum(-1) for row in (0, 1))
    slope = np.hypot(along, beside)
    span = np.ptp(height)
    return Relief((height - height.min()) / span, slope / slope.max(), np.rad2deg(np.arctan2(beside, along)))


def numbers(surface: Surface, noise: Relief | None) -> dict[str, Any]:
    """Every number of the surface: fixed values, start values, and those that follow the noise."""
    found = surface.start_numbers()
    if noise is not None:
        found |= _following(surface, noise)
    return {key: jnp.asarray(value) for key, value in found.items()}


def _following(surface: Surface, noise: Relief) -> dict[str, Any]:
    """The thickness by the noise's height, and the deviation by its slope, where they are free."""
    depth, tilt = (surface.numbers.get(key) for key in ("thickness", "deviation"))
    found = {}
    if isinstance(depth, Free):
        found["thickness"] = depth.lower + noise.height * (depth.upper - depth.lower)
    if isinstance(tilt, Free):
        found |= {"deviation": tilt.upper * noise.slope, "azimuth": noise.azimuth}
    return found
