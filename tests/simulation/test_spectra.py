"""Simulated spectra: the signal of the scene, scale and offset, noise of the size and seed asked for."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.simulation.spectra import default_wavelengths, simulate_signal

NM = np.linspace(400.0, 900.0, 128)
FILM = pl.Layer(1.46, pl.Free(10, 1000, start=430.0))


def test_the_signal_of_the_scene():
    made = simulate_signal(pl.Scene(FILM, 3.9 + 0.02j), NM)
    expected = pl.reflectance(NM, 430.0, 1.46, 3.9 + 0.02j)
    np.testing.assert_allclose(made.clean, expected, rtol=1e-12)
    np.testing.assert_array_equal(made.values, made.clean)
    assert not made.plan.on("absorption")


def test_scale_and_offset():
    clean = simulate_signal(pl.Scene(FILM, 3.9), NM).clean
    made = simulate_signal(pl.Scene(FILM, 3.9, instrument=pl.Instrument(2.0, 0.1)), NM).clean
    np.testing.assert_allclose(made, 2 * clean + 0.1)
    free = simulate_signal(pl.Scene(FILM, 3.9, instrument=pl.Instrument("slow", "free")), NM).clean
    np.testing.assert_array_equal(free, clean)


def test_a_shift_of_the_wavelengths_moves_the_indices_too():
    """To first order: what is left is the curvature of the dispersion within 1 nm, here 4e-5 at 400 nm."""
    film, shift = pl.Layer("TiO2", 300.0), pl.Instrument(wavelength_shift=1.0)
    made = simulate_signal(pl.Scene(film, "Si", instrument=shift), NM[::8]).clean
    there = simulate_signal(pl.Scene(film, "Si"), NM[::8] + 1.0).clean
    np.testing.assert_allclose(made, there, atol=1e-4)


def test_noise_and_seed():
    scene = pl.Scene(FILM, 3.9)
    one, same, other = (simulate_signal(scene, NM, 0.01, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.values, same.values)
    np.testing.assert_array_equal(one.clean, other.clean)
    assert np.std(one.values - one.clean) == pytest.approx(0.01, rel=0.2)
    assert abs(np.corrcoef(one.values - one.clean, other.values - other.clean)[0, 1]) < 0.3


def test_a_spectrum_to_fit():
    """With σ and angle as the fit wants them; points of a rising wavelength."""
    light = pl.Light(angle=35.0, signal="T", polarisation="p")
    seen = pl.simulate(pl.Scene(FILM, 1.5, light=light), NM, noise=0.01, seed=1)
    made = simulate_signal(pl.Scene(FILM, 1.5, light=light), NM, 0.01, 1)
    np.testing.assert_array_equal(seen.values, made.values)
    assert (seen.signal, seen.polarisation, set(seen.angle), set(seen.sigma)) == ("T", "p", {35.0}, {0.01})
    assert pl.simulate(pl.Scene(FILM, 3.9), NM).sigma is None


def test_a_spectrum_of_angles():
    light = pl.Light(angle=pl.Free(69, 71, start=70.0), signal="psi-delta")
    seen = pl.simulate(pl.Scene(FILM, 3.9, light=light), NM)
    psi, delta = pl.ellipsometry(NM, 430.0, 1.46, 3.9, angle=70.0)
    np.testing.assert_allclose(seen.values, psi, rtol=1e-9)
    np.testing.assert_allclose(seen.delta, delta, rtol=1e-9)


def test_default_wavelengths_stay_where_every_material_has_data(write):
    np.testing.assert_array_equal(default_wavelengths(pl.Scene(FILM, 3.9)), np.arange(380.0, 781.0, 2.0))
    table = write("wavelength_nm,n\n501,1.6\n601,1.5\n", "resin.csv")
    grid = default_wavelengths(pl.Scene(pl.Layer(str(table), 100.0), "Si"))
    assert (grid[0], grid[-1], len(grid)) == (502, 600, 50)


def test_float64_whatever_the_caller_has():
    with jax.enable_x64(False):
        made = simulate_signal(pl.Scene(FILM, 3.9), NM.astype(np.float32))
    assert made.clean.dtype == np.float64
    nm = NM.astype(np.float32).astype(float)
    np.testing.assert_allclose(made.clean, pl.reflectance(nm, 430.0, 1.46, 3.9))
