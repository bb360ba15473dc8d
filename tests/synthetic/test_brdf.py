"""Simulated samples of a BRDF: where they look, what they hold."""

from __future__ import annotations

import numpy as np
import pytest

from pellicle.errors import UsageError
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface
from pellicle.synthetic.brdf import Directions, default_directions, simulate_brdf, synthesise


def vectors(theta, phi):
    theta, phi = np.deg2rad(theta), np.deg2rad(phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def test_directions_are_above_the_horizon_and_dense_where_a_lobe_is():
    found = default_directions()
    assert {len(x) for x in found} == {1000}
    assert max(found.theta_i.max(), found.theta_o.max()) < 90
    i, o = vectors(found.theta_i, found.phi_i), vectors(found.theta_o, found.phi_o)
    half = np.rad2deg(np.arccos((i + o)[:, 2] / np.linalg.norm(i + o, axis=-1)))
    assert np.mean(half < 10) > 0.3
    assert len(default_directions(10).phi_o) == 10
    for azimuth in (found.phi_i, found.phi_o):
        assert np.all(np.histogram(azimuth, bins=8, range=(0, 360))[0] > 60)


def test_no_noise_takes_a_value_below_zero():
    """On a dark surface half of the noise is cut off, and told of."""
    dark = Surface("granier-heidrich-diffuse", {"diffuse": 1e-3}, (550.0,))
    found, _ = synthesise(dark, default_directions(200), noise=0.1, seed=3)
    assert found.channels == ("value",)
    np.testing.assert_array_equal(
        simulate_brdf(dark, default_directions(200), noise=0.1, seed=3).values, found.values
    )
    assert found.values.min() == 0.0
    assert found.notes == (f"{np.sum(found.values == 0)} values that noise took below zero are 0",)


def test_two_channels_have_no_file():
    two = Surface("granier-heidrich-diffuse", {}, (500.0, 600.0))
    with pytest.raises(UsageError, match="one channel or R, G and B: 2 wavelengths"):
        synthesise(two, default_directions(4))


@pytest.mark.slow
def test_the_fit_of_what_was_simulated_finds_the_truth():
    from pellicle.fitting.brdf.fit import fit_brdf

    steel = Surface(
        "microfacet-film",
        {"thickness": Free(10.0, 70.0, start=45.0), "n": 2.9, "roughness": 0.35, "diffuse": 0.0},
    )
    looked = Directions(*(x[:200] for x in default_directions()))
    found = fit_brdf(synthesise(steel, looked, noise=0.01).samples, steel)
    depth = found.parameters["thickness"]
    assert found.status == "converged"
    assert abs(depth.value - 45.0) < 4 * depth.stderr < 1.0
