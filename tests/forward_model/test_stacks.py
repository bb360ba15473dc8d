"""Stacks in full, against independent codes: plates, uneven layers, interfaces, windows of instruments."""

import math

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.effective_medium import Bruggeman
from pellicle.dispersion.empirical import Cauchy
from pellicle.fitting.film.parameters import parameters
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.scene.free import insert
from pellicle.scene.layers import medium

from ..by_tmm import films
from ..differences import derivative, jacobian
from ..films import NODES, WAVELENGTH, WEIGHTS, predict, scene

reflected_at = jax.jit(pl.reflectance, static_argnames="polarisation")


# plates anywhere

BELOW = [pl.Layer(1.38, 120.0), pl.Layer(2.3, 60.0)]
SANDWICH = [pl.Layer(2.1 + 0.01j, 80.0), pl.Plate(1.52 + 1e-7j, 2.0), *BELOW]


@pytest.mark.slow
@pytest.mark.parametrize("signal", "RT")
@pytest.mark.parametrize(("angle", "polarisation"), [(0.0, "s"), (50.0, "s"), (50.0, "p")])
def test_layers_on_both_faces_of_a_plate(signal, angle, polarisation):
    thing = scene(SANDWICH, 1.33, signal=signal, angle=angle, polarisation=polarisation)
    indices, depths = [1, 2.1 + 0.01j, 1.52 + 1e-7j, 1.38, 2.3, 1.33], [80, 2e6, 120, 60]
    truth = films(polarisation, WAVELENGTH, indices, depths, angle, signal, "icicci")
    # what tmm takes as the coherent part's transmittance both ways differs by k/n of the plate
    np.testing.assert_allclose(predict(thing), truth, atol=1e-9)


def test_two_plates_and_an_air_gap():
    """A double-glazed window of bare panes: every face reflects r, and intensities add."""
    thing = scene([pl.Plate(1.5), pl.Plate(1.0), pl.Plate(1.5)], 1.0, signal="T")
    r = 0.04
    pane = (1 - r) / (1 + r)
    back = 2 * r / (1 + r)
    np.testing.assert_allclose(predict(thing), pane**2 / (1 - back**2), rtol=1e-12)


# uneven layers


def test_each_layer_of_a_stack_is_uneven_by_itself():
    layers = [pl.Layer(1.46, 300.0), pl.Layer(2.1 + 0.05j, 150.0, thickness_spread=12.0)]
    each = [predict(scene([layers[0], pl.Layer(2.1 + 0.05j, 150.0 + 12.0 * x)])) for x in NODES[::4]]
    weights = WEIGHTS[::4] / np.sum(WEIGHTS[::4])
    plain = predict(scene([layers[0], pl.Layer(2.1 + 0.05j, 150.0)]))
    np.testing.assert_allclose(predict(scene(layers)), weights @ each, atol=1e-9)
    assert np.max(np.abs(plain - weights @ each)) > 1e-3


# interfaces


def parratt(indices, depths, sigmas, angle, wavelength, polarisation):
    """|r|² by Parratt's recursion with Névot and Croce's factors: no matrix anywhere."""
    k = 2 * np.pi / wavelength
    n = np.asarray(indices, dtype=complex)
    q = np.sqrt(n**2 - (n[0] * np.sin(angle)) ** 2 + 0j)
    q = np.where(q.imag < 0, -q, q)
    y = q if polarisation == "s" else q / n**2
    total = 0.0
    for j in range(len(n) - 2, -1, -1):
        r = (y[j] - y[j + 1]) / (y[j] + y[j + 1]) * np.exp(-2 * k**2 * q[j] * q[j + 1] * sigmas[j] ** 2)
        echo = total * np.exp(2j * k * q[j + 1] * depths[j + 1])
        total = (r + echo) / (1 + r * echo)
    return np.abs(total) ** 2


@pytest.mark.parametrize("polarisation", "sp")
@pytest.mark.parametrize("angle", [1e-6, 40.0, 75.0])
def test_rough_faces_are_parratts_recursion(polarisation, angle):
    layers = [pl.Layer(1.46, 300.0, roughness=4.0), pl.Layer(2.1 + 0.3j, 40.0, roughness=7.0)]
    thing = scene(layers, pl.Substrate(0.2 + 3.4j, roughness=2.0), angle=angle, polarisation=polarisation)
    indices, depths = [1, 1.46, 2.1 + 0.3j, 0.2 + 3.4j], [0, 300, 40, 0]
    truth = [parratt(indices, depths, [4, 7, 2], np.deg2rad(angle), w, polarisation) for w in WAVELENGTH]
    np.testing.assert_allclose(predict(thing), truth, rtol=1e-11)


def test_small_roughness_is_a_graded_interface():
    """An error function's profile, in 200 slices, has the reflectance that the damping promises."""
    sigma, w = 6.0, WAVELENGTH
    z = (np.arange(200) + 0.5) / 200 * 48.0 - 24.0
    share = np.array([0.5 * (1 + math.erf(x / sigma / math.sqrt(2))) for x in z])
    slices = list(np.sqrt(1 + share * (1.5**2 - 1)))
    rough = predict(scene(pl.Layer(1.5, 0.0, roughness=sigma), 1.5))
    loss = 0.04 - films("s", w, [1, *slices, 1.5], [0.24] * 200)
    np.testing.assert_allclose(0.04 - rough, loss, rtol=0.03)  # the second order is left out
    passed = predict(scene(pl.Layer(1.5, 0.0, roughness=sigma), 1.5, signal="T"))
    # R + T is 1 but for the square of what the roughness takes away
    assert np.max(np.abs(rough + passed - 1)) < (2 * np.pi / w[0] * sigma * 1.5) ** 4


def test_an_interface_is_a_mixed_layer():
    """One slice is the familiar half and half; many are a graded profile."""
    rough = scene([pl.Interface(8.0), pl.Layer(2.1, 100.0)])
    mixed = scene([pl.Layer(Bruggeman(medium(1.0), medium(2.1), 0.5), 8.0), pl.Layer(2.1, 100.0)])
    np.testing.assert_allclose(predict(rough), predict(mixed), rtol=1e-13)


def test_a_fraction_is_the_share_of_the_medium_below_whose_numbers_are_free_once():
    film = Cauchy(pl.Free(1.9, 2.3, start=2.1), 0.0)
    porous = scene([pl.Interface(80.0, fraction=0.7), pl.Layer(film, 100.0)])
    mixed = scene([pl.Layer(Bruggeman(medium(1.0), medium(2.1), 0.7), 80.0), pl.Layer(2.1, 100.0)])
    np.testing.assert_allclose(predict(insert(porous, [2.1])), predict(mixed), rtol=1e-13)
    free = scene([pl.Interface(80.0, fraction=pl.Free(0, 1), name="top"), pl.Layer(film, 100.0, name="film")])
    assert [p.name for p in parameters(free)] == ["top.fraction", "film.A"]


def test_a_graded_interface_converges():
    def reflected(steps):
        return predict(scene([pl.Interface(200.0, steps=steps, mix="linear"), pl.Layer(2.1, 0.0)], 2.1))

    share = (np.arange(400) + 0.5) / 400
    slices = list(np.sqrt(1 + share * (2.1**2 - 1)))
    truth = films("s", WAVELENGTH, [1, *slices, 2.1], [0.5] * 400)
    assert np.max(np.abs(reflected(40) - truth)) < 2e-4
    assert np.max(np.abs(reflected(40) - truth)) < 0.2 * np.max(np.abs(reflected(8) - truth))


# the light's cone


def test_a_cone_at_normal_incidence_is_an_average_over_the_pupil():
    thing = scene(pl.Layer(1.46, 1500.0), instrument=pl.Instrument(numerical_aperture=0.5))
    rho = (np.arange(2000) + 0.5) / 2000 * 0.5
    each = reflected_at(WAVELENGTH, 1500.0, 1.46, 3.9 + 0.02j, angle=np.rad2deg(np.arcsin(rho))[:, None])
    truth = np.average(each, axis=0, weights=rho)
    row = pl.plan(thing).row("angle-spread")
    assert row.error_bound < 1e-6
    np.testing.assert_allclose(predict(thing), truth, atol=1e-6)
    assert np.max(np.abs(predict(scene(pl.Layer(1.46, 1500.0))) - truth)) > 0.05


@pytest.mark.parametrize("angle", [0.0, pytest.param(40.0, marks=pytest.mark.slow)])
def test_a_free_cone_has_a_finite_slope_at_zero(angle):
    free = pl.Instrument(angle_spread=pl.Free(0, 15, start=0.0))
    thing = scene(pl.Layer(1.46, 900.0), angle=angle, instrument=free)
    model = build(pl.plan(thing))
    predict = jax.jit(lambda x: model(insert(thing, [x])))
    slope = jax.jacfwd(predict)
    assert np.max(np.abs(slope(0.0))) < 1e-10  # even in the half angle
    np.testing.assert_allclose(slope(6.0), derivative(predict, 6.0, 1e-3), rtol=1e-5, atol=1e-9)


REFUSED = [
    (lambda: pl.Instrument(angle_spread=5, numerical_aperture=0.1), "not both"),
    (
        lambda: scene(pl.Layer(1.5, 1), angle=88.0, instrument=pl.Instrument(angle_spread=5)),
        "beyond 90 degrees",
    ),
    (
        lambda: scene(pl.Layer(1.5, 1), instrument=pl.Instrument(numerical_aperture=1.4)),
        "numerical_aperture.*must be below 1$",
    ),
    (lambda: scene([pl.Interface(1.0), pl.Interface(2.0)]), "two interfaces are adjacent"),
    (lambda: pl.Interface(1.0, steps=0), "1 to 100 steps"),
    (lambda: pl.Interface(1.0, mix="brugeman"), "no mix 'brugeman'"),
    (lambda: pl.Interface(1.0, fraction=1.5), "fraction must lie in 0 to 1"),
    (lambda: pl.Interface(1.0, fraction=pl.Free(-0.1, 1)), "fraction must lie in 0 to 1"),
    (lambda: pl.Interface(1.0, steps=5, fraction=0.5), "goes with one step"),
    (lambda: pl.Layer(1.5, 1.0, roughness=-1), "roughness` must not be negative, got -1 nm"),
]


@pytest.mark.parametrize(("make", "message"), REFUSED)
def test_what_makes_no_sense_is_refused(make, message, refuses):
    refuses(ValueError, message, make)


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
    at = np.array([2.0])
    numeric = jacobian(predict, at, 1e-3)
    np.testing.assert_allclose(jax.jacfwd(predict)(at), numeric, rtol=1e-4, atol=1e-8)


@pytest.mark.parametrize("layer", [1.46, 2.1 + 0.002j], ids=["transparent", "absorbing"])
@pytest.mark.parametrize("signal", ["R", pytest.param("T", marks=pytest.mark.slow)])
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
