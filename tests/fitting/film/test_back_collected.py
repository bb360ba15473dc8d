"""Fits of films on plates: the share of light from the back face, and its unpolarised light."""

from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.problem import measured as as_numbers
from pellicle.forward_model.film_signal import build
from pellicle.optics.ellipsometry import psi_delta
from pellicle.scene.film import with_wavelength

NM = np.linspace(400.0, 900.0, 128)
SHARE, NOISE = 0.4, 0.001
COLLECTED = "substrate.back_collected"


def scene(thickness, **part) -> pl.Scene:
    return pl.Scene(pl.Layer(2.1, thickness), pl.Substrate("BK7", back="air", **part))


@pytest.fixture(scope="module")
def measured() -> pl.Spectrum:
    return pl.simulate(scene(180.0, back_collected=SHARE), NM, noise=NOISE, seed=3)


@pytest.mark.slow
def test_a_free_share_is_found(measured):
    fit = pl.fit(measured, scene(pl.Free(50, 400), back_collected=pl.Free(0, 1)))
    assert fit.status == "converged"
    found = fit[COLLECTED]
    # least error: the light from the back face is known to the noise at each of 128 points
    added = pl.simulate(scene(180.0), NM).values - pl.simulate(scene(180.0, back_collected=0.0), NM).values
    assert found.stderr_noise < 2 * NOISE / np.linalg.norm(added)
    assert abs(found.value - SHARE) < 4 * found.stderr_noise
    assert abs(fit["thickness"].value - 180.0) < 4 * fit["thickness"].stderr_noise


@pytest.mark.slow
def test_a_share_of_all_is_a_limit():
    """1 is a bound that physics sets: the answer stands, with a limit on one side."""
    data = pl.simulate(scene(180.0), NM, noise=NOISE, seed=2)
    fit = pl.fit(data, scene(pl.Free(50, 400), back_collected=pl.Free(0, 1)))
    assert fit.status == "converged"
    assert fit[COLLECTED].value > 0.99
    assert 0.6 < fit[COLLECTED].lower_limit < 1
    assert any("compatible with 1: it is at least" in said for said in fit.warnings)


@pytest.mark.slow  # two fits, each with the simulated effects of a back face
def test_a_whole_back_face_says_what_part_would_explain_the_data(measured):
    verdict = pl.fit(measured, scene(pl.Free(50, 400))).verdict
    assert "about 40 % is collected would explain" in verdict
    assert "`back_collected=Free(0, 1)`" in verdict
    whole = pl.fit(pl.simulate(scene(180.0), NM, noise=NOISE, seed=2), scene(pl.Free(50, 400)))
    assert "back face matters" in whole.verdict
    assert "collected" not in whole.verdict


def test_more_than_all_is_refused(measured):
    with pytest.raises(ValueError, match="`back_collected` must be at most 1: its upper bound is 2"):
        pl.fit(measured, scene(pl.Free(50, 400), back_collected=pl.Free(0, 2)))


def test_a_transmittance_through_a_back_that_returns_nothing_is_refused():
    """The scene of a file without a stated signal is that of R, where a rough back is simulated."""
    rough = scene(pl.Free(50, 400), back_collected=0.0)
    with pytest.raises(UsageError, match="through a rough or taped back is not simulated"):
        pl.fit(pl.Spectrum(NM, np.full(128, 0.8), "T", path="film.csv"), rough)


FORTY = np.linspace(400.0, 800.0, 40)
PLATE = pl.Substrate(1.52, back=1.0)
SCENE = pl.Scene(pl.Layer(2.1, pl.Free(10, 400, start=120.0)), PLATE)


@pytest.fixture(scope="module")
def ncs() -> np.ndarray:
    """N, C, S as they leave the sample of 120 nm, part of the light unpolarised."""
    light = pl.Light(signal="psi-delta", angle=65.0)
    scene = with_wavelength(pl.Scene(pl.Layer(2.1, 120.0), PLATE, light=light), FORTY, 65.0)
    return np.asarray(build(pl.plan(scene))(scene)).reshape(-1, 3).T


def as_spectrum(ncs: np.ndarray) -> pl.Spectrum:
    psi, delta = map(np.asarray, psi_delta(*ncs))
    return pl.Spectrum(FORTY, psi, "psi-delta", angle=np.full(40, 65.0), delta=delta, path="film.csv")


def residual(data: pl.Spectrum) -> np.ndarray:
    """At the truth."""
    (view,) = make(as_numbers(data, SCENE)).views
    return (view.data.values - np.asarray(view.local(np.array([120.0])).model))[: view.points]


@pytest.mark.slow
def test_psi_and_delta_say_nothing_of_the_unpolarised_part(ncs):
    assert np.linalg.norm(ncs, axis=0).max() < 0.999
    np.testing.assert_allclose(residual(as_spectrum(ncs)), 0, atol=1e-12)


@pytest.mark.slow
def test_a_rotating_analyser_sees_n_and_c_as_they_are(ncs):
    """N = cos 2Ψ and C = sin 2Ψ cos Δ, as from α and β (`data.ellipsometry_angles`), whatever S was."""
    n, c, _ = ncs
    seen = as_spectrum(np.array([n, c, np.sqrt(1 - n**2 - c**2)]))
    np.testing.assert_allclose(residual(replace(seen, folded=True)), 0, atol=1e-12)
