"""A few of the random stacks that `make properties` draws by the million."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "properties.py"


@pytest.fixture(scope="module")
def properties():
    spec = importlib.util.spec_from_file_location("properties", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_stacks_are_finite_and_conserve_energy(properties):
    rows = properties.scenes(np.random.default_rng(3), 10_000, 3)
    for law, bad in properties.violations(rows, 3).items():
        assert not np.any(bad), (law, rows[bad][0].tolist())
