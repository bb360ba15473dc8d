"""The sampled posterior against the same posterior on a grid, simulated by the tmm package."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError

from ..by_tmm import films
from .conftest import BANDS

GRID = np.linspace(50.0, 1500.0, 2901)


@pytest.fixture(scope="module")
def grid(bands) -> np.ndarray:
    """The posterior at `GRID` under a uniform prior, which sums to 1."""
    data, stack = bands(), [1.0, 1.46, 3.9 + 0.02j]
    seen = [films("s", BANDS, stack, [d]) for d in GRID]
    log = -0.5 * np.sum(((data.values - seen) / data.sigma) ** 2, axis=1)
    weight = np.exp(log - log.max())
    return weight / weight.sum()


def quantile(weight: np.ndarray, share: float) -> float:
    return float(np.interp(share, np.cumsum(weight), GRID))


@pytest.mark.slow
def test_each_minimum_has_its_share(bimodal, grid):
    assert bimodal.trusted
    modes = [mode for mode in bimodal["thickness"].modes if mode.mass > 0.02]
    assert len(modes) == 2
    for mode in modes:
        near = abs(GRID - mode.value) < 80
        # 2000 independent draws know a share to ± 0.01
        assert mode.mass == pytest.approx(grid[near].sum(), abs=0.04)


def test_moments_and_quantiles_are_those_of_the_grid(bimodal, grid):
    marginal = bimodal["thickness"]
    mean = float(grid @ GRID)
    sd = float(np.sqrt(grid @ (GRID - mean) ** 2))
    assert marginal.mean == pytest.approx(mean, abs=0.12 * sd)
    assert marginal.sd == pytest.approx(sd, rel=0.08)
    assert marginal.q025 == pytest.approx(quantile(grid, 0.025), abs=2.0)
    assert marginal.q975 == pytest.approx(quantile(grid, 0.975), abs=2.0)


def test_all_minima_that_matter_were_visited(bimodal):
    assert bimodal.checks.minima_found == bimodal.checks.minima_visited == 2
    assert bimodal.checks.n_over_tau >= 50


@pytest.mark.parametrize(
    ("prior", "log_prior"),
    [
        (pl.priors.Normal(440.0, 100.0), lambda d: -0.5 * ((d - 440.0) / 100.0) ** 2),
        pytest.param(pl.priors.LogUniform(), lambda d: -np.log(d), marks=pytest.mark.slow),
    ],
)
def test_a_prior_weighs_the_minima(bands, film, grid, prior, log_prior):
    weight = grid * np.exp(log_prior(GRID) - log_prior(440.0))
    weight /= weight.sum()
    found = pl.sample(bands(), film(prior=prior))["thickness"]
    thin = sum(mode.mass for mode in found.modes if mode.value < 540)
    assert thin == pytest.approx(weight[GRID < 540].sum(), abs=0.04)


@pytest.mark.slow  # compiles for 4 s
def test_a_half_normal_prior_presses_towards_zero(film):
    """Data that say nothing leave the prior: half a normal distribution."""
    blind = pl.Spectrum(BANDS, np.full(5, 0.3), "R", sigma=np.full(5, 100.0))
    found = pl.sample(blind, film(lower=0.0, prior=pl.priors.HalfNormal(50.0))).marginals()["thickness"]
    assert found.mean == pytest.approx(50.0 * np.sqrt(2 / np.pi), rel=0.08)
    assert found.q975 == pytest.approx(50.0 * 2.2414, rel=0.1)


@pytest.mark.slow  # two chains
def test_the_same_seed_gives_the_same_chain(bands, film, bimodal):
    again = pl.sample(bands(), film())
    np.testing.assert_array_equal(again.draws, bimodal.draws)
    assert not np.array_equal(pl.sample(bands(), film(), seed=1).draws[:50], bimodal.draws[:50])


def test_a_chain_that_is_too_short_gives_no_interval(bands, film):
    found = pl.sample(bands(), film(), steps=20)
    assert not found.trusted
    assert found.parameters == {}
    assert "autocorrelation times long" in str(found)


@pytest.mark.parametrize(
    ("walkers", "sentence"), [(3, "an even number"), (2, "at least 4"), (10**9, "GiB and the machine has")]
)
def test_impossible_walkers_are_refused(bands, film, walkers, sentence, refuses):
    refuses(UsageError, sentence, pl.sample, bands(), film(), walkers=walkers)
