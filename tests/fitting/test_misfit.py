"""What is a misfit: unexplained and large, implausible, or explained only by an effect that is too large."""

import dataclasses
import math

import numpy as np
import pytest

from pellicle.fitting.covariance import Errors
from pellicle.fitting.discrepancy import Contribution, Discrepancy, Remaining
from pellicle.fitting.linear_system import Effect
from pellicle.fitting.misfit import Accuracy, misfit

ONE = Effect("index", 0.005, "", np.zeros((1, 1)), material=True)
NOTHING = np.zeros(1)


def row(explains=0.0, alone=0.0, effect=ONE):
    return Contribution(effect, NOTHING, 0.0, explains, alone, NOTHING)


SCALE = row(0.85, 0.012, Effect("scale", 0.01, "", np.zeros((1, 1))))
SLIT = row(0.9, 10.0, dataclasses.replace(ONE, material=False))
FILM = Accuracy(0.02, 1.0)
LAMP = Accuracy(weighted=0.6)


@pytest.mark.parametrize(
    ("rows", "remaining", "accuracy", "expected"),
    [
        ([row()], (2.4, 0.1, 0.1, 1.0), FILM, False),  # noise
        ([row()], (40.0, 0.01, 0.01, 1.0), FILM, False),  # structured, but small: below 1.5 % of the range
        ([row()], (2.6, 0.016, 0.016, 1.0), FILM, True),
        ([row()], (2.6, 0.016, 0.016, 1.0), Accuracy(0.02, 2.0), False),
        ([row()], (2.6, 0.021, 0.021, 1.0), Accuracy(0.02, 2.0), True),  # larger than any instrument makes
        ([row()], (2.6, 0.021, 0.021, 1.0), Accuracy(0.02, math.inf), True),
        # an index 25 % lower explains what usual effects do not
        ([row(0.9, -0.25)], (2.0, 1e-4, 1e-4, 1.0), FILM, True),
        ([row(0.5, -0.25)], (2.0, 1e-4, 1e-4, 1.0), FILM, False),
        ([row(0.9, -0.02)], (2.0, 1e-4, 1e-4, 1.0), FILM, False),  # four of its standard uncertainties
        ([row(0.9, -0.25)], (1.4, 1e-4, 1e-4, 1.0), FILM, False),
        ([row(0.9, -0.25), SCALE], (2.0, 1e-4, 1e-4, 1.0), FILM, False),  # a scale explains as much
        ([SLIT], (2.0, 1e-4, 1e-4, 1.0), FILM, False),  # of any size, but no wrong material
        # a given σ is contradicted by fringes of a wrong order, some of which differ between neighbours
        ([row()], (0.05, 0.013, 0.04, 18.0), FILM, True),
        ([row()], (0.05, 0.013, 0.04, 9.0), FILM, False),
        ([row()], (0.05, 0.013, 0.014, 18.0), FILM, False),
        # a few points without structure that are no noise of an instrument
        ([row()], (1.0, 0.3, 0.3, 1.0), Accuracy(0.02, noise=0.1), True),
        ([row()], (1.0, 0.09, 0.09, 1.0), Accuracy(0.02, noise=0.1), False),
        # a drifting lamp is judged by the error that it is allowed
        ([row()], (20.0, 1.0, 1.0, 0.5), LAMP, False),
        ([row()], (20.0, 1.0, 1.0, 0.7), LAMP, True),
    ],
)
def test_what_is_a_misfit(rows, remaining, accuracy, expected):
    errors, left = Errors(("d",), np.eye(1)), Remaining(*remaining, 1.0)
    found = Discrepancy(errors, NOTHING, (), tuple(rows), False, 1.0, ())
    assert bool(misfit(found, left, accuracy)) is expected
    assert misfit(dataclasses.replace(found, implausible=True), left, accuracy)
