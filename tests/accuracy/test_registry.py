"""Comparison of methods: results, Pareto front and recommendation, with methods that compile fast."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import Program
from pellicle.accuracy.cost import cost
from pellicle.accuracy.film_methods import METHODS, compare_methods
from pellicle.accuracy.registry import Comparison, Method, Result, mark_pareto, measure
from pellicle.errors import UsageError
from pellicle.fitting.progress import quiet

from .conftest import NM, few

BY_NAME = {method.name: method for method in METHODS}
USED = ("float64", "float32", "closed form", "1 order", "2 orders")


@pytest.fixture(scope="module")
def film():
    return few(pl.Scene(pl.Layer(2.2, pl.Free(50.0, 400.0, start=100.0)), substrate=3.9))


def test_the_pareto_front_is_unbeaten():
    pairs = [(1e-3, 1.0), (1e-6, 2.0), (1e-4, 3.0), (0.0, 4.0), (0.0, 5.0), (np.inf, 9.0)]
    results = [Result("", "", *pair, 0.0) for pair in pairs]
    mark_pareto(results)
    assert [r.pareto for r in results] == [True, True, False, True, False, False]


@pytest.fixture(scope="module")
def comparison(film):
    return compare_methods(film, "float64", quiet, tuple(BY_NAME[name] for name in USED))


def test_errors_and_costs(comparison):
    results = {r.name: r for r in comparison.results}
    assert results.keys() == {"float64", "float32", "1 order", "2 orders"}
    assert comparison.left_out == {"closed form": "the full plan is the closed form"}
    assert results["float64"].error == 0
    assert 1e-9 < results["float32"].error < 1e-6
    assert results["2 orders"].error < results["1 order"].error < 0.1
    for r in comparison.results:
        assert r.seconds > 0
        assert r.compile_seconds > 0
        assert r.details["flops"] > len(NM)


class Timed(Program):
    """A program whose calls take known times, one after the other, then the last one."""

    def run(self):
        return np.zeros(1)

    def seconds(self):
        (times,) = self.arguments
        return times.pop(0) if len(times) > 1 else times[0]


def test_the_median_time_of_all_rounds_counts():
    """A method that is slow once, at its first call, is still the fastest."""
    times = {"steady": [3.0], "slow once": [9.0, 2.0], "slowest": [4.0, 5.0]}
    methods = [Method(name, "", lambda case: "unused") for name in times]
    empty = Comparison("forward", "float64", 1e-3, "R", 1, 1)

    def program(method):
        return Timed(None, None, (times[method.name],), True, 1, 7.0, 40.0)

    compared = measure(empty, methods, program, lambda signal: 1e-6, quiet)
    expected = [("slow once", 2.0), ("steady", 3.0), ("slowest", 5.0)]
    assert [(r.name, r.seconds) for r in compared.results] == expected
    assert [r.pareto for r in compared.results] == [True, False, False]
    assert {(r.error, r.compile_seconds, r.details["flops"]) for r in compared.results} == {(1e-6, 7.0, 40.0)}


def test_the_fastest_within_the_tolerance_is_recommended(comparison):
    for tolerance, good in ((1e-3, {"float64", "float32"}), (1e-12, {"float64"})):
        at = dataclasses.replace(comparison, tolerance=tolerance)
        allowed = [r for r in at.results if r.error <= tolerance]
        assert {r.name for r in allowed} == good
        assert at.recommended == min(allowed, key=lambda r: r.seconds).name
        assert at.within
    impossible = dataclasses.replace(comparison, tolerance=-1.0)
    assert not impossible.within
    assert impossible.recommended == "float64"  # the most accurate


def test_an_interruption_keeps_results_so_far(film):
    def interrupted(case):
        raise KeyboardInterrupt

    methods = (METHODS[0], Method("slow", "", interrupted), METHODS[1])
    compared = compare_methods(film, "float64", quiet, methods)
    assert compared.interrupted
    assert [r.name for r in compared.results] == ["float64"]
    assert compared.recommended == "float64"


def test_impossible_requests_are_refused(film, refuses):
    nothing = pl.Scene(pl.Layer(1.0, pl.Free(50.0, 400.0, start=100.0)), substrate=1.0)
    refuses(UsageError, "nothing to compute: R is 0", cost, nothing, NM)
    for tolerance in (0.0, -1e-3, np.nan, np.inf):
        refuses(UsageError, "tolerance must be above zero", cost, film.scene, NM, tolerance=tolerance)
