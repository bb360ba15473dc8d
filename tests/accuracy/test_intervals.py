"""Intervals on simulated data sets: coverage and width are counted, and a method is recommended."""

from functools import partial

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import case
from pellicle.accuracy.cost import INTERVAL_METHODS, compare_intervals
from pellicle.accuracy.registry import Method, data_sets
from pellicle.fitting.progress import quiet
from pellicle.sampling.sampled_intervals import SAMPLED_INTERVALS

NM = np.linspace(420.0, 740.0, 40)


@pytest.fixture(scope="module")
def several():
    scene = pl.Scene(pl.Layer(2.2, pl.Free(50.0, 100.0, start=75.0)), substrate=1.5)
    return data_sets(case(scene, NM), scene, 0.002, 4)


def fixed(lower, upper, fit):
    return np.array([lower]), np.array([upper])


@pytest.mark.slow
def test_the_share_of_truths_inside_is_counted(several):
    methods = (
        Method("all", "", partial(fixed, 0.0, 1.0)),
        Method("nothing", "", partial(fixed, 2.0, 3.0)),
        Method("absent", "", partial(fixed, 0.0, 1.0), missing="nosuchpackage"),
    )
    compared = compare_intervals(several, quiet, methods)
    results = {r.name: r for r in compared.results}
    assert {name: r.details["coverage"] for name, r in results.items()} == {"all": 1.0, "nothing": 0.0}
    assert results["all"].details["width"] == pytest.approx(1.0)
    assert results["nothing"].error == pytest.approx(0.95)
    assert results["all"].details["doubt"] == pytest.approx(np.sqrt(0.95 * 0.05 / 4))
    assert compared.recommended == "all"
    assert compared.left_out == {"absent": "nosuchpackage is not installed"}


@pytest.mark.slow  # samples; what is sampled is tested against grids in tests/sampling
def test_all_methods_agree_where_one_thickness_is_well_known(several):
    compared = compare_intervals(several, quiet, (*INTERVAL_METHODS, *SAMPLED_INTERVALS))
    width = {r.name: r.details["width"] for r in compared.results}
    best = width.pop("emcee, until it is long enough")
    assert best < 0.1
    assert width.pop("emcee, 25 steps") == pytest.approx(best, rel=0.3)
    for other in width.values():
        assert other == pytest.approx(best, rel=0.12)
