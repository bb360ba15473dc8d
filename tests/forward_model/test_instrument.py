"""The instrument's windows in a model: bandwidth and uneven thickness against brute averages."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.scene.free import insert

from ..films import WAVELENGTH, predict, scene

PLATE = pl.Substrate(1.52, back=1.0)


@pytest.mark.parametrize("which", ["bandwidth", "thickness_spread"])
def test_a_free_window_has_a_finite_slope_at_zero(which):
    thing = scene(thickness=2000.0, instrument=pl.Instrument(**{which: pl.Free(0, 9, start=0.0)}))
    model = build(pl.plan(thing))

    @jax.jit
    def predict(values):
        return model(insert(thing, values))

    slope, curve = jax.jacfwd(predict)(np.zeros(1)), jax.jacfwd(jax.jacfwd(predict))(np.zeros(1))
    np.testing.assert_array_equal(slope, 0)  # even in the width
    assert np.all(np.isfinite(curve))
    assert np.max(np.abs(curve)) > 1e-4
    numeric = (predict(np.array([2.001])) - predict(np.array([1.999]))) / 2e-3
    np.testing.assert_allclose(jax.jacfwd(predict)(np.array([2.0]))[:, 0], numeric, rtol=1e-4, atol=1e-8)


NODES = np.linspace(-8.0, 8.0, 161)
WEIGHTS = np.exp(-0.5 * NODES**2) / np.sum(np.exp(-0.5 * NODES**2))


@pytest.mark.parametrize("layer", [1.46, 2.1 + 0.002j], ids=["transparent", "absorbing"])
@pytest.mark.parametrize("signal", "RT")
def test_uneven_thickness_is_an_average_over_thickness(layer, signal):
    """By orders where the layer is transparent; else by nodes, which know how its damping varies."""
    blurred = predict(scene(layer, angle=30.0, signal=signal, instrument=pl.Instrument(thickness_spread=8.0)))
    function = pl.reflectance if signal == "R" else pl.transmittance
    each = function(WAVELENGTH, 300.0 + 8.0 * NODES[:, None], layer, 3.9 + 0.02j, angle=30.0)
    np.testing.assert_allclose(blurred, WEIGHTS @ each, atol=3e-6)


def test_bandwidth_is_an_average_over_wavelength():
    """With the dispersion of the layer in it, from a catalogue's formula sampled before."""
    layer, sigma = pl.dispersion.Cauchy(2.1, 8e4), 4.0 / 2.3548200450309493
    thing = scene(layer, 1.52, thickness=2000.0, instrument=pl.Instrument(bandwidth=4.0))
    spread = pl.reflectance(WAVELENGTH + sigma * NODES[:, None], 2000.0, layer, 1.52)
    for model_of in (thing, tabulated(thing)):
        assert np.max(np.abs(predict(model_of) - WEIGHTS @ spread)) < 1e-3
    assert np.max(np.abs(predict(tabulated(thing, slope=False)) - WEIGHTS @ spread)) > 2e-3


def test_a_window_under_a_plate():
    """Both faces: the front one, seen from either side, goes through the window."""
    thing = scene(2.1, PLATE, thickness=800.0, instrument=pl.Instrument(thickness_spread=400.0))
    average = predict(thing)  # so uneven that only the mean is left
    reflected = predict(scene(2.1, 1.52, thickness=800.0, instrument=pl.Instrument(thickness_spread=400.0)))
    r = (0.52 / 2.52) ** 2
    truth = reflected + (1 - reflected) ** 2 * r / (1 - reflected * r)
    np.testing.assert_allclose(average, truth, rtol=1e-6)


@pytest.mark.parametrize("layer", [1.46, 2.1 + 2e-5j], ids=["transparent", "absorbing"])
@pytest.mark.parametrize("signal", "RT")
def test_fringes_narrower_than_the_sampling_are_averaged(layer, signal):
    """A quarter of a millimetre, as in figure 5 of the thin conductors paper: the mean over some fringes."""
    thing = scene(layer, thickness=2.5e5, angle=30.0, signal=signal)
    assert "narrower than the sampling" in pl.plan(thing).row("coherence").why
    function = pl.reflectance if signal == "R" else pl.transmittance
    cosine_index = np.sqrt(np.real(layer) ** 2 - np.sin(np.deg2rad(30.0)) ** 2)
    fringes = WAVELENGTH / (2 * cosine_index) * NODES[:, None]
    each = function(WAVELENGTH, 2.5e5 + fringes, layer, 3.9 + 0.02j, angle=30.0)
    np.testing.assert_allclose(predict(thing), WEIGHTS @ each, rtol=2e-6)
