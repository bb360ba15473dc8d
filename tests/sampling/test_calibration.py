"""A short version of `benchmarks/calibration.py`: how often intervals hold truths drawn from the prior."""

from __future__ import annotations

import numpy as np
import pytest

import pellicle as pl

pytestmark = pytest.mark.slow  # 30 posteriors; test_sample.py compares posteriors with a grid

SETS = 30
TRUTHS = np.random.default_rng(0).uniform(50.0, 1500.0, SETS)


@pytest.fixture(scope="module")
def inside(bands, film):
    """Whether the truth lies in the 68 % and the 95 % interval of each data set."""
    found = []
    for seed, truth in enumerate(TRUTHS):
        draws = pl.sample(bands(float(truth), 0.02, seed), film(), seed=seed).draws
        ends = np.quantile(draws, [0.16, 0.84, 0.025, 0.975])
        found.append((ends[0] < truth < ends[1], ends[2] < truth < ends[3]))
    return np.array(found).sum(axis=0)


def test_95_per_cent(inside):
    """Of 30, 28.5 are expected, and fewer than 25 in 3 of 1000 studies."""
    assert inside[1] >= 25


def test_68_per_cent(inside):
    """Of 30, 20.4 are expected, outside of 13 to 27 in 5 of 1000 studies."""
    assert 13 <= inside[0] <= 27
