"""Small surfaces and sets of BRDF samples; sizes and free numbers that share compiled programs."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf import fit as fitting
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

from .known_surface import search_from

ENDS = {"thickness": (0, 1000), "n": (1.05, 2.5), "exponent_reflection": (1, 1000)}
ENDS |= {"deviation": (0, 20), "azimuth": (-180, 180), "specular": (0, 100)}
TILTED = Surface("granier-heidrich", {key: Free(*ends) for key, ends in ENDS.items()})
"""RGB; every kind of coordinate: linear, logarithmic, a disc, and a weight."""


def ones(theta_i, phi_i, theta_o, phi_o, channels=("R", "G", "B"), sigma=None) -> BrdfSamples:
    """Samples of 1/sr along directions in degrees, each a number or an array."""
    directions = np.broadcast_arrays(*map(np.atleast_1d, (theta_i, phi_i, theta_o, phi_o)))
    shape = (directions[0].size, len(channels))
    return BrdfSamples(
        *directions, np.ones(shape), channels, sigma=None if sigma is None else np.full(shape, sigma)
    )


GREY = {"thickness": 320.0, "n": 1.5, "exponent_reflection": 60.0, "exponent_transmission": 25.0}
GREY |= {"deviation": 0.0, "azimuth": 0.0, "specular": 1.5, "diffuse": 0.1}
"""A surface of one channel at 550 nm."""
FREE = {"thickness": (0, 1000), "exponent_reflection": (1, 1000), "specular": (0, 100)}
TRUTH = {key: GREY[key] for key in FREE}
START = [0.32, np.log(60) / np.log(1000), 0.015]
"""The values of these numbers, and where they are in the unit cube."""


def grey(**changes) -> Surface:
    """The surface with three free numbers, some of them changed, and no systematic effects."""
    free = {key: Free(*ends) for key, ends in FREE.items()}
    exact = pl.SurfaceUncertainty.none()
    return Surface("granier-heidrich", {**GREY, **free, **changes}, (550.0,), uncertainty=exact)


def grey_samples(noise: float = 0.02, seed: int = 1, incidences=(15.0, 35.0, 55.0)) -> BrdfSamples:
    """40 samples of the known surface for each incidence, with noise of that standard deviation (1/sr)."""
    theta_i = np.repeat(incidences, 40)
    theta_o = np.tile(np.linspace(-70, 70, 40), len(incidences))
    phi_o = np.where(theta_o > 0, 180.0, 0.0)
    directions = ones(theta_i, 0.0, np.abs(theta_o), phi_o, ("value",))
    clean = pl.simulate(Surface("granier-heidrich", GREY, (550.0,)), directions=directions).values
    values = clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)
    return dataclasses.replace(directions, values=values, sigma=np.full(clean.shape, noise))


@pytest.fixture
def no_search(monkeypatch):
    """Replace the search by the truth as the only start; baselines start in the middle of their bounds."""

    monkeypatch.setattr(fitting, "search", search_from(START))
