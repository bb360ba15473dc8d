"""Ψ and a Δ without its sign, as an instrument without a compensator measures them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.targets import measured

COMPUTED = Path(__file__).parents[3] / "measurements" / "wvase" / "cauchy_100nm.txt"
"""By another program (WVASE): n = 1.47 + 4950/λ², 100 nm on silicon, with Δ folded where it passes 180."""


@pytest.mark.slow  # two fits of ellipsometry
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


@pytest.mark.slow  # two fits; tests/data has how folded angles are recognised
def test_a_misfit_that_would_fit_as_folded():
    """Δ of 205 to 283 degrees, folded: nothing shows it but that the scene explains it so only."""
    nm = np.linspace(600.0, 900.0, 64)
    psi, delta = (np.asarray(x) for x in pl.ellipsometry(nm, 260.0, "SiO2", "Si", angle=70.0))
    assert 200 < delta.min() < delta.max() < 300
    noise = np.random.default_rng(1).normal(0, 0.03, (2, 64))
    angle = np.full(64, 70.0)
    data = pl.Spectrum(
        nm, psi + noise[0], "psi-delta", np.full(64, 0.03), delta=360 - delta + noise[1], angle=angle
    )
    assert not data.folded
    scene = pl.Scene(pl.Layer("SiO2", pl.Free(10, 300)), "Si")
    found = pl.fit(data, scene)
    assert found.status == "misfit"
    assert "read as folded it would fit, with thickness 260" in found.warnings[0]
    assert found.warnings[0].endswith("give `folded=True`")
    right = pl.fit(replace(data, folded=True), scene)
    assert right.status == "converged"
    assert abs(right["thickness"].value - 260.0) < 4 * right["thickness"].stderr_noise
    assert not any("folded" in warning for warning in right.warnings)
    assert not any("folded" in warning for warning in pl.fit(replace(data, delta=delta), scene).warnings)
