"""Orders of a series against all paths, one by one."""

from itertools import product

import numpy as np

from pellicle.mapping.order_path import BREAK, order_path


def test_the_path_is_the_cheapest_of_all():
    """By enumeration of every path through three minima at seven times."""
    rng = np.random.default_rng(7)
    t = np.array([0.0, 1.0, 2.0, 3.5, 4.0, 5.0, 6.0])
    true = 100 + 8 * t
    thickness = true[:, None] + np.array([0.0, 90.0, -70.0]) + rng.normal(0, 0.5, (7, 1))
    delta = np.abs(rng.normal(0, 3, (7, 3)))
    delta -= delta.min(axis=1, keepdims=True)
    sigma = np.full(7, 0.5)
    found = order_path(t, thickness, delta, sigma, 0 * t)
    assert (found.chosen == found.chosen[0]).all()
    assert not found.breaks.any()
    # parallel paths differ in Δχ² alone, less what all times have in common
    sums = delta.sum(axis=0)
    assert found.chosen[0] == np.argmin(sums)
    assert (found.rival <= np.sort(sums)[1] - sums.min() + 1e-9).all()

    def price(path):
        steps = np.diff(t)
        total = 0.0
        for i in range(2, 7):
            ratio = steps[i - 1] / steps[i - 2]
            off = path[i] - path[i - 1] - ratio * (path[i - 1] - path[i - 2])
            total += min(off**2 / 0.25 / (1 + (1 + ratio) ** 2 + ratio**2), BREAK)
        return total

    every = [price([thickness[i, k] for i, k in enumerate(ks)]) for ks in product(range(3), repeat=7)]
    chosen = price(thickness[np.arange(7), found.chosen])
    assert chosen <= np.sort(every)[3]  # an even path, as the two beside it


def test_a_jump_is_a_break_and_what_follows_is_right():
    t = np.arange(30.0)
    true = np.where(t < 12, 500 + 3 * t, 300 + 3 * t)
    thickness = np.stack([true, true + 110, true - 110], axis=1)
    delta = np.tile([0.0, 2.0, 3.0], (30, 1))
    found = order_path(t, thickness, delta, np.full(30, 0.3), 0 * t)
    assert list(np.flatnonzero(found.breaks)) == [12]
    assert (found.chosen == 0).all()


def test_a_film_that_stands_still_repeats_one_measurement():
    """A hundred equal spectra decide no more than one: the error of an index favours one order in all."""
    still = np.tile([500.0, 610.0], (100, 1))
    still += np.random.default_rng(1).normal(0, 0.3, (100, 1))
    found = order_path(
        np.arange(100.0), still, np.tile([0.0, 2.0], (100, 1)), np.full(100, 0.3), np.zeros(100)
    )
    assert (found.rival < 12).all()


def test_orders_that_every_time_decides_are_not_weighed_down():
    """No rival is near, and the thin start of a film bends: the few times there are not one measurement."""
    t = np.arange(300.0)
    true = 10 * t
    true[:2] = 0  # too thin to be seen
    thickness = np.stack([true, true + 200, true + 500], axis=1)
    found = order_path(t, thickness, np.tile([0.0, 400.0, 900.0], (300, 1)), np.full(300, 0.2), 0 * t)
    assert (found.chosen == 0).all()
