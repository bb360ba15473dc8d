"""Evidence for a layer, each reason that denies it, and warnings on what samples cannot determine."""

import numpy as np
import pytest

from pellicle.brdf.models import MODELS
from pellicle.fitting.brdf.summary import (
    direction_warnings,
    evidence,
    model_warnings,
    number_warnings,
    weight_warnings,
)
from pellicle.fitting.result import Baseline, Estimate, Rival
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


def estimate(name, value, stderr=0.1, lower=0.0, upper=1000.0, at_bound=False, **limits):
    return Estimate(name, value, stderr, "", lower, upper, True, at_bound, **limits)


GOOD = {
    "thickness": estimate("thickness", 300.0),
    "exponent_reflection": estimate("exponent_reflection", 80.0),
    "specular": estimate("specular", 1.0),
    "deviation": estimate("deviation", 0.0, at_bound=True),
    "n_g": estimate("n_g", 1.5, upper=2.5),
}
BASELINES = (Baseline("no interference", 2.0), Baseline("two lobes", 3.0))
"""Held-out errors, of which a layer's must be 10 % less than each."""


def test_a_layer_without_any_doubt():
    result = evidence(GOOD, (Rival({"thickness": 500.0}, 40.0),), 1.0, BASELINES)
    assert result.layered
    assert result.verdict.startswith("Evidence of a layer: thickness 300.00 ± 0.20 (95 %).")
    assert "50 % below no interference and 67 % below two lobes" in result.verdict


@pytest.mark.parametrize(
    ("changed", "rivals", "held_out", "reason"),
    [
        ({}, (), 1.84, "8 % below no interference"),
        (
            {"thickness": estimate("thickness", 0.5, 0.4, upper_limit=1.2)},
            (),
            1.0,
            "0 fits as well, for it is at most 1.2 (95 %)",
        ),
        ({}, (), 3.3, "1.10 times that of two lobes"),
        ({}, (Rival({"thickness": 500.0}, 3.0),), 1.84, "500 nm fits as well as 300 nm"),
        ({"thickness": estimate("thickness", 300.0, np.inf)}, (), 1.0, "no finite error"),
        ({"exponent_reflection": estimate("exponent_reflection", 1.5)}, (), 1.0, "is no lobe"),
        ({"exponent_reflection": estimate("exponent_reflection", 1e3, at_bound=True)}, (), 1.0, "its bound"),
        ({"deviation": estimate("deviation", 20.0, upper=20.0, at_bound=True)}, (), 1.0, "its bound 20"),
        ({"n_g": estimate("n_g", 2.5, upper=2.5, at_bound=True)}, (), 1.0, "n_g rests on its bound"),
        ({"roughness": estimate("roughness", 0.84)}, (), 1.0, "roughness 0.84 is no lobe"),
        ({"specular": estimate("specular", 0.0, at_bound=True)}, (), 1.0, "no weight"),
    ],
)
def test_each_reason_alone_denies_a_layer(changed, rivals, held_out, reason):
    result = evidence({**GOOD, **changed}, rivals, held_out, BASELINES)
    assert not result.layered
    assert result.verdict.startswith("No evidence of a layer: ")
    assert reason in result.verdict


def test_several_thicknesses_do_not_mean_that_there_is_no_layer():
    result = evidence(GOOD, (Rival({"thickness": 500.0}, 3.0),), 1.0, BASELINES)
    assert (result.layered, result.several) == (False, True)
    assert result.verdict == (
        "The samples do not determine the thickness of the layer: 500 nm fits as well as 300 nm (Δχ² 3.0)."
    )


@pytest.mark.parametrize("name", MODELS)
def test_a_misfit_names_models_until_there_is_none_left(name):
    seen = []
    while name not in seen and (found := model_warnings(Surface(name))):
        seen.append(name)
        [name] = [each for each in MODELS if f'"{each}"' in found[0]]
    assert name == "clear-coat-film"
