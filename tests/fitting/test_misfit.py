"""What is a misfit: unexplained and large, implausible, or explained only by an effect that is too large."""

import dataclasses
import math

import numpy as np
import pytest

from pellicle.fitting.covariance import Errors
from pellicle.fitting.discrepancy import Contribution, Discrepancy, Effect, Remaining
from pellicle.fitting.misfit import Accuracy, misfit

ONE = Effect("index", 0.005, "", np.zeros((1, 1)), material=True)
NOTHING = np.zeros(1)


def found(explains=0.0, alone=0.0, implausible=False):
    row = Contribution(ONE, NOTHING, 0.0, explains, alone, NOTHING)
    return Discrepancy(Errors(("d",), np.eye(1)), NOTHING, (), (row,), implausible, (1.0,), 1.0)


@pytest.mark.parametrize(
    ("ratio", "typical", "span", "expected"),
    [
        (2.4, 0.1, 1.0, False),  # noise
        (40.0, 0.01, 1.0, False),  # structured, but small: below 1.5 % of the range
        (2.6, 0.016, 1.0, True),
        (2.6, 0.016, 2.0, False),
        (2.6, 0.021, 2.0, True),  # larger than any instrument makes
        (2.6, 0.021, math.inf, True),
    ],
)
def test_what_is_left(ratio, typical, span, expected):
    assert bool(misfit(found(), Remaining(ratio, typical, 1.0, 1.0), Accuracy(0.02, span))) is expected


def test_implausible_effects():
    small = Remaining(1.0, 1e-4, 1.0, 1.0)
    assert misfit(found(implausible=True), small, Accuracy(0.02, 1.0))
    assert not misfit(found(), small, Accuracy(0.02, 1.0))


@pytest.mark.parametrize(
    ("explains", "alone", "ratio", "expected"),
    [
        (0.9, -0.25, 2.0, True),  # an index 25 % lower explains what usual effects do not
        (0.5, -0.25, 2.0, False),
        (0.9, -0.02, 2.0, False),  # four of its standard uncertainties
        (0.9, -0.25, 1.4, False),
    ],
)
def test_an_effect_beyond_its_size(explains, alone, ratio, expected):
    assert (
        bool(misfit(found(explains, alone), Remaining(ratio, 1e-4, 1.0, 1.0), Accuracy(0.02, 1.0)))
        is expected
    )


def test_a_scale_that_explains_as_much_is_no_wrong_material():
    scale = Contribution(Effect("scale", 0.01, "", np.zeros((1, 1))), NOTHING, 0.0, 0.85, 0.012, NOTHING)
    index = found(0.9, -0.25)
    both = dataclasses.replace(index, contributions=(*index.contributions, scale))
    assert not misfit(both, Remaining(2.0, 1e-4, 1.0, 1.0), Accuracy(0.02, 1.0))


def test_a_slit_of_any_size_is_no_wrong_material():
    slit = Contribution(dataclasses.replace(ONE, material=False), NOTHING, 0.0, 0.9, 10.0, NOTHING)
    other = dataclasses.replace(found(), contributions=(slit,))
    assert not misfit(other, Remaining(2.0, 1e-4, 1.0, 1.0), Accuracy(0.02, 1.0))


@pytest.mark.parametrize(("weighted", "expected"), [(0.5, False), (0.7, True)])
def test_a_drifting_lamp_is_judged_by_the_error_that_it_is_allowed(weighted, expected):
    assert bool(misfit(found(), Remaining(20.0, 1.0, weighted, 1.0), Accuracy(weighted=0.6))) is expected
