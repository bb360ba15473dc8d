"""Averages over a bandwidth and uneven thickness: numbers of orders and nodes, and bounds on their errors."""

from __future__ import annotations

import numpy as np

from pellicle.dispersion.anisotropic import mixes_polarisations
from pellicle.effects.anisotropy import scene_media
from pellicle.effects.differences import (
    largest_index,
    largest_ratio,
    least_ambient,
    smallest_index,
    upper,
)
from pellicle.effects.presence import roughness
from pellicle.forward_model.plan import Row
from pellicle.optics import orders as series
from pellicle.optics import quadrature
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
        return Row("coherence", True, why, _straight_phase_error(scene))
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
    if not layers:
        return []
    bandwidth = scene.instrument.bandwidth is not None
    return [*(["bandwidth"] if bandwidth else []), *(["uneven thickness"] if uneven else [])]


UNRESOLVED_ERROR = 4 * float(np.exp(-0.5 * (4 * np.pi / series.FWHM) ** 2))
"""Remaining amplitude of a fringe under a window as wide as the sampling step, twice the fringe spacing."""


def _unresolved(scene: Scene) -> str | None:
    """A message where two or more fringes fit between neighbouring wavelengths all over the bounds, or None.

    A spectrometer is taken to resolve no finer than its sampling step.
    """
    if scene.light.wavelength is None or not _has_series(scene) or _blurs(scene):
        return None
    at, (layer,) = np.unique(np.asarray(scene.light.wavelength, dtype=float)), coherent_layers(scene)
    step = float(np.min(np.diff(at), initial=np.inf))
    thickness = float(layer.thickness.lower if isinstance(layer.thickness, Free) else layer.thickness)
    if at.size < 2 or 10 * thickness * step < at[-1] ** 2:  # resolved at any index below 10
        return None
    steepest = min(np.deg2rad(scene.light.largest_angle), np.pi / 2)
    square = smallest_index(layer.material, at) ** 2 - (least_ambient(scene) * np.sin(steepest)) ** 2
    spacing = at[-1] ** 2 / (2 * np.sqrt(max(square, 1e-12)) * thickness)
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
    at, layers = _layers(scene)
    blurs = [_path(at, layers) / np.min(at) * upper(scene.instrument.bandwidth) / series.FWHM]
    blurs += [4 * np.pi / np.min(at) * index * upper(thickness_spread(scene, x)) for x, index in layers]
    tried = [(n, float(sum(quadrature.normal_error(blur, n) for blur in blurs))) for n in NODES]
    return next(((n, error) for n, error in tried if error < NODES_ERROR), tried[-1])


def _straight_phase_error(scene: Scene) -> float:
    """Error of taking a fringe's phase as linear over the window: P σ²/λ² for a phase of P radians."""
    at, layers = _layers(scene)
    window = upper(scene.instrument.bandwidth) / series.FWHM / np.min(at)
    return float(min(_path(at, layers) * window**2, 1.0))


def _layers(scene: Scene) -> tuple[np.ndarray, list[tuple[Layer, float]]]:
    """The wavelengths, and every coherent layer with its largest index."""
    at = np.asarray(scene.light.wavelength, dtype=float)
    return at, [(layer, largest_index(layer.material, at)) for layer in coherent_layers(scene)]


def _path(at: np.ndarray, layers: list[tuple[Layer, float]]) -> float:
    """The largest phase of a round trip through all layers, in radians."""
    return float(4 * np.pi / np.min(at) * sum(upper(layer.thickness) * index for layer, index in layers))
