"""Extremes over the bounds of a scene's free parameters: indices, thicknesses, |q| of a layer."""

from __future__ import annotations

import itertools
from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.anisotropic import isotropic_in_plane, principal_media
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Tabulated
from pellicle.optics import interface, orders
from pellicle.optics.pair import Number, abs2, imag, real
from pellicle.scene.film import Scene, groups
from pellicle.scene.free import Free, free_leaves, insert, start_values


def is_zero(number: Any) -> bool:
    """True for None and for a fixed number that is exactly 0."""
    return number is None or (not isinstance(number, Free) and np.ndim(number) == 0 and float(number) == 0.0)


def normal_incidence(scene: Scene) -> bool:
    """True where the axis of the light is provably normal to the layers."""
    return is_zero(scene.light.angle) and scene.instrument.angle_shift is None


def least_ambient(scene: Scene) -> float:
    """The ambient's smallest index at the light's wavelengths."""
    ambient = insert(scene.ambient, start_values(scene.ambient))
    return float(np.min(real(known_index(ambient, np.atleast_1d(scene.light.wavelength)))))


def upper(number: Any) -> float:
    """The largest value of a number, or of the bounds of a free one; 0 for None."""
    return float(number.upper if isinstance(number, Free) else number or 0.0)


def largest_index(material: AbstractDispersion, wavelength: np.ndarray) -> float:
    """The largest real index at these wavelengths (nm) over the corners of the bounds (at most 64)."""
    return max(float(np.nanmax(np.real(_corner_indices(m, wavelength)))) for m in principal_media(material))


def smallest_index(material: AbstractDispersion, wavelength: np.ndarray) -> float:
    """The smallest real index likewise, but at least 0.1: a metal has no fringes to count."""
    least = min(float(np.nanmin(np.real(_corner_indices(m, wavelength)))) for m in principal_media(material))
    return max(least, 0.1)


def largest_attenuation(material: AbstractDispersion, thickness: Any, scene: Scene) -> float:
    """The largest attenuation of a wave in a layer over the corners of the bounds, as an exponent of its
    amplitude; infinite where a wave may be evanescent.

    An estimate: waves of an anisotropic medium count as those of isotropic media between its principal ones.
    """
    if scene.light.wavelength is None or free_leaves(scene.ambient):
        return np.inf
    wavelength = np.atleast_1d(np.asarray(scene.light.wavelength, dtype=float))
    degrees = upper(scene.light.angle) if isinstance(scene.light.angle, Free) else scene.light.angle
    steepest = np.deg2rad(np.asarray(degrees) + upper(scene.instrument.angle_shift))
    if scene.instrument.has_cone:
        steepest = steepest + scene.instrument.largest_half_angle(least_ambient(scene))
    sine = np.sin(np.minimum(steepest, np.pi / 2))
    a = real(known_index(scene.ambient, wavelength)) * sine
    indices = np.concatenate([_corner_indices(m, wavelength) for m in principal_media(material)])
    least = np.min(np.real(indices), axis=0)
    if not np.all(least > 1.01 * a):
        return np.inf
    extinction = (
        np.max(np.real(indices), axis=0) * np.max(np.imag(indices), axis=0) / np.sqrt(least**2 - a**2)
    )
    return float(np.max(2 * np.pi / wavelength * upper(thickness) * extinction))


def _corner_indices(material: AbstractDispersion, wavelength: np.ndarray) -> np.ndarray:
    """Complex indices (corners, wavelengths)."""

    def row(index: Number) -> np.ndarray:
        return np.broadcast_to(np.asarray(real(index)) + 1j * np.asarray(imag(index)), wavelength.shape)

    if isinstance(material, Tabulated):
        return row(material.value)[None]
    free = [leaf for _, leaf in free_leaves(material)]
    corners = itertools.islice(itertools.product(*[(f.lower, f.upper) for f in free]), 64)
    return np.stack([row(known_index(insert(material, corner), wavelength)) for corner in corners])


def largest_ratio(scene: Scene) -> float:
    """The largest |q| = |r₁₂ r₂₃| over the bounds.

    An estimate, not a proof: the largest of the corners (at most 64) and the start values, times 1.05.
    """
    free = [leaf for _, leaf in free_leaves(scene)]
    corners = itertools.islice(itertools.product(*[(f.lower, f.upper) for f in free]), 64)
    return 1.05 * max(_ratio(insert(scene, values)) for values in [*corners, start_values(scene)])


def _ratio(scene: Scene) -> float:
    at = jnp.asarray(scene.light.wavelength, dtype=float)
    group = next(group for group in groups(scene)[0] if group.layers)
    media = (group.above, group.layers[0].material, group.below)
    above, layer, below = (medium.index(at) for medium in media)
    squares = []
    for angle in _extreme_angles(scene):
        a, _ = interface.transverse(scene.ambient.index(at), angle)
        inside = None if angle is None else interface.Inside(a)
        for polarisation in "s" if angle is None and all(map(isotropic_in_plane, media)) else "sp":
            b = orders.airy_series(above, layer, below, 0.0 * at, inside, polarisation)
            squares.append(np.asarray(abs2(b.upper * b.lower)))
    return float(np.sqrt(np.nanmax(np.stack(squares))))


def _extreme_angles(scene: Scene) -> list[Any]:
    """The angles of incidence in radians, also at the rim of a cone; None is normal incidence."""
    shift = upper(scene.instrument.angle_shift)
    angle = None if normal_incidence(scene) else jnp.deg2rad(scene.light.angle + shift)
    if not scene.instrument.has_cone:
        return [angle]
    rim = (0.0 if angle is None else angle) + scene.instrument.largest_half_angle(least_ambient(scene))
    return [angle, jnp.minimum(rim, jnp.pi / 2)]
