"""Quadrature rules for a bandwidth, an uneven thickness and a cone of light, with their errors."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np


def normal_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes, in standard deviations, and weights of a normal distribution (Gauss and Hermite)."""
    nodes, weights = np.polynomial.hermite.hermgauss(count)
    return np.sqrt(2) * nodes, weights / np.sqrt(np.pi)


class ConeRays(NamedTuple):
    """The cone's rays: angles of incidence (radians), their weights, and how much of light that was
    polarised s along the axis each carries as s."""

    angle: Any
    weight: np.ndarray
    s_share: Any


@lru_cache(maxsize=64)
def _legendre_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights; a plan asks for the same few again and again, at 50 ms each."""
    return np.polynomial.legendre.leggauss(count)


def cone_rays(angle: Any, sine: Any, count: int, around: int) -> ConeRays:
    """Rays that fill a pupil evenly, as an aplanatic lens does, in half a turn (the rest is its mirror).

    `angle` of the axis (radians) and `sine` of the half angle broadcast; rays come first. `around` is
    1 where the axis is the surface's normal: then every azimuth is the same. The lens turns each ray
    about the axis perpendicular to its own meridian, and its polarisation with it (Richards and Wolf
    1959, Proc. R. Soc. A 253, 358).
    """
    nodes, weights = _legendre_rule(count)
    radius = np.sqrt(0.5 * (nodes + 1))
    if around == 1:
        return ConeRays(jnp.arcsin(_first(radius, sine) * sine), 0.5 * weights, 0.5)
    azimuth = np.pi * (np.arange(around) + 0.5) / around
    r, phi = (x.ravel() for x in np.meshgrid(radius, azimuth, indexing="ij"))
    shape = jnp.broadcast_shapes(np.shape(angle), np.shape(sine))
    cos_phi, sin_phi = (_first(x, np.empty(shape)) for x in (np.cos(phi), np.sin(phi)))
    rho = _first(r, np.empty(shape)) * sine
    along, c0, s0 = jnp.sqrt(1 - rho**2), jnp.cos(angle), jnp.sin(angle)
    across = (rho * sin_phi) ** 2 + (along * s0 - rho * cos_phi * c0) ** 2
    across = across + jnp.finfo(across.dtype).tiny  # so that no root has an infinite slope
    s = s0 * (along * cos_phi**2 + sin_phi**2) - rho * cos_phi * c0
    theta = jnp.arctan2(jnp.sqrt(across), along * c0 + rho * cos_phi * s0)
    return ConeRays(theta, np.repeat(0.5 * weights, around) / around, s * s / across)


def _first(x: np.ndarray, like: Any) -> np.ndarray:
    """The nodes as a leading axis in front of another array's."""
    return x.reshape(-1, *[1] * np.ndim(like))


def normal_error(deviation: float, count: int) -> float:
    """The largest error on a fringe blurred by up to `deviation` radians of phase."""
    nodes, weights = normal_rule(count)
    sigma = np.linspace(0.0, deviation, 200)
    kept = np.cos(sigma[:, None] * nodes) @ weights
    return float(np.max(np.abs(kept - np.exp(-0.5 * sigma**2))))


def cone_error(phase: Callable[[Any], Any], angle: float, sine: float, count: int, around: int) -> float:
    """The error on a fringe of phase(angle of incidence), against twelve times as many rays."""
    fringe = partial(_fringe, phase, angle)
    finer = (12 * count, 1 if around == 1 else 4 * around)
    return max(abs(fringe(s, count, around) - fringe(s, *finer)) for s in (0.5 * sine, sine))


def _fringe(phase: Callable[[Any], Any], angle: float, sine: float, count: int, around: int) -> complex:
    rays = cone_rays(angle, sine, count, around)
    return complex(np.sum(rays.weight * np.exp(1j * np.asarray(phase(np.asarray(rays.angle))))))
