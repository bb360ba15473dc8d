"""Local minima of a problem: polished until the best has settled, told apart, and sorted."""

from typing import NamedTuple

import numpy as np
import pytest

from pellicle.fitting import minima as module
from pellicle.fitting.coordinates import box
from pellicle.fitting.evaluation import Polished
from pellicle.fitting.minima import Minima, distinct, minima, solve
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem

LOWER, UPPER, HOME = 10.0, 1000.0, 700.0
"""Bounds and the only minimum of a thickness (nm)."""


def problem(**changes) -> Problem:
    """One thickness, and no view: `polish` is replaced."""
    thickness = Parameter(
        "thickness", "thickness", "nm", 500.0, LOWER, UPPER, **({"resolution": 0.5} | changes)
    )
    return Problem((), (thickness,), box(np.array([LOWER]), np.array([UPPER]), [None]))


def unit(nm) -> np.ndarray:
    """Points (points, 1) of the unit cube at thicknesses in nm."""
    return (np.atleast_1d(np.asarray(nm, dtype=float))[:, None] - LOWER) / (UPPER - LOWER)


class Solver(NamedTuple):
    """A replaced solver: the share of the way to the minimum that one call leaves, and the calls so far."""

    left: float
    calls: list[np.ndarray]

    def __call__(self, static, arrays, bounds, units, until):
        self.calls.append(np.asarray(units)[: until.count])
        nearer = unit(HOME) + (units - unit(HOME)) * self.left
        away = np.abs(nearer - unit(HOME))[:, 0] * (UPPER - LOWER)
        return Polished(nearer, away, away < 1e-3, np.ones(len(units), int))


@pytest.fixture
def solver(monkeypatch):
    """Return a function that replaces the solver by one that leaves this share of the way in each call."""

    def replace(left: float) -> Solver:
        replaced = Solver(left, [])
        monkeypatch.setattr(module, "polish", replaced)
        return replaced

    return replace


def test_the_best_is_polished_until_it_has_settled(solver):
    third = solver(1 / 3)
    result = minima(problem(), unit(703.0))
    assert result.converged[0]
    assert len(third.calls) == 8  # 3 nm / 3⁸ < 1e-3 nm


@pytest.mark.parametrize(("left", "calls"), [(0.9, 1 + 50), (1.0, 2)])
def test_a_best_that_creeps_is_given_up_and_one_that_is_stuck_at_once(solver, left, calls):
    """680 nm · 0.9⁵¹ = 3.2 nm."""
    creeping = solver(left)
    assert not minima(problem(), unit(20.0)).converged[0]
    assert len(creeping.calls) == calls


def test_only_as_many_as_are_followed_are_polished_again(solver):
    """The others stay where the first polish left them."""
    third = solver(1 / 3)
    result = minima(problem(), unit([703.0, 400.0]), followed=1)
    assert [len(call) for call in third.calls[1:]] == [1] * 7
    np.testing.assert_allclose(result.units, unit([HOME, 600.0]), atol=1e-5)
    np.testing.assert_allclose(result.deviance, [0.0, 100.0], atol=1e-3)
    assert result.converged.tolist() == [True, False]
    calls = len(third.calls)
    minima(problem(), unit(703.0), followed=0)
    assert len(third.calls) == calls + 1

    # a best that has settled is not polished again
    assert minima(problem(), unit(700.001), followed=1).converged[0]
    assert len(third.calls) == calls + 2


def test_starts_go_in_calls_of_one_size_and_come_back_in_their_order(solver, monkeypatch):
    monkeypatch.setattr(module, "SLOTS", 2)
    third = solver(1 / 3)
    reports = []
    result = solve(problem(), unit([100.0, 400.0, 1000.0]), progress=lambda *r: reports.append(r))
    assert [len(call) for call in third.calls] == [2, 1]
    np.testing.assert_allclose(result.units, unit([500.0, 600.0, 800.0]))
    assert reports == [("polish", 0, 3), ("polish", 2, 3), ("polish", 3, 3)]


def test_a_fixed_parameter_has_no_room(monkeypatch):
    """Its bounds meet at the value asked of each start; a start of the padding has the last one's."""
    boxes = []

    def stay(static, arrays, bounds, units, until):
        boxes.append(bounds)
        return Polished(units, units[:, 0], np.ones(len(units), bool), np.ones(len(units), int))

    monkeypatch.setattr(module, "polish", stay)
    monkeypatch.setattr(module, "SLOTS", 3)
    solve(problem(), unit([100.0, 400.0]), fixed=(0, np.array([150.0, 250.0])))
    [bounds] = boxes
    assert bounds.lower.tolist() == bounds.upper.tolist() == [[150.0], [250.0], [250.0]]


def test_minima_within_the_resolution_are_one():
    """0.5 nm, or 0.2 % of the thickness where that is more; 2 % of the range where none is given."""
    units, deviance = unit([100.0, 100.4, 700.0, 701.3, 100.6]), np.array([3.0, 1.0, 2.0, 4.0, 5.0])
    several = Minima(units, deviance, np.ones(5, bool))
    result = distinct(problem(), several, 5)
    np.testing.assert_allclose(result.units, unit([100.4, 700.0]))
    assert result.deviance.tolist() == [1.0, 2.0]
    apart = Minima(unit([100.0, 101.0, 120.1]), np.array([1.0, 2.0, 3.0]), np.ones(3, bool))
    np.testing.assert_allclose(distinct(problem(), apart, 3).units, apart.units)
    np.testing.assert_allclose(distinct(problem(resolution=None), apart, 3).units, unit([100.0, 120.1]))
    np.testing.assert_allclose(distinct(problem(resolution=np.inf), apart, 3).units, unit([100.0]))


def test_a_minimum_without_a_deviance_is_kept_only_alone():
    broken = Minima(unit([100.0, 700.0]), np.array([np.inf, 1.0]), np.array([False, True]))
    np.testing.assert_allclose(distinct(problem(), broken, 2).units, unit([700.0]))
    only = Minima(unit([100.0]), np.array([np.inf]), np.array([False]))
    np.testing.assert_allclose(distinct(problem(), only, 2).units, unit([100.0]))
