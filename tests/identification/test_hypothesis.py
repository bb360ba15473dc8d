"""Records of an identification: a hypothesis as a scene that `pellicle.fit` takes."""

import pytest

import pellicle as pl
from pellicle.fitting.film.parameters import parameters
from pellicle.fitting.result import Estimate
from pellicle.identification.hypothesis import Hypothesis, Identification, Outcome, SupposedLayer
from pellicle.scene.free import Free


def estimate(name, value, lower, upper, unit="nm"):
    return Estimate(name, value, 1.0, unit, lower, upper, free=True, stderr_noise=0.5)


def supposed(material, *numbers):
    return SupposedLayer(material, ("SiO2",), (1.45, 1.47), (0.0, 0.0), numbers)


AROUND = pl.Scene(pl.Layer("SiO2", 0.0), "Si", light=pl.Light(angle=65.0))


def hypothesis(*layers, **more):
    return Hypothesis("film", layers, -1.0, 1.1, True, AROUND, **more)


def test_a_hypothesis_of_one_layer_is_a_scene_with_the_names_of_a_fit():
    film = supposed("cauchy", estimate("thickness", 120, 80, 200), estimate("A", 1.46, 1.2, 3.0, ""))
    one = hypothesis(film, instrument=(estimate("instrument.angle_shift", 0.1, -3, 3, "deg"),))
    scene = one.scene()
    assert list(one.parameters) == ["thickness", "A", "instrument.angle_shift"]
    thickness = scene.layers[0].thickness
    assert isinstance(thickness, Free)
    assert (thickness.lower, thickness.upper, thickness.start) == (80, 200, 120)
    assert scene.layers[0].material.A.start == 1.46
    assert scene.instrument.angle_shift.upper == 3
    assert scene.light.angle == 65.0
    assert one.effects == ("shifted angle of incidence",)


def test_layers_of_several_are_numbered_and_tables_are_uncertain():
    upper = supposed("SiO2", estimate("thickness", 30, 0, 60), estimate("roughness", 2, 0, 20))
    two = hypothesis(upper, supposed("Si3N4", estimate("thickness", 90, 0, 200)))
    assert list(two.parameters) == ["layer1.thickness", "roughness.thickness", "layer2.thickness"]
    assert two.effects == ("roughness",)
    rough, first, second = two.scene().layers
    assert (first.material.name, second.material.name) == ("SiO2", "Si3N4")
    assert rough.thickness.start == 2
    assert {x.name for x in parameters(two.scene())} == set(two.parameters)
    assert second.index_uncertainty == 0.01


def test_an_identification_without_a_survivor_has_no_best():
    nothing = Identification(Outcome.NONE, (), (hypothesis(),), (), "Nothing fits.", (), ())
    assert str(nothing) == "none: Nothing fits."
    with pytest.raises(ValueError, match="excluded"):
        _ = nothing.best
