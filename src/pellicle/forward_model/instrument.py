"""Averages over a bandwidth, a thickness spread and a cone of light.

Each wraps a forward model and averages rows of intensities, never amplitudes or ratios. Errors
of the quadrature rules are in `pellicle.optics.quadrature`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.lens import Turn, lens_rays
from pellicle.optics.orders import FWHM
from pellicle.optics.quadrature import cone_rays, normal_rule
from pellicle.scene.film import Scene, thickness_spread, turned

Intensities = Callable[[Scene], Any]
"""A scene in numbers → rows of intensities, each (wavelengths,)."""


def _weighted(at: Callable[[Any], Any], nodes: Any, weights: np.ndarray, wavelength: Any) -> Any:
    """Σ weights · at(nodes), in the precision of the wavelengths."""
    like = jnp.result_type(wavelength)
    return _mean(jnp.asarray(weights, like), jax.vmap(at)(jnp.asarray(nodes, like)))


def _mean(weights: Any, rows: list[Any]) -> list[Any]:
    """Σ weights · row over the first axis of each row."""
    return [jnp.tensordot(weights, row, 1) for row in rows]


def over_bandwidth(simulate: Intensities, count: int) -> Intensities:
    """The mean over the window of the spectrometer, a normal distribution with the bandwidth as its FWHM."""
    nodes, weights = normal_rule(count)

    def average(scene: Scene):
        bandwidth: Any = scene.instrument.bandwidth

        def at(node):
            shifted = scene.light.wavelength + node * (bandwidth / FWHM)
            return simulate(eqx.tree_at(lambda s: s.light.wavelength, scene, shifted))

        return _weighted(at, nodes, weights, scene.light.wavelength)

    return average


def over_thickness(simulate: Intensities, count: int, position: int) -> Intensities:
    """The mean over the thickness spread of one layer, a normal distribution truncated at 0."""
    nodes, weights = normal_rule(count)

    def average(scene: Scene):
        layer: Any = scene.layers[position]
        spread = thickness_spread(scene, layer)

        def at(node):
            uneven = jnp.maximum(layer.thickness + node * spread, 0.0)
            return simulate(eqx.tree_at(lambda s: s.layers[position].thickness, scene, uneven))

        return _weighted(at, nodes, weights, scene.light.wavelength)

    return average


def cone_sine(scene: Scene) -> Any:
    """The sine of the half angle of the cone; one for each wavelength if the ambient is dispersive."""
    aperture, spread = scene.instrument.numerical_aperture, scene.instrument.angle_spread
    if aperture is not None:
        return aperture / scene.ambient.index(scene.light.wavelength)
    return jnp.sin(jnp.deg2rad(spread))  # pyright: ignore[reportArgumentType]


def over_cone(
    simulate: Intensities, count: int, around: int, mix: Callable[[Any, Any, Any], Any]
) -> Intensities:
    """The mean over the cone of light; `mix(rows, cosine, square)` turns s and p of a ray: see `ConeRays`."""

    def average(scene: Scene):
        like = jnp.result_type(scene.light.wavelength)
        rays = cone_rays(jnp.deg2rad(scene.light.angle), cone_sine(scene), count, around)

        def at(angle, cosine, square):
            inclined = eqx.tree_at(lambda s: s.light.angle, scene, jnp.rad2deg(angle))
            return mix(simulate(inclined), cosine, square)

        shape = jnp.shape(rays.angle)
        turns = (jnp.broadcast_to(jnp.asarray(x, like), shape) for x in (rays.cosine, rays.square))
        return _mean(jnp.asarray(rays.weight, like), jax.vmap(at)(jnp.asarray(rays.angle, like), *turns))

    return average


def over_lens(of_ray: Callable[[Turn], Intensities], count: int, around: int) -> Intensities:
    """The mean over the cone of light where s and p mix; `of_ray(turn)` are the intensities of a ray.

    The rays of a ring are along a first axis of arrays, in front of the wavelengths. Rings are computed one
    after the other: together they may need gigabytes.
    """

    def average(scene: Scene):
        like = jnp.result_type(scene.light.wavelength)
        rays = lens_rays(jnp.deg2rad(scene.light.angle), cone_sine(scene), count, around)

        def of_ring(ring: Any):
            angle, azimuth, *turn = ring
            inclined = eqx.tree_at(lambda s: s.light.angle, scene, jnp.rad2deg(angle))
            rows = of_ray(Turn(*turn))(turned(inclined, against=jnp.rad2deg(azimuth)))
            return [jnp.mean(row, axis=0) for row in rows]

        # one axis of wavelengths behind that of the rays
        numbers = (rays.angle, rays.azimuth, *rays.turn)
        rings = [jnp.asarray(x, like).reshape(count, around, -1) for x in numbers]
        weights = jnp.asarray(rays.weight, like).reshape(count, around).sum(axis=1)
        return _mean(weights, jax.lax.map(of_ring, rings))

    return average


def mixed(polarisation: str) -> Callable[[Any, Any, Any], Any]:
    """Weighted sum of s and p of a ray: one half each for unpolarised light, else by the lens's rotation."""

    def mix(rows, cosine, square):
        half = {"s": 0.5, "p": -0.5, "unpolarised": 0.0}[polarisation] * cosine
        return [(0.5 + half) * rows[0] + (0.5 - half) * rows[1]]

    return mix


def turned_stokes(rows: Any, cosine: Any, square: Any) -> Any:
    """The Stokes sums (n, c, s, intensity) of a ray in the frame of the axis, then its m22 and m44.

    The lens before the sample turns s and p of a ray by ψ against those of its plane of incidence, and the
    lens behind it, its mirror image, by ψ again: the Jones matrix is R(ψ) diag(r_p, r_s) R(ψ). Elements of
    its Mueller matrix that are odd in ψ cancel between mirror images of a ray. With n = |r_s|² − |r_p|²,
    c + is = 2 conj(r_p) r_s and I = |r_s|² + |r_p|² the others are m12 = m21 = −n cos 2ψ,
    m22 = I cos² 2ψ − c sin² 2ψ, m33 = c cos² 2ψ − I sin² 2ψ, m44 = c and m34 = −m43 = s cos 2ψ.
    """
    n, c, s, intensity = rows
    sine = 1 - square
    return [
        n * cosine,
        c * square - intensity * sine,
        s * cosine,
        intensity,
        intensity * square - c * sine,
        c,
    ]
