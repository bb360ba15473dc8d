"""Two layers from one spectrum."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.simulation.spectra import simulate_signal

WAVELENGTH = np.linspace(400.0, 900.0, 192)
NOISE = 0.003


def scene(oxide, nitride, **options) -> pl.Scene:
    layers = [pl.Layer("SiO2", oxide, "oxide"), pl.Layer("Si3N4/Vogt-2.09", nitride, "nitride")]
    return pl.Scene(layers, "Si", **options)


@pytest.mark.slow  # fits of two layers; test_compiled_operations.py has their programs
def test_both_thicknesses_come_out():
    """Through a spectrometer's window, which a stack takes by quadrature."""
    instrument = pl.Instrument(bandwidth=4.0)
    truth = {"oxide.thickness": 350.0, "nitride.thickness": 120.0}
    values = simulate_signal(scene(350.0, 120.0, instrument=instrument), WAVELENGTH, NOISE, 1).values
    spectrum = pl.Spectrum(WAVELENGTH, values, "R", sigma=np.full(WAVELENGTH.size, NOISE))
    free = scene(pl.Free(150, 550), pl.Free(30, 230), instrument=instrument)
    found = pl.fit(spectrum, free)
    assert found.status == "converged"
    for name, value in truth.items():
        assert abs(found[name].value - value) < 4 * found[name].stderr_noise < 1.0
    assert found.plan.on("stack")


@pytest.mark.slow
def test_quadrature_equals_the_series_for_a_layer_split_in_two():
    """Two halves of one layer are a stack; the whole of it is a series. The window must be the same."""
    instrument = pl.Instrument(bandwidth=5.0)
    whole = pl.Scene(pl.Layer("SiO2", 1500.0), "Si", instrument=instrument)
    halves = pl.Scene([pl.Layer("SiO2", 700.0), pl.Layer("SiO2", 800.0)], "Si", instrument=instrument)
    a, b = simulate_signal(whole, WAVELENGTH).clean, simulate_signal(halves, WAVELENGTH).clean
    none = simulate_signal(pl.Scene(pl.Layer("SiO2", 1500.0), "Si"), WAVELENGTH).clean
    # the series takes the amplitudes at the centre of the window, the quadrature across it
    assert np.max(np.abs(a - b)) < 1e-3 < 0.01 < np.max(np.abs(none - b))
