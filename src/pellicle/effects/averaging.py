"""Averages over bandwidth, uneven thickness and a cone of light: orders, nodes, rays, and their errors."""

import itertools
from typing import Any

import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic, mixes_polarisations, principal_media
from pellicle.effects.differences import (
    largest_index,
    largest_ratio,
    least_ambient,
    normal_incidence,
    smallest_index,
    upper,
)
from pellicle.effects.presence import roughness, scene_media
from pellicle.forward_model.plan import GENERAL, Plan, Row
from pellicle.optics import orders as series
from pellicle.optics import quadrature
from pellicle.optics.quadrature import Film, chosen_rays
from pellicle.scene.film import Scene, coherent_layers, is_graded, thickness_spread
from pellicle.scene.free import Free
from pellicle.scene.layers import Layer, absorbs


def coherence(scene: Scene) -> Row:
    """On where fringes are damped: a single layer order by order, anything else averaged over nodes."""
    blurs, unresolved = _blurs(scene), _unresolved(scene)
    if unresolved is not None:
        return Row("coherence", True, f"{unresolved}: the signal is their average", UNRESOLVED_ERROR)
    if not blurs:
        return Row("coherence", False, "neither bandwidth nor thickness spread: monochromatic light")
    if scene.light.wavelength is None:
        raise ValueError("the number of orders depends on the wavelengths: give the light its wavelengths")
    if _by_orders(scene):
        why = f"fringes are damped by {' and '.join(blurs)}"
        # of a phase of P radians that is taken as linear over the window: P σ²/λ²
        nm, layers = _layers(scene)
        window = upper(scene.instrument.bandwidth) / series.FWHM / np.min(nm)
        return Row("coherence", True, why, float(min(_path(nm, layers) * window**2, 1.0)))
    return coherence_by_nodes(scene)


def coherence_by_nodes(scene: Scene) -> Row:
    """The row of `coherence` for the closed form averaged over wavelengths and thicknesses."""
    count, error = _nodes(scene)
    why = f"fringes are damped by {' and '.join(_blurs(scene))}, each averaged over {count} nodes"
    return Row("coherence", True, why, error, count)


def _blurs(scene: Scene) -> list[str]:
    """Names of the spreads that damp the fringes; empty without layers."""
    layers = coherent_layers(scene)
    uneven = any(thickness_spread(scene, layer) is not None for layer in layers)
    bandwidth = bool(layers) and scene.instrument.bandwidth is not None
    return ["bandwidth"] * bandwidth + ["uneven thickness"] * uneven


UNRESOLVED_ERROR = 4 * float(np.exp(-0.5 * (4 * np.pi / series.FWHM) ** 2))
"""Remaining amplitude of a fringe under a window as wide as the sampling step, twice the fringe spacing."""


def _unresolved(scene: Scene) -> str | None:
    """A message where two or more fringes fit between neighbouring wavelengths all over the bounds, or None.

    A spectrometer is taken to resolve no finer than its sampling step.
    """
    if scene.light.wavelength is None or not _has_series(scene) or _blurs(scene):
        return None
    nm, (layer,) = np.unique(np.asarray(scene.light.wavelength, dtype=float)), coherent_layers(scene)
    step = float(np.min(np.diff(nm), initial=np.inf))
    own: Any = layer.thickness
    thickness = float(own.lower if isinstance(own, Free) else own)
    if nm.size < 2 or 10 * thickness * step < nm[-1] ** 2:  # resolved at any index below 10
        return None
    steepest = min(np.deg2rad(scene.light.largest_angle), np.pi / 2)
    square = smallest_index(layer.material, nm) ** 2 - (least_ambient(scene) * np.sin(steepest)) ** 2
    spacing = nm[-1] ** 2 / (2 * np.sqrt(max(square, 1e-12)) * thickness)
    if 2 * spacing > step:
        return None
    return f"fringes every {spacing:.2g} nm are narrower than the sampling of {step:.2g} nm"


def _has_series(scene: Scene) -> bool:
    """True for one smooth coherent layer whose signal is an intensity."""
    one = len(coherent_layers(scene)) == 1 and not any(map(mixes_polarisations, scene_media(scene)))
    smooth = one and not roughness(scene).on and not is_graded(scene)
    return smooth and not scene.light.ellipsometric


def _by_orders(scene: Scene) -> bool:
    """True where fringes are damped order by order, False where the closed form is averaged over nodes.

    Orders contain the spread of the phase, but not of the absorption, which varies with an uneven
    thickness; and where |q| is near 1 there are too many of them.
    """
    if not _has_series(scene):
        return False
    (layer,) = coherent_layers(scene)
    if thickness_spread(scene, layer) is not None and absorbs(layer.material):
        return False
    left_out = _orders(scene)[2]
    return left_out <= 2 * ORDERS_ERROR or left_out <= _nodes(scene)[1]


MOST_ORDERS = 64
ORDERS_ERROR = 1e-6


def orders(scene: Scene) -> Row:
    """Number of orders of interference in the sum where fringes are damped, and the error of truncation.

    **Raises:** ValueError where the light has no wavelengths.
    """
    if not coherence(scene).on:
        return Row("orders", False, "the closed form sums all orders")
    if _unresolved(scene) is not None:
        return Row("orders", True, "no order remains where fringes are not resolved", 0.0, 0)
    if not _by_orders(scene):
        return Row("orders", False, "the closed form is averaged over nodes instead")
    ratio, count, left_out = _orders(scene)
    return Row("orders", True, f"|q| ≤ {ratio:.2g} over the bounds: {count} orders", left_out, count)


def _orders(scene: Scene) -> tuple[float, int, float]:
    """The largest |q|, the number of orders that it needs, and a bound on the sum of all higher orders."""
    ratio = float(np.clip(largest_ratio(scene), 1e-12, 0.999))
    count = int(np.clip(np.ceil(np.log(ORDERS_ERROR * (1 - ratio)) / np.log(ratio)), 1, MOST_ORDERS))
    return ratio, count, float(min(2 * ratio**count / (1 - ratio), 1.0))


NODES = (15, 25, 41, 63)
NODES_ERROR = 1e-6


def _nodes(scene: Scene) -> tuple[int, float]:
    """The fewest nodes of an average over wavelength or thickness, and their error.

    It is the error on a fringe of the thickest stack within the bounds, for every blur up to the largest.
    """
    nm, layers = _layers(scene)
    blurs = [_path(nm, layers) / np.min(nm) * upper(scene.instrument.bandwidth) / series.FWHM]
    blurs += [4 * np.pi / np.min(nm) * index * upper(thickness_spread(scene, x)) for x, index in layers]
    tried = [(n, float(sum(quadrature.normal_error(blur, n) for blur in blurs))) for n in NODES]
    return next(((n, error) for n, error in tried if error < NODES_ERROR), tried[-1])


def _layers(scene: Scene) -> tuple[np.ndarray, list[tuple[Layer, float]]]:
    """The wavelengths, and every coherent layer with its largest index."""
    nm = np.asarray(scene.light.wavelength, dtype=float)
    return nm, [(layer, largest_index(layer.material, nm)) for layer in coherent_layers(scene)]


def _path(nm: np.ndarray, layers: list[tuple[Layer, float]]) -> float:
    """The largest phase of a round trip through all layers, in radians."""
    return float(4 * np.pi / np.min(nm) * sum(upper(layer.thickness) * index for layer, index in layers))


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
    why += ", each with its own plane of incidence" * mixed
    return Row("angle-spread", True, why, error, count, around)


def rays_of_axes(plan: Plan) -> int:
    """Number of rays that a film takes whose optic axes mix s and p in a cone of light; 1 for any other."""
    rows = {row.effect: row for row in plan.rows if row.effect in ("anisotropy", "angle-spread")}
    if not rows or rows["anisotropy"].count < GENERAL or not rows["angle-spread"].on:
        return 1
    return rows["angle-spread"].count * rows["angle-spread"].around


def _rays(scene: Scene) -> tuple[int, int, float]:
    """The fewest rays for a fringe of the thickest stack, and its error over the cone."""
    nm, ambient = np.asarray(scene.light.wavelength, dtype=float), least_ambient(scene)
    sine = np.sin(scene.instrument.largest_half_angle(ambient))
    axis = np.deg2rad(scene.light.largest_angle)
    index = min([smallest_index(layer.material, nm) for layer in coherent_layers(scene)], default=1.0)
    path = 4 * np.pi / np.min(nm) * sum(upper(layer.thickness) for layer in coherent_layers(scene))

    def phase(angle):
        return path * np.sqrt(np.maximum(index**2 - (ambient * np.sin(angle)) ** 2, 0.0))

    def rays(count: int) -> tuple[int, int, float]:
        around = 1 if normal_incidence(scene) else count
        pupil = count, around, upper(scene.instrument.apodisation)
        return count, around, quadrature.cone_error(phase, float(axis), float(sine), *pupil)

    tried = map(rays, RAYS)
    return next((result for result in tried if result[2] < CONE_ERROR), rays(RAYS[-1]))


def _lens_rays(scene: Scene) -> tuple[int, int, float]:
    """The fewest rays where s and p mix, and their error for the thickest films within the bounds."""
    nm, ambient = np.asarray(scene.light.wavelength, dtype=float), least_ambient(scene)
    media = [medium for medium in scene_media(scene) if isinstance(medium, Anisotropic)]
    wavenumber, phase, others, index = 2 * np.pi / np.min(nm), 0.0, 0.0, np.inf
    for layer in coherent_layers(scene):
        if isinstance(layer.material, Anisotropic):
            phase += wavenumber * upper(layer.thickness)
        else:
            others += wavenumber * upper(layer.thickness)
            index = min(index, smallest_index(layer.material, nm))
    index = index if np.isfinite(index) else 1.0
    films = [
        Film(ambient, *indices, axis, phase, index, others)
        for medium in media
        for indices in _extreme_indices(medium, nm)
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
    pupil = sine, columns, CONE_ERROR, upper(scene.instrument.apodisation)
    return chosen_rays(films, np.deg2rad(sorted(degrees)), *pupil)


def _extreme_indices(medium: Anisotropic, nm: np.ndarray) -> set[tuple[float, float]]:
    """Pairs of an ordinary and an extraordinary index that differ most."""
    *first, last = principal_media(medium)
    most, least = max(largest_index(m, nm) for m in first), min(smallest_index(m, nm) for m in first)
    return {(most, smallest_index(last, nm)), (least, largest_index(last, nm))}


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
