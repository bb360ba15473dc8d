"""Lanes that take new starts from a queue: the same minima as one by one, in the order of the starts."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from pellicle.fitting.lanes import least_squares, minimise_by_numpy
from pellicle.fitting.levenberg_marquardt import normal_equations

GRID = np.linspace(0.0, 1.0, 40)
STARTS = np.random.default_rng(0).uniform(0.05, 0.95, (9, 2))
TARGETS = np.random.default_rng(1).uniform(0.2, 0.8, (9, 2))


def curve(y):
    """A damped oscillation with several minima in its frequency, (points,)."""
    return jnp.cos(60 * y[0] * GRID) * jnp.exp(-y[1] * GRID)


def residual(y, target):
    rows = curve(y) - curve(target)
    return [rows[:15], rows[15:]], jnp.sum(rows**2)


@partial(jax.jit, static_argnames="lanes")
def compiled(starts, targets, count, *, lanes, steps, coarse):
    return least_squares(residual, starts, targets, count, lanes=lanes, steps=steps, coarse=coarse)


def run(lanes, count=9, starts=STARTS, targets=TARGETS, steps=200, coarse=0.0):
    return jax.device_get(compiled(starts, targets, count, lanes=lanes, steps=steps, coarse=coarse))


@pytest.fixture(scope="module")
def three():
    return run(3)


def test_each_start_reaches_the_minimum_of_its_own_data(three):
    for start, target, y, cost in zip(STARTS, TARGETS, three.y, three.cost, strict=True):
        theirs = scipy_least_squares(
            lambda y, t=target: np.asarray(curve(jnp.asarray(y)) - curve(jnp.asarray(t))),
            y,
            bounds=(0.0, 1.0),
            x_scale=1.0,
            xtol=1e-12,
        )
        assert 2 * theirs.cost == pytest.approx(cost, abs=1e-9)
        began = float(jnp.sum((curve(jnp.asarray(start)) - curve(jnp.asarray(target))) ** 2))
        assert cost <= began
    assert three.converged.all()
    np.testing.assert_allclose(three.aux, three.cost, atol=1e-12)


@pytest.mark.parametrize("lanes", [*(pytest.param(n, marks=pytest.mark.slow) for n in (1, 4)), 16])
def test_the_number_of_lanes_does_not_matter(three, lanes):
    """16 lanes have more room than there are starts."""
    other = run(lanes)
    np.testing.assert_allclose(other.y, three.y, atol=1e-9)
    assert other.steps.tolist() == three.steps.tolist()


def test_starts_beyond_the_count_are_left_alone(three):
    some = run(3, count=5)
    np.testing.assert_allclose(some.y[:5], three.y[:5], atol=1e-9)
    np.testing.assert_array_equal(some.y[5:], STARTS[5:])
    assert some.steps[5:].tolist() == [0] * 4


def test_minima_far_above_the_best_are_not_computed_to_the_end_and_none_of_the_best_is_lost():
    """A lane on a plateau promises little, too, and may yet become the best."""
    starts = np.random.default_rng(5).uniform(0.02, 0.98, (120, 2))
    targets = np.tile([0.3, 0.5], (len(starts), 1))
    full, coarse = (run(3, 120, starts, targets, coarse=share) for share in (0.0, 1e-3))
    best = full.cost < full.cost.min() + 1e-6
    assert 10 < best.sum() < 60
    np.testing.assert_allclose(coarse.y[best], full.y[best], atol=1e-4)
    assert coarse.steps[~best].sum() < 0.75 * full.steps[~best].sum()
    assert (coarse.cost[~best] > full.cost.min() + 0.1).all()


def test_a_lane_of_too_many_steps_makes_room(three):
    slow = run(3, steps=4)
    assert (slow.steps <= 4).all()
    assert slow.steps.max() == 4
    assert not slow.converged[slow.steps == 4].all()


def test_a_start_without_a_number_ends_and_the_others_go_on(three):
    targets = TARGETS.copy()
    targets[2] = np.nan
    result = run(3, targets=targets)
    assert not result.converged[2]
    assert result.steps[2] == 1
    rest = np.arange(9) != 2
    np.testing.assert_allclose(result.y[rest], three.y[rest], atol=1e-9)


@pytest.mark.parametrize("coarse", [pytest.param(0.0, marks=pytest.mark.slow), 1e-3])
def test_the_same_minima_by_steps_of_numpy(coarse):
    """Of single starts the steps are the same; beside others, hopeless ones may end a step earlier."""

    @jax.jit
    @jax.vmap
    def equations(y, target):
        return normal_equations(residual, y, target)

    starts = np.random.default_rng(5).uniform(0.02, 0.98, (40, 2))
    targets = np.tile([0.3, 0.5], (len(starts), 1))

    def evaluated(y, which):
        return jax.device_get(equations(y, targets[which]))

    ours = minimise_by_numpy(evaluated, starts, steps=200, coarse=coarse)
    theirs = run(3, 40, starts, targets, coarse=coarse)
    best = theirs.cost < theirs.cost.min() + 1e-6
    assert ours.converged[best].all()
    np.testing.assert_allclose(ours.y[best], theirs.y[best], atol=1e-9)
    if coarse == 0:
        np.testing.assert_allclose(ours.cost, theirs.cost, atol=1e-9)
        assert ours.steps.tolist() == theirs.steps.tolist()
    else:
        full = minimise_by_numpy(evaluated, starts, steps=200)
        assert ours.steps[~best].sum() < 0.75 * full.steps[~best].sum()
