"""Quadrature over a bandwidth, a non-uniform thickness and a cone of light, with error estimates."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np


def normal_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes, in standard deviations, and weights for a normal distribution (Gauss-Hermite)."""
    nodes, weights = np.polynomial.hermite.hermgauss(count)
    return np.sqrt(2) * nodes, weights / np.sqrt(np.pi)


class ConeRays(NamedTuple):
    """Rays of a cone of light."""

    angle: Any  # of incidence, radians
    weight: np.ndarray
    cosine: Any  # cos 2ψ: ψ is the angle from s of the axis to s of the ray, behind the lens
    square: Any  # cos² 2ψ


@lru_cache(maxsize=64)
def _legendre_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights, cached: a plan asks for the same few repeatedly, at 50 ms each."""
    return np.polynomial.legendre.leggauss(count)


def disc_rule(count: int, azimuths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return radius, azimuth and weight of points that fill the unit disc, on `count` rings."""
    nodes, weights = _legendre_rule(count)
    radius, azimuth = np.meshgrid(np.sqrt(0.5 * (nodes + 1)), azimuths, indexing="ij")
    return radius.ravel(), azimuth.ravel(), np.repeat(0.5 * weights, len(azimuths)) / len(azimuths)


def cone_rays(angle: Any, sine: Any, count: int, around: int) -> ConeRays:
    """Return rays that fill a pupil evenly, as an aplanatic lens does, over half the azimuths.

    The other half is the mirror image. The lens turns each ray about the axis perpendicular to its
    meridional plane, and turns the polarisation with it.

    **Arguments:** `angle` of the axis (radians) and `sine` of the half angle broadcast; rays come first.
    `count` is the number of rings, `around` the number of azimuths: 1 where the axis is the surface's
    normal, for then all azimuths are equal.

    **Source:** Richards and Wolf 1959, Proc. R. Soc. A 253, 358.
    """
    if around == 1:
        # means over all azimuths
        radius, _, weight = disc_rule(count, np.zeros(1))
        return ConeRays(jnp.arcsin(_leading_axis(radius, sine) * sine), weight, 0.0, 0.5)
    r, phi, weight = disc_rule(count, np.pi * (np.arange(around) + 0.5) / around)
    shape = jnp.broadcast_shapes(np.shape(angle), np.shape(sine))
    cos_phi, sin_phi = (_leading_axis(x, np.empty(shape)) for x in (np.cos(phi), np.sin(phi)))
    rho = _leading_axis(r, np.empty(shape)) * sine
    along, c0, s0 = jnp.sqrt(1 - rho**2), jnp.cos(angle), jnp.sin(angle)
    across = (rho * sin_phi) ** 2 + (along * s0 - rho * cos_phi * c0) ** 2
    across = across + jnp.finfo(across.dtype).tiny  # so that no root has an infinite slope
    s = s0 * (along * cos_phi**2 + sin_phi**2) - rho * cos_phi * c0
    theta = jnp.arctan2(jnp.sqrt(across), along * c0 + rho * cos_phi * s0)
    cosine = 2 * s * s / across - 1
    return ConeRays(theta, weight, cosine, cosine * cosine)


def _leading_axis(x: np.ndarray, like: Any) -> np.ndarray:
    """Reshape nodes (count,) to (count, 1, ...), to broadcast in front of the axes of `like`."""
    return x.reshape(-1, *[1] * np.ndim(like))


def normal_error(deviation: float, count: int) -> float:
    """Return the largest error of a fringe averaged over a phase blur of up to `deviation` radians."""
    nodes, weights = normal_rule(count)
    sigma = np.linspace(0.0, deviation, 200)
    average = np.cos(sigma[:, None] * nodes) @ weights
    return float(np.max(np.abs(average - np.exp(-0.5 * sigma**2))))


def cone_error(phase: Callable[[Any], Any], angle: float, sine: float, count: int, around: int) -> float:
    """Return the error of a fringe averaged over a cone, against twelve times as many rays.

    **Arguments:** `phase` of the fringe as a function of the angle of incidence (radians), otherwise as
    for `cone_rays`.
    """

    def fringe(sine: float, count: int, around: int) -> complex:
        rays = cone_rays(angle, sine, count, around)
        return complex(np.sum(rays.weight * np.exp(1j * np.asarray(phase(np.asarray(rays.angle))))))

    finer = (12 * count, 1 if around == 1 else 4 * around)
    return max(abs(fringe(s, count, around) - fringe(s, *finer)) for s in (0.5 * sine, sine))
