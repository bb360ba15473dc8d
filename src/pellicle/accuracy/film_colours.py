"""Accuracy against time for the colours of a film: every method of integrating its spectrum."""

from __future__ import annotations

import math
from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from pellicle.accuracy.colour_methods import Films
from pellicle.accuracy.cost import Cost
from pellicle.accuracy.surface import COLOUR_TOLERANCE, DRAWS, compare_colours
from pellicle.colour.observers import SPAN
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress, quiet
from pellicle.optics.pair import imag, is_real, real
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves
from pellicle.scene.layers import Layer

COLOURS = 1024
"""Colours that a call computes at least: fewer would measure the cost of the call."""


def colour_cost(
    scene: Scene,
    angle: ArrayLike | None = None,
    *,
    tolerance: float | None = None,
    progress: Progress = quiet,
) -> Cost:
    """Measure every method of computing the colours of a film at `angle` (degrees).

    Colours are those of the CIE observer 1931 under D65, of films between the bounds of the thickness, in
    unpolarised light. `tolerance` is the mean ΔE2000 that is small enough, 0.5 by default.

    **Raises:** UsageError for a film that the methods do not compute, for a tolerance that is not above zero,
    and without colour-science.
    """
    if tolerance is not None and not 0 < tolerance < math.inf:
        raise UsageError(f"the tolerance must be above zero, got {tolerance:g}: what error is small enough?")
    own: Any = getattr(scene.light.angle, "start", scene.light.angle)
    angles = np.unique(np.atleast_1d(np.asarray(own if angle is None else angle, float)))
    with jax.enable_x64(True):
        films = films_of_scene(scene, angles)
        methods = compare_colours(films, tolerance or COLOUR_TOLERANCE, progress)
    return Cost(methods, None, "solvers are compared on spectra: leave the space out")


def films_of_scene(scene: Scene, angle: np.ndarray) -> Films:
    """Films of a scene's layer of many thicknesses between its bounds, at angles in degrees.

    **Raises:** UsageError for more than one thin layer on a half space, in reflection.
    """
    layer = scene.layers[0]
    if len(scene.layers) != 1 or not isinstance(layer, Layer):
        raise UsageError("methods for colours are compared on one layer; a plan is for any scene")
    if scene.light.signal != "R" or scene.substrate.back is not None:
        raise UsageError("methods for colours are compared on reflected light of a half space")
    if free_leaves((layer.material, scene.substrate.material, scene.ambient)):
        raise UsageError("methods for colours are compared on known indices: fix them")
    nm = np.arange(SPAN[0] - 1.0, SPAN[1] + 2.0)
    numbers: dict[str, Any] = {}
    for key, medium in (("", layer.material), ("base_", scene.substrate.material)):
        n, k = _tables(medium, nm)
        numbers |= {f"{key}n": n} if k is None else {f"{key}n": n, f"{key}k": k}
    ambient = np.asarray(real(known_index(scene.ambient, nm))) * np.ones(nm.size)
    if np.ptp(ambient) > 0:
        raise UsageError("methods for colours are compared in an ambient without dispersion")
    depth: Any = layer.thickness
    low, high = (depth.lower, depth.upper) if isinstance(depth, Free) else (float(depth),) * 2
    draws = max(DRAWS, -(-COLOURS // angle.size))
    numbers["thickness"] = np.random.default_rng(0).uniform(low, high, draws)
    numbers["ambient_n"] = np.full(draws, ambient[0])
    return Films(numbers, np.deg2rad(angle), float(high))


def _tables(medium: AbstractDispersion, nm: np.ndarray) -> tuple[Table, Table | None]:
    """n, and k where the medium absorbs, at each wavelength."""
    index = known_index(medium, nm)
    n = Table(nm, np.asarray(real(index)) * np.ones(nm.size))
    return n, None if is_real(index) else Table(nm, np.asarray(imag(index)) * np.ones(nm.size))
