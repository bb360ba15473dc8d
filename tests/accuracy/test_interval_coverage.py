"""Ways to an interval on simulated data sets: how often they hold the truth, and who is recommended."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy import interval_coverage as module
from pellicle.accuracy.case import case
from pellicle.accuracy.interval_coverage import Way, intervals
from pellicle.accuracy.simulated_data import trials

NM = np.linspace(420.0, 740.0, 40)


def quiet(what, done, total):
    pass


@pytest.fixture(scope="module")
def several():
    scene = pl.Scene(pl.Layer(2.2, pl.Free(50.0, 100.0, start=75.0)), substrate=1.5)
    return trials(case(scene, NM), scene, 0.002, 4)


def fixed(lower, upper, fit):
    return np.array([lower]), np.array([upper])


def test_the_share_of_truths_inside_is_counted(several, monkeypatch):
    ways = (
        Way("all", "", partial(fixed, 0.0, 1.0)),
        Way("nothing", "", partial(fixed, 2.0, 3.0)),
        Way("absent", "", partial(fixed, 0.0, 1.0), missing="nosuchpackage"),
    )
    monkeypatch.setattr(module, "WAYS", ways)
    found = intervals(several, quiet)
    held = {way.name: way for way in found.ways}
    assert {name: way.coverage for name, way in held.items()} == {"all": 1.0, "nothing": 0.0}
    assert held["all"].width == pytest.approx(1.0)
    assert held["nothing"].error == pytest.approx(0.95)
    assert held["all"].doubt == pytest.approx(np.sqrt(0.95 * 0.05 / 4))
    assert found.recommended == "all"
    assert found.left_out == {"absent": "nosuchpackage is not installed"}


@pytest.mark.slow  # samples; what is sampled is tested against grids in tests/sampling
def test_all_ways_agree_where_one_thickness_is_well_known(several):
    found = intervals(several, quiet)
    width = {way.name: way.width for way in found.ways}
    best = width.pop("emcee, until it is long enough")
    assert best < 0.1
    assert width.pop("emcee, 25 steps") == pytest.approx(best, rel=0.3)
    for other in width.values():
        assert other == pytest.approx(best, rel=0.12)
