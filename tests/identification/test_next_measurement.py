"""The measurement that would decide between the hypotheses of an identification."""

from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.planned_measurement import MeasurementPlan, PlannedMeasurement
from pellicle.identification import next_measurement
from pellicle.identification.hypothesis import Identification, Outcome

from .test_hypothesis import estimate, hypothesis, supposed


@pytest.fixture
def undecided():
    films = [supposed(name, estimate("thickness", 100, 50, 200)) for name in ("SiO2", "MgF2", "PMMA", "SU-8")]
    every = tuple(replace(hypothesis(film), name=film.material) for film in films)
    data = pl.Spectrum(np.array([500.0, 600.0]), np.array([0.1, 0.2]), "R")
    return Identification(Outcome.UNDECIDED, every, (), (), "Four are left.", (data,), ())


def test_the_best_hypotheses_are_what_a_measurement_is_to_decide(undecided, monkeypatch):
    def planned(scenes, nm, **how):
        assert list(scenes) == ["SiO2", "MgF2", "PMMA"]
        np.testing.assert_array_equal(nm, [500, 600])
        one = PlannedMeasurement("psi-delta", 65.0, "unpolarised", 500, 600, 0.03, delta_ln_z=50.0)
        other = replace(one, signal="R", angle=0.0, delta_ln_z=0.2)
        return MeasurementPlan(tuple(scenes), (one, replace(one, times=2.0, delta_ln_z=9.0), other))

    monkeypatch.setattr(next_measurement, "plan_measurement", planned)
    found = next_measurement.with_next_measurement(undecided)
    [only] = found.would_decide  # another sample is no measurement of this one
    assert (only.signal, only.angle, only.delta_ln_z) == ("psi-delta", 65.0, 50.0)
    assert found.verdict.startswith("Four are left. Would decide: ψ and Δ at 65° (Δ ln Z 50)")


def test_one_hypothesis_needs_none(undecided):
    one = replace(undecided, hypotheses=undecided.hypotheses[:1])
    assert next_measurement.with_next_measurement(one) is one
