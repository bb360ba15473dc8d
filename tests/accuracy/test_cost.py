"""Solvers and intervals on simulated data sets: failures, coverage, errors, and the best one."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import case
from pellicle.accuracy.cost import INTERVAL_METHODS, SOLVERS, compare_intervals, compare_solvers, from_truth
from pellicle.accuracy.registry import Method, data_sets
from pellicle.fitting.progress import quiet
from pellicle.sampling.sampled_intervals import SAMPLED_INTERVALS

NM = np.linspace(420.0, 740.0, 40)
NOISE = 0.002


def simulated(lower, upper, count):
    scene = pl.Scene(pl.Layer(2.2, pl.Free(lower, upper, start=0.5 * (lower + upper))), substrate=1.5)
    return data_sets(case(scene, NM), scene, NOISE, count)


@pytest.fixture(scope="module")
def several():
    return simulated(50.0, 1500.0, 3)


def test_a_data_set_is_its_truth_and_noise(several):
    assert len({float(t.truth[0]) for t in several}) == 3
    for data in several:
        clean = np.asarray(pl.reflectance(NM, 50.0 + 1450.0 * data.truth[0], 2.2, 1.5))
        off = np.asarray(data.problem.views[0].data.values)[: len(NM)] - clean
        assert 0.5 * NOISE < np.std(off) < 1.5 * NOISE
        assert np.abs(np.mean(off)) < NOISE
        assert data.start == 0.5


@pytest.mark.slow  # compiles fits
def test_a_solver_that_misses_is_told(several):
    def far(data):
        return np.clip(data.truth + np.where(data.truth < 0.5, 0.2, -0.2), 0, 1)

    ways = {"oracle": from_truth, "far": far, "lost": lambda data: np.full(1, np.nan)}
    solvers = (*(Method(x, "", way) for x, way in ways.items()), Method("absent", "", far, missing="nosuch"))
    compared = compare_solvers(several, NOISE, quiet, solvers)
    by_name = {s.name: s for s in compared.results}
    assert {name: s.details["failures"] for name, s in by_name.items()} == {"oracle": 0, "far": 3, "lost": 3}
    assert by_name["oracle"].error < 1e-3
    assert by_name["far"].error == pytest.approx(0.2)
    assert compared.recommended == "oracle"
    assert compared.left_out == {"absent": "nosuch is not installed"}


def test_an_interruption_keeps_whole_data_sets(several):
    seen = []

    def impatient(data):
        seen.append(data)
        if len(seen) > 2:
            raise KeyboardInterrupt
        return data.truth

    compared = compare_solvers(several, NOISE, quiet, (Method("impatient", "", impatient),))
    assert compared.interrupted
    assert compared.results[0].details["datasets"] == 1


def test_the_time_limit_ends_after_a_whole_data_set(several):
    compared = compare_solvers(several, NOISE, quiet, (Method("oracle", "", from_truth),), time_limit=0.0)
    assert not compared.interrupted
    assert (compared.results[0].details["datasets"], compared.requested) == (1, len(several))


@pytest.mark.slow
def test_every_solver_finds_the_only_minimum():
    """Bounds so narrow that there is one: 40 nm, a fifth of a fringe."""
    compared = compare_solvers(simulated(100.0, 140.0, 3), NOISE, quiet)
    assert {s.name for s in compared.results} | set(compared.left_out) == {s.name for s in SOLVERS}
    for solver in compared.results:
        assert solver.details["failures"] == 0, solver.name
        assert solver.error < 0.01, solver.name


@pytest.fixture(scope="module")
def thicknesses():
    scene = pl.Scene(pl.Layer(2.2, pl.Free(50.0, 100.0, start=75.0)), substrate=1.5)
    return data_sets(case(scene, NM), scene, 0.002, 4)


def fixed(name, lower, upper, **more):
    return Method(name, "", lambda fit: (np.array([lower]), np.array([upper])), **more)


@pytest.mark.slow
def test_the_share_of_truths_inside_is_counted(thicknesses):
    methods = fixed("all", 0.0, 1.0), fixed("nothing", 2.0, 3.0), fixed("absent", 0.0, 1.0, missing="nosuch")
    compared = compare_intervals(thicknesses, quiet, methods)
    results = {r.name: r for r in compared.results}
    assert {name: r.details["coverage"] for name, r in results.items()} == {"all": 1.0, "nothing": 0.0}
    assert results["all"].details["width"] == pytest.approx(1.0)
    assert results["nothing"].error == pytest.approx(0.95)
    assert results["all"].details["doubt"] == pytest.approx(np.sqrt(0.95 * 0.05 / 4))
    assert compared.recommended == "all"
    assert compared.left_out == {"absent": "nosuch is not installed"}


@pytest.mark.slow  # samples; what is sampled is tested against grids in tests/sampling
def test_all_methods_agree_where_one_thickness_is_well_known(thicknesses):
    compared = compare_intervals(thicknesses, quiet, (*INTERVAL_METHODS, *SAMPLED_INTERVALS))
    width = {r.name: r.details["width"] for r in compared.results}
    best = width.pop("emcee, until it is long enough")
    assert best < 0.1
    assert width.pop("emcee, 25 steps") == pytest.approx(best, rel=0.3)
    for other in width.values():
        assert other == pytest.approx(best, rel=0.12)
