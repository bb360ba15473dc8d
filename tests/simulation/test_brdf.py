"""Simulated samples of a BRDF: their directions, values and noise."""

import numpy as np
import pytest

from pellicle.errors import UsageError
from pellicle.scene.surface import Surface
from pellicle.simulation.brdf import default_directions, simulate_samples
from tests.directions import unit


def test_directions_are_above_the_horizon_and_dense_where_a_lobe_is():
    directions = default_directions()
    assert {len(x) for x in directions} == {1000}
    assert max(directions.theta_i.max(), directions.theta_o.max()) < 90
    i, o = unit(directions.theta_i, directions.phi_i), unit(directions.theta_o, directions.phi_o)
    half = np.rad2deg(np.arccos((i + o)[:, 2] / np.linalg.norm(i + o, axis=-1)))
    assert np.mean(half < 10) > 0.3
    assert len(default_directions(10).phi_o) == 10
    for azimuth in (directions.phi_i, directions.phi_o):
        assert np.all(np.histogram(azimuth, bins=8, range=(0, 360))[0] > 60)


def test_no_noise_takes_a_value_below_zero():
    """On a dark surface half of the noise is cut off, and a note says so."""
    dark = Surface("granier-heidrich-diffuse", {"diffuse": 1e-3}, (550.0,))
    samples, _ = simulate_samples(dark, default_directions(200), noise=0.1, seed=3)
    assert samples.channels == ("value",)
    assert samples.values.min() == 0.0
    assert samples.notes == (f"{np.sum(samples.values == 0)} values below zero through noise were set to 0",)


def test_two_channels_have_no_file():
    two = Surface("granier-heidrich-diffuse", {}, (500.0, 600.0))
    with pytest.raises(UsageError, match="one channel or R, G and B: the surface has 2 wavelengths"):
        simulate_samples(two, default_directions(4))
