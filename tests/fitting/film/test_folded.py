"""Ψ and a Δ without its sign, as without a compensator, and files whose Δ follows another convention."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.other_readings import conventions
from pellicle.fitting.film.problem import measured

from ...differences import derivative

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

    at = seen(psi, delta)
    assert at.values.shape == (5, 2)
    slopes = [
        derivative(lambda psi: seen(psi, delta).values, psi, 1e-4),
        derivative(lambda delta: seen(psi, delta).values, delta, 1e-4),
    ]
    expected = np.sqrt(np.mean(np.sum(np.square(slopes), axis=0), axis=-1)) * spread
    np.testing.assert_allclose(at.sigma, expected, rtol=1e-2)
    assert seen(np.zeros(5), np.full(5, 90.0)).sigma.min() > 0  # where neither moves to first order


@pytest.mark.slow  # two fits; tests/data has how folded angles are recognised
def test_a_misfit_that_would_fit_as_folded():
    """Δ of 205 to 283 degrees, folded: nothing shows it but that the scene explains it so only."""
    scene = pl.Scene(pl.Layer("SiO2", pl.Free(10, 300)), "Si", light=pl.Light(angle=70.0, signal="psi-delta"))
    truth = pl.Scene(pl.Layer("SiO2", 260.0), "Si", light=scene.light)
    right_way = pl.simulate(truth, np.linspace(600.0, 900.0, 64), noise=0.03)
    assert 200 < right_way.delta.min() < right_way.delta.max() < 300
    data = replace(right_way, delta=360 - right_way.delta)
    assert not data.folded
    found = pl.fit(data, scene)
    assert found.status == "misfit"
    assert "read as folded it would fit, with thickness 2" in found.warnings[0]
    assert "give `folded=True`" in found.warnings[0]
    assert "360 - delta in place of delta" in found.warnings[0]  # of these values it is the same
    right = pl.fit(replace(data, folded=True), scene)
    assert right.status == "converged"
    assert abs(right["thickness"].value - 260.0) < 4 * right["thickness"].stderr_noise
    assert not any("folded" in warning for warning in right.warnings)
    assert not any("folded" in warning for warning in pl.fit(right_way, scene).warnings)


NM = np.linspace(400.0, 760.0, 64)
PSI, DELTA = (np.asarray(x) for x in pl.ellipsometry(NM, 250.0, "SiO2", "Si", angle=70.0))


def spectrum(delta, **more):
    angle, noise = np.full(64, 70.0), np.random.default_rng(1).normal(0, 0.03, (2, 64))
    return pl.Spectrum(
        NM, PSI + noise[0], "psi-delta", delta=(delta + noise[1]) % 360, angle=angle, folded=False, **more
    )


@pytest.mark.parametrize(
    ("words", "written"),
    [("360 - delta", 360 - DELTA), ("delta + 180", DELTA - 180), ("180 - delta", 180 - DELTA)],
)
def test_each_convention_is_undone(words, written):
    data = spectrum(written)
    again = dict(conventions([data], [20.0]))
    turned = {}
    for name, (read,) in again.items():
        assert isinstance(read, pl.Spectrum)
        turned[name] = np.exp(1j * np.deg2rad(np.asarray(read.delta) - DELTA))
    assert [name for name, turn in turned.items() if np.all(np.abs(turn - 1) < 0.01)] == [words]


def test_small_residuals_and_other_signals_are_not_read_again():
    data = spectrum(DELTA)
    reflectance = pl.Spectrum(NM, np.full(64, 0.3), "R")
    assert list(conventions([data], [1.0])) == []
    assert list(conventions([reflectance], [20.0])) == []


@pytest.mark.slow  # four fits
def test_a_misfit_names_the_convention():
    """Without a given noise, too: C alone is wrong where the file has 180 - delta."""
    fit = pl.fit(spectrum(180 - DELTA), pl.Scene(pl.Layer("SiO2", pl.Free(1, 1000)), "Si"))
    assert fit.status == "misfit"
    assert "with 180 - delta in place of delta it would fit, with thickness 2" in fit.warnings[0]
    assert float(fit.warnings[0].split("thickness ")[1].split()[0]) == pytest.approx(250, abs=0.5)
