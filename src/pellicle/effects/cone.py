"""Cone of light: numbers of rays, with measured errors."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic, mixes_polarisations, principal_media
from pellicle.effects.anisotropy import scene_media
from pellicle.effects.differences import (
    largest_index,
    least_ambient,
    normal_incidence,
    smallest_index,
    upper,
)
from pellicle.forward_model.plan import GENERAL, Plan, Row
from pellicle.optics import quadrature
from pellicle.optics.lens import Film, chosen_rays
from pellicle.scene.film import Scene, coherent_layers
from pellicle.scene.free import Free

RAYS = (3, 4, 6, 8, 12, 16, 24)
CONE_ERROR = 1e-6


def angle_spread(scene: Scene) -> Row:
    """Number of rays of a cone of light, and their error.

    **Raises:** ValueError where the light has no wavelengths.
    """
    if not scene.instrument.has_cone:
        return Row("angle-spread", False, "no cone of light")
    if scene.light.wavelength is None:
        raise ValueError("the cone's rays depend on the wavelengths: give the light its wavelengths")
    mixed = any(map(mixes_polarisations, scene_media(scene)))
    count, around, error = _lens_rays(scene) if mixed else _rays(scene)
    half = np.rad2deg(scene.instrument.largest_half_angle(least_ambient(scene)))
    why = f"light within {half:.3g}° of its axis, averaged over {count * around} rays"
    if mixed:
        why += ", each with its own plane of incidence"
    return Row("angle-spread", True, why, error, count, around)


def rays_of_axes(plan: Plan) -> int:
    """Number of rays that a film takes whose optic axes mix s and p in a cone of light; 1 for any other."""
    rows = {row.effect: row for row in plan.rows if row.effect in ("anisotropy", "angle-spread")}
    if not rows or rows["anisotropy"].count < GENERAL or not rows["angle-spread"].on:
        return 1
    return rows["angle-spread"].count * rows["angle-spread"].around


def _rays(scene: Scene) -> tuple[int, int, float]:
    """The fewest rays for a fringe of the thickest stack, and its error over the cone."""
    at, ambient = np.asarray(scene.light.wavelength, dtype=float), least_ambient(scene)
    sine = np.sin(scene.instrument.largest_half_angle(ambient))
    axis = np.deg2rad(scene.light.largest_angle)
    index = min([smallest_index(layer.material, at) for layer in coherent_layers(scene)], default=1.0)
    path = 4 * np.pi / np.min(at) * sum(upper(layer.thickness) for layer in coherent_layers(scene))

    def phase(angle):
        return path * np.sqrt(np.maximum(index**2 - (ambient * np.sin(angle)) ** 2, 0.0))

    def rays(count: int) -> tuple[int, int, float]:
        around = 1 if normal_incidence(scene) else count
        return count, around, quadrature.cone_error(phase, float(axis), float(sine), count, around)

    tried = map(rays, RAYS)
    return next((result for result in tried if result[2] < CONE_ERROR), rays(RAYS[-1]))


def _lens_rays(scene: Scene) -> tuple[int, int, float]:
    """The fewest rays where s and p mix, and their error for the thickest films within the bounds."""
    at, ambient = np.asarray(scene.light.wavelength, dtype=float), least_ambient(scene)
    media = [medium for medium in scene_media(scene) if isinstance(medium, Anisotropic)]
    wavenumber, phase, others, index = 2 * np.pi / np.min(at), 0.0, 0.0, np.inf
    for layer in coherent_layers(scene):
        if isinstance(layer.material, Anisotropic):
            phase += wavenumber * upper(layer.thickness)
        else:
            others += wavenumber * upper(layer.thickness)
            index = min(index, smallest_index(layer.material, at))
    index = index if np.isfinite(index) else 1.0
    films = [
        Film(ambient, *indices, axis, phase, index, others)
        for medium in media
        for indices in _indices(medium, at)
        for axis in _axes(medium)
    ]
    light = scene.light
    least = light.angle.lower if isinstance(light.angle, Free) else float(np.min(light.angle))
    shift = upper(scene.instrument.angle_shift)
    # the phase of a film varies most near 45 degrees
    degrees = {light.largest_angle + shift, float(np.clip(45.0, least, light.largest_angle)) + shift}
    sine = float(np.sin(scene.instrument.largest_half_angle(ambient)))
    # reciprocity makes rays from opposite sides equal in reflection only
    columns = (
        4 if light.ellipsometric else 1 if (light.signal, light.polarisation) == ("R", "unpolarised") else 2
    )
    return chosen_rays(films, np.deg2rad(sorted(degrees)), sine, columns, CONE_ERROR)


def _indices(medium: Anisotropic, at: np.ndarray) -> set[tuple[float, float]]:
    """Pairs of an ordinary and an extraordinary index that differ most."""
    *first, last = principal_media(medium)
    most, least = max(largest_index(m, at) for m in first), min(smallest_index(m, at) for m in first)
    return {(most, smallest_index(last, at)), (least, largest_index(last, at))}


_ASYMMETRIC = (0.07, 0.3)
"""Shares of the bounds of an azimuth: at 0 and 90 degrees errors cancel."""


def _axes(medium: Anisotropic) -> list[tuple[float, float]]:
    """Directions of the optic axis (radians); of a biaxial medium those of its third and first axes."""

    def values(angle: Any, shares: tuple[float, ...]) -> np.ndarray:
        if isinstance(angle, Free):
            return angle.lower + np.array(shares) * (angle.upper - angle.lower)
        return np.unique(np.asarray(angle, dtype=float))

    turns = np.unique(np.asarray(0.0 if medium.azimuth is None else medium.azimuth, dtype=float))
    tilts = values(medium.theta, (0.0, 0.3, 0.6, 1.0))
    tilts = tilts if medium.is_uniaxial else np.concatenate([tilts, tilts + 90.0])
    azimuths = np.ravel(values(medium.phi, _ASYMMETRIC)[:, None] + turns)
    return [(float(theta), float(phi)) for theta, phi in np.deg2rad(list(itertools.product(tilts, azimuths)))]
