"""Ψ and a Δ without its sign, as an instrument without a compensator measures them."""

from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.spectra.targets import measured

COMPUTED = Path(__file__).parents[3] / "measurements" / "wvase" / "cauchy_100nm.txt"
"""By another program (WVASE): n = 1.47 + 4950/λ², 100 nm on silicon, with Δ folded where it passes 180."""


def test_a_film_whose_delta_was_folded():
    spectrum = pl.read_spectrum(COMPUTED, folded=True, noise=0.01)
    film = pl.dispersion.Cauchy(pl.Free(1.3, 1.7), pl.Free(0, 2e4))
    found = pl.fit(spectrum, pl.Scene(pl.Layer(film, pl.Free(10, 500)), "Si/Aspnes"))
    assert found.status == "converged"
    assert found["thickness"].value == pytest.approx(100.0, abs=0.02)
    assert found["A"].value == pytest.approx(1.47, abs=2e-4)
    curve = found.curve
    np.testing.assert_allclose(curve.delta_data, spectrum.delta, rtol=1e-12)
    assert 0 <= curve.delta_model.min() <= curve.delta_model.max() <= 180
    np.testing.assert_allclose(curve.delta_residual, 0, atol=0.06)
    assert found.rms < 0.005


def test_errors_of_n_and_c_by_finite_differences():
    psi, delta = np.array([0.01, 30.0, 45.0, 60.0, 45.0]), np.array([80.0, 20.0, 90.0, 179.9, 180.0])
    spread, angle = np.array([0.1, 0.2, 0.1, 0.1, 0.1]), np.full(5, 70.0)

    def seen(psi, delta):
        data = pl.Spectrum(
            np.arange(400.0, 405.0), psi, "psi-delta", spread, angle=angle, delta=delta, folded=True
        )
        return measured(data, pl.Scene(pl.Layer(1.46, pl.Free(1, 9)), 1.5))

    at, step = seen(psi, delta), 1e-4
    assert at.values.shape == (5, 2)
    slopes = [
        (seen(psi + step, delta).values - seen(psi - step, delta).values) / (2 * step),
        (seen(psi, delta + step).values - seen(psi, delta - step).values) / (2 * step),
    ]
    expected = np.sqrt(np.mean(np.sum(np.square(slopes), axis=0), axis=-1)) * spread
    np.testing.assert_allclose(at.sigma, expected, rtol=1e-2)
    assert seen(np.zeros(5), np.full(5, 90.0)).sigma.min() > 0  # where neither moves to first order
