"""Random films against the `tmm` package (S. J. Byrnes, arXiv:1603.02720), an independent code."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.forward_model.film_signal import build

from ..by_tmm import films

RNG = np.random.default_rng(20)
COUNT = 60

AMBIENT = RNG.choice([1.0, 1.33, 1.52], COUNT)
LAYER = RNG.uniform(1.2, 4, COUNT) + 1j * RNG.choice([0.0, 1e-3, 0.3, 3.0], COUNT)
SUBSTRATE = RNG.uniform(0.2, 4, COUNT) + 1j * RNG.choice([0.0, 0.02, 4.0], COUNT)
THICKNESS = RNG.uniform(0, 2000, COUNT)
ANGLE = RNG.uniform(0, 89, COUNT)
WAVELENGTH = RNG.uniform(300, 1100, COUNT)

SIGNALS = {"R": pl.reflectance, "T": pl.transmittance}


@pytest.mark.parametrize("letter", "sp")
@pytest.mark.parametrize("signal", SIGNALS)
def test_coherent_films(signal, letter):
    found = SIGNALS[signal](
        WAVELENGTH, THICKNESS, LAYER, SUBSTRATE, ambient=AMBIENT, angle=ANGLE, polarisation=letter
    )
    truth = films(letter, WAVELENGTH, [AMBIENT, LAYER, SUBSTRATE], [THICKNESS], ANGLE, signal)
    np.testing.assert_allclose(found, truth, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("signal", SIGNALS)
def test_unpolarised_is_the_mean(signal):
    found = SIGNALS[signal](550.0, 100.0, 1.46, 3.9 + 0.02j, angle=60.0)
    truth = films("sp", 550.0, [1, 1.46, 3.9 + 0.02j], [100.0], 60.0, signal)
    np.testing.assert_allclose(found, truth, rtol=1e-12)


# film, plate, behind, angle: transparent plates and one that absorbs over its millimetre
PLATES = {
    "oxide on silica": (1.9 + 0j, 1.46 + 0j, 1.0, 0.0),
    "absorbing film": (2.1 + 0.1j, 1.52 + 0j, 1.0, 0.0),
    "oblique": (1.9 + 0j, 1.46 + 0j, 1.0, 55.0),
    "in water": (1.9 + 0.01j, 1.46 + 0j, 1.33, 40.0),
    "absorbing plate": (1.9 + 0j, 1.52 + 2e-5j, 1.0, 30.0),
}


@pytest.mark.parametrize("letter", "sp")
@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("name", PLATES)
def test_plate_with_a_back_face(name, signal, letter):
    layer, glass, back, angle = PLATES[name]
    wavelength = np.linspace(400, 800, 11)
    scene = pl.Scene(
        pl.Layer(layer if layer.imag else layer.real, 180.0),
        pl.Substrate(glass if glass.imag else glass.real, back=back, plate_mm=1.0),
        light=pl.Light(wavelength, angle, signal, letter),
    )
    found = build(pl.plan(scene))(scene)
    truth = films(letter, wavelength, [1, layer, glass, back], [180, 1e6], angle, signal, "icii")
    # an absorbing plate's front face passes the same both ways to (k/n)² = 2e-10
    np.testing.assert_allclose(found, truth, rtol=1e-8 if glass.imag else 1e-11, atol=1e-13)
