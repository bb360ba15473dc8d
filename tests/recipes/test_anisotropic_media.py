"""Birefringent media in recipes: keys, angles, messages."""

import pytest

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.errors import DataError
from pellicle.fitting.film.parameters import parameters

FREE = "{ model = 'constant', n = { lower = 1.5, upper = 2 } }"
LAYER = f"{{ ordinary = 1.5, extraordinary = {FREE}, axis = AXIS }}"
BIREFRINGENT = "{ ordinary = 1.5, extraordinary = 1.6 }"


def test_uniaxial_layer_with_a_free_index_and_a_free_angle(scene_of):
    own = scene_of(LAYER.replace("AXIS", "[{ lower = 0, upper = 90 }, 20]"))
    found = [(p.name, p.unit, p.lower, p.upper) for p in parameters(own)]
    assert found == [("extraordinary.n", "", 1.5, 2.0), ("axis_theta", "deg", 0.0, 90.0)]
    assert own.layers[0].material.order is None


def test_biaxial_layer_of_named_media_along_the_laboratory_axes(scene_of):
    own = scene_of("{ x = 'SiO2', y = 1.6, z = 1.5, axis = [90, 0, 0] }").layers[0].material
    assert isinstance(own, Anisotropic)
    assert own.order == (2, 1, 0)
    assert own.x.name == "SiO2"


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ("{ ordinary = 1.5, extraodinary = 1.6 }", "did you mean 'extraordinary'"),
        ("{ ordinary = 1.5, extraordinary = 1.6, axs = [0, 0] }", "did you mean 'axis'"),
        ("{ ordinary = 1.5 }", "lacks extraordinary"),
        ("{ x = 1.5, y = 1.6 }", "lacks z"),
        ("{ ordinary = 1.5, extraordinary = 1.6, axis = 30 }", "axis must be"),
        ("{ ordinary = 1.5, extraordinary = 1.6, axis = [1, 2, 3] }", "axis must be"),
        ("{ ordinary = 'no such thing', extraordinary = 1.6 }", "unknown material"),
        (f"{{ mix = 'linear', host = {BIREFRINGENT}, inclusion = 1, fraction = 0.5 }}", "isotropic media"),
    ],
)
def test_what_is_wrong_is_named(scene_of, material, message):
    with pytest.raises(DataError, match=message):
        scene_of(material)


@pytest.mark.parametrize("free", ["n", "axis_theta"])
def test_free_numbers_that_need_bounds_are_refused(scene_of, free):
    with pytest.raises(DataError, match="birefringent layer"):
        scene_of(LAYER.replace("AXIS", "[0, 0]"), f"free = ['{free}']")
