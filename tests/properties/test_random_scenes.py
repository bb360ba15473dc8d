"""A few of the random stacks that `make properties` draws by the million."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def properties(load_script):
    return load_script("benchmarks/properties.py")


@pytest.mark.slow
def test_stacks_are_finite_and_conserve_energy(properties):
    rows = properties.scenes(np.random.default_rng(3), 10_000, 3)
    for law, bad in properties.violations(rows, 3).items():
        assert not np.any(bad), (law, rows[bad][0].tolist())
