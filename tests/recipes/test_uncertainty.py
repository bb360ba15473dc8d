"""Uncertainties in recipes: each replaces the usual one, of an instrument, a layer or the substrate."""

from dataclasses import fields

import pytest

from pellicle.scene.layers import Uncertainty

LAYER = '[[scene.layer]]\nmaterial = "SiO2"\nthickness = { lower = 10, upper = 3000 }\n'
BASE = f'[scene]\nsubstrate = "Si"\n{LAYER}'

MATERIAL = 'material = "SiO2"\n'
SAMPLE = ["index", "dispersion", "roughness", "thickness_spread", "interlayer"]
INSTRUMENT = [field.name for field in fields(Uncertainty) if field.name not in SAMPLE]


@pytest.mark.parametrize("name", INSTRUMENT + SAMPLE)
def test_an_uncertainty_replaces_the_usual_one(scene, name):
    """All others stay usual, or none."""
    line = f"{name}_uncertainty = 0.25\n"
    if name in INSTRUMENT:
        text = BASE + "[instrument]\n" + line
    else:
        text = BASE.replace("[scene]\n", "[scene]\n" + line)
    assert scene(text).uncertainty == Uncertainty(**{name: 0.25})
    nothing = text.replace("[scene]\n", '[scene]\nuncertainty = "none"\n')
    usual = dict.fromkeys(INSTRUMENT + SAMPLE, 0.0)
    assert scene(nothing).uncertainty == Uncertainty(**usual | {name: 0.25})


def test_uncertainties_of_a_layer_and_the_substrate(scene):
    text = BASE.replace('"Si"', '{ material = "Si", index_uncertainty = 0.001 }')
    found = scene(text + "index_uncertainty = 0\n")
    assert (found.layers[0].index_uncertainty, found.substrate.index_uncertainty) == (0, 0.001)
    plain = scene(BASE)
    assert plain.uncertainty == Uncertainty()
    assert (plain.layers[0].index_uncertainty, plain.substrate.index_uncertainty) == (None, None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BASE + "[instrument]\nscale_uncertainty = -0.1\n", ("instrument.scale_uncertainty", "0")),
        (BASE + "[instrument]\nscale_uncertainty = 'low'\n", ("instrument.scale_uncertainty", "'low'")),
        (BASE + "[instrument]\nindex_uncertainty = 0.1\n", ("instrument.index_uncertainty",)),
        (BASE + "index_uncertainty = -1\n", ("index_uncertainty", "0")),
        (BASE.replace("[scene]\n", '[scene]\nuncertainty = "some"\n'), ("scene.uncertainty", "'some'")),
        (BASE.replace(MATERIAL, 'between = "linear"\nindex_uncertainty = 0.1\n'), ("not go with between",)),
    ],
)
def test_uncertainties_refused(refused, text, said):
    refused(text, *said)
