"""A small cube of a made-up signal and its scene, for tests without fits by JAX."""

import sys
from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.cube import Cube


@pytest.fixture(scope="session")
def fake_fits():
    """The module of fake fits, where worker processes find it, too."""
    folder = str(Path(__file__).parent)
    sys.path.insert(0, folder)
    import fake_fits

    yield fake_fits
    sys.path.remove(folder)


@pytest.fixture
def cube():
    """45 x 32 pixels of 20 bands in memory: one without data, one left out by the mask."""
    values = np.random.default_rng(0).uniform(0, 0.5, (45, 32, 20))
    values[3, 5] = np.nan
    values[40:, 30:] += 0.4
    mask = np.ones((45, 32), bool)
    mask[7, 7] = False
    coords = {"y": 0.5 * np.arange(45), "x": np.arange(32.0)}
    return Cube(
        {"values": values},
        np.linspace(400.0, 700.0, 20),
        coords=coords,
        units={"y": "mm", "x": "mm"},
        mask=mask,
        path="wafer.npy",
        notes=("percent",),
    )


@pytest.fixture(scope="session")
def scene():
    return pl.Scene(pl.Layer(1.46, pl.Free(10, 800)), 3.9)


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks of 8 x 8 pixels, of which the cube has 6 x 4."""
    monkeypatch.setattr("pellicle.mapping.store.PIXELS", 64)


@pytest.fixture
def same_files():
    """Check that two folders have the same files with the same bytes."""

    def same_files(one: Path, other: Path):
        files = [sorted(p.relative_to(root) for p in root.rglob("*") if p.is_file()) for root in (one, other)]
        assert files[0] == files[1]
        assert [p for p in files[0] if (one / p).read_bytes() != (other / p).read_bytes()] == []

    return same_files
