"""What a climb keeps, marks and recommends; with rungs that cost nothing to compile."""

from __future__ import annotations

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.cost import cost
from pellicle.accuracy.measure import MethodResult, climb, mark_pareto
from pellicle.accuracy.methods import FORWARD, Rung
from pellicle.errors import UsageError

from .conftest import NM, few

RUNGS = {rung.name: rung for rung in FORWARD}
USED = ("float64", "float32", "closed form", "1 order", "2 orders")


def quiet(what, done, total):
    pass


@pytest.fixture(scope="module")
def film():
    return few(pl.Scene(pl.Layer(2.2, pl.Free(50.0, 400.0, start=100.0)), substrate=3.9))


def standing(error, seconds):
    return MethodResult("", "", error, seconds, 0.0, None)


def test_the_front_is_what_nobody_beats():
    rungs = [
        standing(*x) for x in [(1e-3, 1.0), (1e-6, 2.0), (1e-4, 3.0), (0.0, 4.0), (0.0, 5.0), (np.inf, 9.0)]
    ]
    mark_pareto(rungs)
    assert [rung.pareto for rung in rungs] == [True, True, False, True, False, False]


@pytest.fixture(scope="module")
def ladder(film):
    return climb(film, "float64", quiet, tuple(RUNGS[name] for name in USED))


def test_errors_and_costs(ladder):
    found = {rung.name: rung for rung in ladder.rungs}
    assert found.keys() == {"float64", "float32", "1 order", "2 orders"}
    assert ladder.left_out == {"closed form": "the full plan is the closed form"}
    assert found["float64"].error == 0
    assert 1e-9 < found["float32"].error < 1e-6
    assert found["2 orders"].error < found["1 order"].error < 0.1
    for rung in ladder.rungs:
        assert 0 < rung.seconds < rung.compile_seconds
        assert rung.flops > len(NM)
    assert [rung.seconds for rung in ladder.rungs] == sorted(rung.seconds for rung in ladder.rungs)


def test_the_fastest_within_the_tolerance_is_recommended(ladder):
    for tolerance, good in ((1e-3, {"float64", "float32"}), (1e-12, {"float64"})):
        ladder.tolerance = tolerance
        allowed = [rung.name for rung in ladder.rungs if rung.error <= tolerance]
        assert set(allowed) == good
        assert ladder.recommended == allowed[0]
        assert ladder.within
    ladder.tolerance = -1.0
    assert not ladder.within
    assert ladder.recommended == "float64"  # the most accurate


def test_an_interruption_keeps_what_was_measured(film):
    def interrupted(case):
        raise KeyboardInterrupt

    rungs = (FORWARD[0], Rung("slow", "", interrupted), FORWARD[1])
    ladder = climb(film, "float64", quiet, rungs)
    assert ladder.interrupted
    assert [rung.name for rung in ladder.rungs] == ["float64"]
    assert ladder.recommended == "float64"


def test_what_cannot_be_asked(film):
    nothing = pl.Scene(pl.Layer(1.0, pl.Free(50.0, 400.0, start=100.0)), substrate=1.0)
    with pytest.raises(UsageError, match="nothing to compute: R is 0"):
        cost(nothing, NM)
    for tolerance in (0.0, -1e-3, np.nan, np.inf):
        with pytest.raises(UsageError, match="tolerance must be above zero"):
            cost(film.scene, NM, tolerance=tolerance)
