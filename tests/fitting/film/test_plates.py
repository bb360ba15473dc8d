"""Ellipsometry of a film on a plate whose back face sends unpolarised light along."""

from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.targets import measured
from pellicle.forward_model.film_signal import build
from pellicle.optics.ellipsometry import psi_delta
from pellicle.scene.film import with_wavelength

NM = np.linspace(400.0, 800.0, 40)
PLATE = pl.Substrate(1.52, back=1.0)
SCENE = pl.Scene(pl.Layer(2.1, pl.Free(10, 400, start=120.0)), PLATE)


@pytest.fixture(scope="module")
def ncs() -> np.ndarray:
    """N, C, S as they leave the sample of 120 nm, part of the light unpolarised."""
    light = pl.Light(signal="psi-delta", angle=65.0)
    scene = with_wavelength(pl.Scene(pl.Layer(2.1, 120.0), PLATE, light=light), NM, 65.0)
    return np.asarray(build(pl.plan(scene))(scene)).reshape(-1, 3).T


def spectrum(ncs: np.ndarray) -> pl.Spectrum:
    psi, delta = map(np.asarray, psi_delta(*ncs))
    return pl.Spectrum(NM, psi, "psi-delta", angle=np.full(40, 65.0), delta=delta, path="film.csv")


def residual(data: pl.Spectrum) -> np.ndarray:
    """At the truth."""
    (view,) = make(measured(data, SCENE)).views
    return (view.data.values - np.asarray(view.local(np.array([120.0])).model))[: view.points]


@pytest.mark.slow
def test_psi_and_delta_say_nothing_of_the_unpolarised_part(ncs):
    assert np.linalg.norm(ncs, axis=0).max() < 0.999
    np.testing.assert_allclose(residual(spectrum(ncs)), 0, atol=1e-12)


@pytest.mark.slow
def test_a_rotating_analyser_sees_n_and_c_as_they_are(ncs):
    """N = cos 2Ψ and C = sin 2Ψ cos Δ, as from α and β (`data.ellipsometry_angles`), whatever S was."""
    n, c, _ = ncs
    seen = spectrum(np.array([n, c, np.sqrt(1 - n**2 - c**2)]))
    np.testing.assert_allclose(residual(replace(seen, folded=True)), 0, atol=1e-12)
