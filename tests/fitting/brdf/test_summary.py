"""Warnings on what the directions of samples cannot determine, and on numbers that mean little."""

import numpy as np
import pytest

from pellicle.fitting.brdf.summary import direction_warnings, number_warnings, weight_warnings
from pellicle.fitting.result import Estimate
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

from .conftest import TILTED, ones

BASE = Surface("microfacet-film", {"base_n": Free(1, 3), "base_k": Free(0, 6)}, (550.0,))


def test_warnings_on_directions():
    plane, near = ones(30.0, 0.0, [10.0, 40.0], 180.0), ones([5.0, 12.0], 0.0, 10.0, 180.0, ("value",))
    beside = ones([10.0, 30.0], 0.0, 40.0, [90.0, 180.0])
    turned = ones([20.0, 50.0, 50.0], [0.0, 45.0, 90.0], 40.0, [180.0, 200.0, 270.0])
    for samples, surface, words in (
        (plane, TILTED, ("all light comes at one angle", "in one plane: they cannot see the sign")),
        (beside, TILTED, ("never turned",)),
        (near, BASE, ("within 12 degrees of the normal", "one channel near", "base_n and base_k are both")),
        (turned, TILTED, ()),
    ):
        messages = direction_warnings(samples, surface)
        assert [x for x in words if x not in " ".join(messages)] == []
        assert bool(messages) == bool(words)
        assert any("at one angle" in x for x in messages) == (samples is plane)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("thickness", 3.2, "thickness 3.2 nm is next to none"),
        ("exponent_reflection", 1.5, "exponent_reflection 1.50 is below 2"),
        ("thickness", 320.0, ""),
    ],
)
def test_warnings_on_numbers(name, value, message):
    surface = Surface("microfacet-film", {})
    free = Estimate(name, value, 0.1, "", 0.0, 1000.0, True)
    fitted = {key: np.asarray(x) for key, x in surface.fixed_numbers().items()}
    messages = number_warnings(surface, {name: free}, fitted)
    assert len(messages) == bool(message)
    assert message in " ".join(messages)


def test_lobes_that_are_not_normalised_are_named():
    fitted = {key: np.asarray(x) for key, x in TILTED.start_numbers().items()}
    assert any("specular is a weight and no albedo" in each for each in number_warnings(TILTED, {}, fitted))


def test_weights_that_are_fixed_are_named():
    fixed = Estimate("specular", 1.0, 0.0, "", 1.0, 1.0, False)
    free = Estimate("diffuse", 0.3, 0.01, "1/sr", 0.0, 1.0, True)
    [message] = weight_warnings({"specular": fixed, "diffuse": free, "base_n_r": fixed})
    assert message.startswith("fixed: specular at 1; ")
    assert "specular = { lower = 0, upper = 10 }" in message
    assert weight_warnings({"diffuse": free}) == []
