"""Synthetic measurements for fits; all of 128 points, so that the tests share compiled programs."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pellicle as pl
from pellicle.scene.free import insert
from pellicle.simulation.spectra import simulate_signal

WAVELENGTH = np.linspace(400.0, 900.0, 128)
SUBSTRATE = pl.dispersion.Constant(3.9, 0.02)


def film(thickness: Any = None, material: Any = 1.46, **more: Any) -> pl.Scene:
    """A layer on something like silicon; by default its thickness is free in 10 to 1000 nm."""
    thickness = pl.Free(10, 1000) if thickness is None else thickness
    more.setdefault("substrate", SUBSTRATE)
    return pl.Scene(pl.Layer(material, thickness), **more)


def measured(
    scene: pl.Scene,
    *truth: float,
    noise: float = 0.003,
    seed: int = 1,
    sigma: bool = False,
    wavelength: np.ndarray = WAVELENGTH,
) -> pl.Spectrum:
    """What a scene with its free parameters at `truth` (in the pytree's order) would give, with noise.

    `sigma` says the noise in the spectrum; without it a fit has to find out.
    """
    fixed = insert(scene, truth)
    values = simulate_signal(fixed, wavelength, noise, seed).values
    known = np.full(wavelength.size, noise) if sigma else None
    return pl.Spectrum(
        wavelength, values, scene.light.signal, sigma=known, polarisation=scene.light.polarisation
    )


@pytest.fixture(name="film")
def _film() -> Callable[..., pl.Scene]:
    return film


@pytest.fixture(name="measured")
def _measured() -> Callable[..., pl.Spectrum]:
    return measured
