"""Films whose posterior is known on a grid; all of 5 or of 128 points, so that programs are shared."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.simulation.spectra import simulate_signal

BANDS = np.array([450.0, 520.0, 600.0, 690.0, 800.0])


def film(lower: float = 50.0, upper: float = 1500.0, prior=None) -> pl.Scene:
    """A layer of index 1.46 whose thickness is free, and nothing that is not known but the noise."""
    return pl.Scene(
        pl.Layer(1.46, pl.Free(lower, upper, prior=prior)),
        pl.dispersion.Constant(3.9, 0.02),
        uncertainty=pl.Uncertainty.none(),
    )


def bands(thickness: float = 650.0, noise: float = 0.04, seed: int = 3) -> pl.Spectrum:
    """Five bands of such a film with noise that is known: a thickness read from them has rivals."""
    fixed = pl.Scene(pl.Layer(1.46, thickness), pl.dispersion.Constant(3.9, 0.02))
    values = simulate_signal(fixed, BANDS, noise, seed).values
    return pl.Spectrum(BANDS, values, "R", sigma=np.full(BANDS.size, noise))


@pytest.fixture(scope="session", name="film")
def _film():
    return film


@pytest.fixture(scope="session", name="bands")
def _bands():
    return bands


@pytest.fixture(scope="session")
def bimodal() -> pl.Posterior:
    return pl.sample(bands(), film())
