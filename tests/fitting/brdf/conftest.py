"""Small surfaces and sets of BRDF samples; sizes and free numbers that share compiled programs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

TILTED = Surface(
    "granier-heidrich",
    {
        "thickness": Free(0, 1000),
        "n": Free(1.05, 2.5),
        "exponent_reflection": Free(1, 1000),
        "deviation": Free(0, 20),
        "azimuth": Free(-180, 180),
        "specular": Free(0, 100),
    },
)
"""RGB; every kind of coordinate: linear, logarithmic, a disc, and a weight."""


def ones(theta_i, phi_i, theta_o, phi_o, channels=("R", "G", "B"), sigma=None) -> BrdfSamples:
    """Samples of 1/sr along directions in degrees, each a number or an array."""
    directions = np.broadcast_arrays(*map(np.atleast_1d, (theta_i, phi_i, theta_o, phi_o)))
    shape = (directions[0].size, len(channels))
    return BrdfSamples(
        *directions, np.ones(shape), channels, sigma=None if sigma is None else np.full(shape, sigma)
    )


@pytest.fixture(scope="session", name="tilted")
def _tilted() -> Surface:
    return TILTED


@pytest.fixture(scope="session", name="ones")
def _ones() -> Callable[..., BrdfSamples]:
    return ones
