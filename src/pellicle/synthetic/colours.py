"""What a film looks like: its colour against thickness and angle of incidence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import integration_bands, sensor
from pellicle.colour.film import Colour
from pellicle.effects.film import exact
from pellicle.errors import UsageError
from pellicle.planning.differences import signals
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import Free, insert, start_values
from pellicle.scene.layers import Layer
from pellicle.simulation.film import build, tabulated

BANDS = "uniform-64"
"""Colours are within ΔE2000 of 0.02 of those by steps of 1 nm, for films up to 5 µm."""


def interference_colours(
    scene: Scene,
    thickness: np.ndarray,
    angle: np.ndarray,
    layer: str | None = None,
    *,
    observer: str = "1931",
    illuminant: str = "D65",
) -> Colour:
    """Colours of a scene, XYZ of shape (angles, thicknesses, 3).

    **Arguments:** `thickness` in nm of the `layer` of that name, or of the one that is free, or the
    first; `angle` of incidence in degrees; both rising. Other free parameters take their values, and the
    signal is the scene's own, reflectance or transmittance.

    **Raises:** UsageError for ellipsometry, for a layer that is none, and ValueError where a material has
    no data between 380 and 730 nm.
    """
    if scene.light.signal == "psi-delta":
        raise UsageError("ellipsometry has no colour: chart a recipe with signal R or T")
    bands, white = integration_bands(BANDS, observer, illuminant), sensor(observer, illuminant).white
    with jax.enable_x64(True):
        seen = _over(with_wavelength(scene, bands.wavelength), thickness, angle, varied(scene, layer))
        grid = np.stack(np.meshgrid(thickness, angle), axis=-1).reshape(-1, 2)
        found = signals(exact(seen), tabulated(seen), grid, build) @ bands.weights
        xyz = jnp.asarray(found.reshape(len(angle), len(thickness), 3))
    return Colour(xyz, (float(white[0]), float(white[1]), float(white[2])))


def varied(scene: Scene, layer: str | None = None) -> int:
    """The position of the layer whose thickness a chart varies."""
    coherent = {i: x for i, x in enumerate(scene.layers) if isinstance(x, Layer)}
    if layer is not None:
        named = [i for i, x in coherent.items() if x.name == layer]
        if not named:
            known = ", ".join(x.name for x in coherent.values() if x.name) or "no layer has a name"
            raise UsageError(f"no layer {layer!r} to vary; known: {known}")
        return named[0]
    free = [i for i, x in coherent.items() if isinstance(x.thickness, Free)]
    found = [*free, *coherent]
    if not found:
        raise UsageError("there is no coherent layer whose thickness could vary")
    return found[0]


def _over(scene: Scene, thickness: np.ndarray, angle: np.ndarray, position: int) -> Scene:
    """The scene with nothing free but one thickness and the angle, within what is charted."""
    fixed = insert(scene, start_values(scene))
    where: Any = lambda s: (s.layers[position].thickness, s.light)  # noqa: E731
    light = replace(fixed.light, angle=_between(angle))
    return eqx.tree_at(where, fixed, (_between(thickness), light))


def _between(values: np.ndarray) -> Free:
    low, high = float(values[0]), float(values[-1])
    return Free(low, high if high > low else low + 1e-9)
