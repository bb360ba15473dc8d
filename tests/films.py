"""A layer on something like silicon, and the signal of a scene by its exact plan."""

from typing import Any

import jax
import numpy as np

import pellicle as pl
from pellicle.forward_model.film_signal import build

WAVELENGTH = np.linspace(450.0, 850.0, 9)


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


def predict(thing: pl.Scene) -> np.ndarray:
    return np.asarray(jax.jit(build(pl.plan(thing)))(thing))
