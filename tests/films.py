"""A layer on something like silicon, and the signal of a scene by its exact plan."""

from typing import Any

import jax
import numpy as np

import pellicle as pl
from pellicle.forward_model.film_signal import build
from pellicle.scene.film import with_wavelength

WAVELENGTH = np.linspace(450.0, 850.0, 9)
NODES = np.linspace(-8.0, 8.0, 161)
WEIGHTS = np.exp(-0.5 * NODES**2) / np.sum(np.exp(-0.5 * NODES**2))
"""A normal distribution by the trapezoidal rule: as good as exact for what is smooth on a scale of σ/10."""


def scene(
    layer: Any = 1.46,
    substrate: Any = 3.9 + 0.02j,
    thickness: Any = 300.0,
    ambient: Any = 1.0,
    instrument: pl.Instrument | None = None,
    **light: Any,
) -> pl.Scene:
    """A scene of one medium, or of whole layers, at WAVELENGTH."""
    layers = layer if isinstance(layer, list | pl.Layer) else pl.Layer(layer, thickness)
    light = {"wavelength": WAVELENGTH} | light
    return pl.Scene(layers, substrate, ambient, pl.Light(**light), instrument or pl.Instrument())


def predict(thing: pl.Scene, nm: np.ndarray | None = None, angle: float | None = None) -> np.ndarray:
    """The signal of a scene, or of one that is seen at other wavelengths and perhaps another angle."""
    thing = thing if nm is None else with_wavelength(thing, nm, angle)
    return np.asarray(jax.jit(build(pl.plan(thing)))(thing))
