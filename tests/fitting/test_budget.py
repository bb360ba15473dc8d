"""Causes of structured residuals, in words."""

import numpy as np
import pytest

from pellicle.fitting.budget import budget, carrier, likely_cause
from pellicle.fitting.covariance import Errors
from pellicle.fitting.discrepancy import Contribution, Discrepancy
from pellicle.fitting.linear_system import Effect
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import Estimate

DEPTH = Parameter("thickness", "thickness", "nm", 300.0, 10.0, 1000.0)
A = Parameter("A", "A", "", 1.5, 1.2, 3.0)


def row(name, size, unit, explains, alone, change=1.0, **more):
    effect = Effect(name, size, unit, np.zeros((1, 1)), **more)
    return Contribution(effect, np.array([0.01, change]), 0.0, explains, alone, np.array([0.0, -2.6]))


def found(*rows):
    return Discrepancy(Errors(("A", "thickness"), np.eye(2)), np.zeros(2), (), rows, False, 1.0, ())


OXIDE = row("native oxide", 1.0, "nm", 0.55, 2.4)
SCALE = row("scale", 0.01, "", 0.35, 0.012)
PHOTO = row("scale of photo", 0.01, "", 0.99, -0.15)
INDEX = row("index of the layer", 0.005, "", 0.97, -0.0376, material=True)


REAL = "describe it in the scene if it is real"


@pytest.mark.parametrize(
    ("rows", "cause", "remedy"),
    [
        ([SCALE, OXIDE], "native oxide of 2.4 nm would explain 55 %", REAL),
        ([SCALE], "scale of 1.2 % would explain 35 % of the residuals and change thickness by -2.6 nm", REAL),
        (
            [OXIDE, INDEX],
            "an index of the layer that is 3.8 % lower would explain 97 %",
            "check the material",
        ),
        ([OXIDE, PHOTO, INDEX], "a scale of photo that is 15 % lower would explain 99 %", '`scale="free"`'),
    ],
)
def test_a_likely_cause(rows, cause, remedy):
    [sentence] = likely_cause(found(*rows), [A, DEPTH])
    assert sentence.startswith(cause)
    assert sentence.endswith(remedy)


def test_an_effect_far_beyond_its_ordinary_size_is_named_before_a_material():
    angle = row("angle of incidence", 0.05, "deg", 0.99, 0.489)
    [sentence] = likely_cause(found(INDEX, OXIDE, angle), [A, DEPTH])
    assert sentence.startswith("angle of incidence of 0.49 deg would explain 99 %")
    assert "far beyond its uncertainty of 0.05 deg" in sentence


def test_what_refits_have_refuted_is_no_cause():
    angle = row("angle of incidence", 0.05, "deg", 0.99, 0.489)
    [sentence] = likely_cause(found(INDEX, OXIDE, angle), [A, DEPTH], {"angle", "index"})
    assert sentence.startswith("native oxide")


def test_an_index_of_another_size_than_materials_have_is_no_cause():
    """Where an angle is wrong a substrate of 5.7 times its index may explain the residuals."""
    far = row("index of the substrate", 0.005, "", 0.97, 4.7, material=True)
    assert likely_cause(found(far), [A, DEPTH]) == []


@pytest.mark.parametrize(("explains", "alone"), [(0.25, 2.0), (0.5, 20.0), (0.9, 70.0)])
def test_noise_and_a_slit_of_no_likely_size_are_no_cause(explains, alone):
    assert likely_cause(found(row("slit", 2.0, "nm", explains, alone)), [A, DEPTH]) == []


def test_a_budget_begins_with_what_changes_the_thickness_most():
    rows = budget(found(OXIDE, row("offset", 0.005, "", 0.0, 0.0, change=-3.0)), [A, DEPTH])
    assert [each.name for each in rows] == ["offset", "native oxide"]
    assert rows[1].changes == {"A": 0.01, "thickness": 1.0}
    assert (rows[0].uncertainty, rows[0].unit) == (0.005, "")


@pytest.mark.parametrize(
    ("carries", "noise", "said"),
    [(0.9, 0.1, True), (0.5, 0.1, False), (0.9, 0.6, False)],
)
def test_the_effect_that_carries_the_error_is_said_with_what_shrinks_it(carries, noise, said):
    index, scale = (
        row("index of the layer", 0.005, "", 0.0, 0.0)._replace(carries=np.array([0.0, carries])),
        row("scale", 0.01, "", 0.0, 0.0)._replace(carries=np.array([0.0, 0.05])),
    )
    lead = Estimate("thickness", 300.0, 1.0, "nm", 10, 1000, True, stderr_noise=noise)
    sentence = carrier(budget(found(index, scale), [A, DEPTH]), lead)
    assert bool(sentence) == said
    if said:
        assert sentence.startswith("index of the layer, 0.5 %, carries 1.9 of these 2 nm")
        assert "`index_uncertainty`" in sentence
