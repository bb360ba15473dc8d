"""Depth profiles of scenes with plates, against the `tmm` package and by conservation of energy."""

import jax
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.scene.film import coherent_layers

NM = np.array([450.0, 550.0, 700.0])
ANGLE = 50.0
PLATE = 1.52 + 1e-4j
LAYERS = [
    pl.Layer(2.1 + 0.01j, 80.0, name="absorber"),
    pl.Plate(PLATE, 0.05, name="glass"),
    pl.Layer(1.38, 120.0),
    pl.Layer(2.3 + 1e-3j, 60.0, thickness_spread=5.0),
]
SUBSTRATE = 3.0 + 0.1j


@pytest.fixture(scope="module", params=[pytest.param("s", marks=pytest.mark.slow), "p"])
def both(request):
    scene = pl.Scene(LAYERS, SUBSTRATE, light=pl.Light(angle=ANGLE, polarisation=request.param))
    return request.param, pl.depth_profile(scene, 550.0, NM)


@pytest.mark.slow  # compiles for 3 s
def test_a_film_of_another_thickness_compiles_nothing(caplog):
    first = pl.depth_profile(pl.Scene(pl.Layer(2.1 + 0.1j, 80.0), 1.5), 550.0, NM)
    with jax.log_compiles():
        other = pl.depth_profile(pl.Scene(pl.Layer(2.2 + 0.1j, 90.0), 1.5), 550.0, NM)
    assert not [record.getMessage() for record in caplog.records if "ompil" in record.getMessage()]
    assert np.all(other.absorptance != first.absorptance)


@pytest.mark.slow  # compiles many stacks; tests/simulation/test_depth.py has stacks as tmm
def test_absorptances_as_tmm(both):
    """An absorbing plate: the tmm package has other transmittances of its faces upwards by (k/n)²."""
    letter, profile = both
    assert profile.media == ("absorber", "glass", "layer3", "layer4")
    index = [1, 2.1 + 0.01j, PLATE, 1.38, 2.3 + 1e-3j, SUBSTRATE]
    for i, nm in enumerate(NM):
        depths = [np.inf, 80, 5e4, 120, 60, np.inf]
        exact = tmm.inc_tmm(letter, index, depths, list("icicci"), np.deg2rad(ANGLE), nm)
        absorbed = tmm.inc_absorp_in_each_layer(exact)[1:-1]
        np.testing.assert_allclose(profile.absorptance[:, i], absorbed, rtol=0, atol=2e-8)
        assert (profile.R[i], profile.T[i]) == pytest.approx((exact["R"], exact["T"]), abs=2e-8)
    assert sum(x[0] for x in profile.shares.values()) == pytest.approx(1, abs=1e-12)


@pytest.mark.slow  # compiles two stacks
def test_without_plates_it_is_the_function_of_numbers():
    """An interface of two slices is one layer."""
    layers = [pl.Layer(2.0 + 0.1j, 60.0), pl.Interface(10.0, steps=2, name="graded")]
    scene = pl.Scene(layers, SUBSTRATE)
    profile = pl.depth_profile(scene, [500.0], [500.0, 600.0])
    indices = [complex(pl.refractive_index(500.0, x.material)) for x in coherent_layers(scene)]
    film = 500.0, [60.0, 5.0, 5.0], indices, SUBSTRATE
    first, *slices = np.asarray(pl.absorptance(*film))
    assert profile.media == ("layer1", "graded")
    found = [profile.shares[x][0] for x in profile.media]
    np.testing.assert_allclose(found, [first, sum(slices)], rtol=1e-12)
    (section,) = profile.sections
    assert section.layers == (("layer1", 0.0, 60.0), ("graded", 60.0, 70.0))
    field = pl.field(*film, section.depth)
    np.testing.assert_allclose(section.intensity[0], field.intensity, rtol=1e-12)
    np.testing.assert_allclose(section.absorbed[0], field.absorbed, rtol=1e-12)


def test_rough_faces_and_several_angles_are_refused(refuses):
    rough = pl.Scene(pl.Layer(2.0, 60.0, roughness=3.0), 1.5)
    refuses(ValueError, "mixed interface", pl.depth_profile, rough, 500.0, NM)
    angles = pl.Scene(pl.Layer(2.0, 60.0), 1.5, light=pl.Light(angle=np.array([0.0, 10.0, 20.0])))
    refuses(ValueError, "one angle", pl.depth_profile, angles, 500.0, NM)
