"""Chains whose mixing and coverage of minima are known, and draws stretched to the sandwich estimator."""

from dataclasses import replace

import numpy as np
import pytest

from pellicle.fitting.covariance import Errors
from pellicle.sampling.chain import autocorrelation_time, check, empty, split_rhat
from pellicle.sampling.density import Modes, sandwich_stretch, unchanged

ONE = Modes(np.array([[0.5]]), np.array([[[0.1]]]), np.array([1.0]))
TWO = Modes(np.array([[0.2], [0.8]]), np.full((2, 1, 1), 0.01), np.array([0.6, 0.4]))


def autoregressive(memory: float, steps: int = 20_000, walkers: int = 8) -> np.ndarray:
    """x' = memory x + noise: its autocorrelation time is (1 + memory)/(1 − memory)."""
    random = np.random.default_rng(1)
    noise = random.normal(size=(steps, walkers))
    found = np.zeros((steps, walkers))
    for i in range(1, steps):
        found[i] = memory * found[i - 1] + noise[i]
    return 0.5 + 0.01 * found[..., None]


def chain(draws: np.ndarray, accepted: float = 0.5):
    steps, walkers, size = draws.shape
    return replace(
        empty(walkers, size, 0),
        draws=draws,
        log_density=np.zeros((steps, walkers)),
        accepted=np.full(walkers, accepted * steps),
    )


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_time_of_an_autoregressive_process(memory):
    expected = (1 + memory) / (1 - memory)
    assert autocorrelation_time(autoregressive(memory), ONE) == pytest.approx(expected, rel=0.1)


def test_walkers_that_never_change_their_minimum_take_for_ever():
    """Within each minimum the chain is white; between them nothing ever moves."""
    random = np.random.default_rng(0)
    home = np.where(np.arange(10) < 6, 0.2, 0.8)
    draws = (home + 0.01 * random.normal(size=(1000, 10)))[..., None]
    found = check(chain(draws), TWO)
    assert found.n_over_tau < 10
    assert found.rhat > 1.2
    assert not found.trusted
    assert any("R̂" in doubt for doubt in found.doubts)


def test_a_chain_that_stands_still_is_not_trusted():
    found = check(chain(np.full((400, 8, 1), 0.5), accepted=0.0), ONE)
    assert found.n_over_tau == 0
    assert "of the moves were accepted" in " ".join(found.doubts)


def test_a_minimum_without_a_walker_is_told():
    draws = 0.2 + 0.01 * np.random.default_rng(0).normal(size=(1000, 8, 1))
    found = check(chain(draws), TWO)
    assert (found.minima_found, found.minima_visited) == (2, 1)
    assert found.doubts == ("1 of the 2 minima that matter were visited",)


def test_a_good_chain_has_no_doubts():
    found = check(chain(autoregressive(0.5)), ONE)
    assert found.doubts == ()
    assert found.independent == pytest.approx(20_000 * 8 / 3, rel=0.1)


def test_split_rhat_of_three_steps_is_unknown_and_logs_nothing(caplog):
    assert np.isnan(split_rhat(np.random.default_rng(0).normal(size=(3, 8, 2))))
    assert not caplog.records


def test_split_rhat_of_drifting_walkers():
    """Alike among each other, but not in their first and second halves."""
    drift = np.linspace(0, 1, 1000)[:, None, None] + 0.01 * np.random.default_rng(0).normal(size=(1000, 8, 1))
    assert split_rhat(drift) > 1.5


CENTRES = np.array([[0.3, 0.5], [0.7, 0.02]])
NARROW = 1e-4 * np.array([[1.0, 0.6], [0.6, 2.0]])
WIDE = 1e-4 * np.array([[4.0, 1.5], [1.5, 3.0]])
RANGES = np.diag([1000.0, 2.0])


def _stretch():
    modes = Modes(CENTRES, np.array([np.linalg.cholesky(NARROW)] * 2), np.array([0.8, 0.2]))
    errors = Errors(("thickness", "n"), RANGES @ WIDE @ RANGES, RANGES @ NARROW @ RANGES)
    return sandwich_stretch(errors, RANGES, modes)


def test_draws_of_each_minimum_get_the_covariance_of_the_fit():
    rng = np.random.default_rng(0)
    draws = CENTRES[0] + rng.standard_normal((50_000, 2)) @ np.linalg.cholesky(NARROW).T
    found = _stretch()(draws.reshape(500, 100, 2)).reshape(-1, 2)
    np.testing.assert_allclose(np.cov(found.T), WIDE, atol=0.02 * WIDE.max())
    np.testing.assert_allclose(found.mean(axis=0), CENTRES[0], atol=3e-4)


def test_draws_stay_within_the_bounds():
    draws = CENTRES[1] + np.array([[0.01, -0.019], [-0.02, -0.015], [0.02, 0.01]])
    found = _stretch()(draws)
    assert np.all((found >= 0) & (found <= 1))


def test_a_fit_with_a_given_noise_leaves_them():
    modes = Modes(CENTRES, np.array([np.linalg.cholesky(NARROW)] * 2), np.array([0.8, 0.2]))
    errors = Errors(("thickness", "n"), RANGES @ WIDE @ RANGES)
    assert sandwich_stretch(errors, RANGES, modes) is unchanged
