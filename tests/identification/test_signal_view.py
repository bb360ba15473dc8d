"""The program of many structures, against the package tmm."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.identification.problem import Metric, Problem
from pellicle.identification.signal_view import SLOTS, SignalView, compared_points
from tests import by_tmm

NM = np.linspace(400, 900, 40)
SLOPE = np.linspace(0, 1, 40)
UPPER, LOWER, BELOW = 1.5 - 0.02 * SLOPE, 2.1 - 0.1 * SLOPE + 0.05j, 3.8 - 0.2 * SLOPE + 0.02j
DEPTHS = 80.0, 150.0


def view(signal, angle, substrate, back=None):
    below = pl.Substrate(substrate, back=back)
    light = pl.Light(angle=angle)
    more = {"delta": np.full(40, 90.0)} if signal == "psi-delta" else {}
    spectrum = pl.Spectrum(NM, np.full(40, 0.3), signal, **more)
    return SignalView(spectrum, pl.Scene(pl.Layer(1.46, 0.0), below, light=light))


def slots(own):
    """Two structures: the two layers, and the lower one alone."""
    size = own.wavelength.size
    index = np.ones((2, SLOTS, size), complex)
    index[:, -2, :40], index[:, -1, :40] = UPPER, LOWER
    depth = np.zeros((2, SLOTS))
    depth[:, -2:] = DEPTHS, (0.0, DEPTHS[1])
    return index, depth


@pytest.mark.parametrize(("signal", "angle"), [("R", 0.0), ("R", 50.0), ("T", 0.0), ("psi-delta", 65.0)])
def test_two_structures_in_slots(signal, angle):
    own = view(signal, angle, 3.7 + 0.02j if signal != "T" else 1.52)
    substrate = own.media[1, :40]
    found = own.simulate(*slots(own))
    for row, depths in zip(found, (DEPTHS, (0.0, DEPTHS[1])), strict=True):
        indices = 1.0, UPPER, LOWER, substrate
        if signal == "psi-delta":
            expected = by_tmm.ncs(NM, indices, depths, angle).ravel()
        else:
            expected = by_tmm.films("sp", NM, indices, depths, angle, signal)
        np.testing.assert_allclose(row, expected, atol=1e-10)
    layers = slots(own)[0][0, -2:]
    grid = own.simulate_grid(layers, np.array([10.0, DEPTHS[0]]), np.array([20.0, DEPTHS[1], 300.0]))
    np.testing.assert_allclose(grid[4], found[0], atol=1e-10)
    assert grid.shape[0] == 6


@pytest.mark.parametrize("signal", ["R", "T"])
def test_a_plate_adds_the_light_from_its_back(signal):
    own = view(signal, 0.0, 1.52, back=1.0)
    found = own.simulate(*slots(own))[0]
    indices = 1.0, UPPER, LOWER, 1.52, 1.0
    expected = by_tmm.films("s", NM, indices, (*DEPTHS, 1e6), 0.0, signal, coherence="iccii")
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_neighbours_are_averaged_where_fringes_allow_it():
    spectrum = pl.Spectrum(np.linspace(400, 900, 1000), np.linspace(0.2, 0.4, 1000), "R")
    few = compared_points(spectrum, 2000.0)
    assert 100 < len(few) <= 160
    np.testing.assert_allclose(few.values, np.interp(few.wavelength, spectrum.wavelength, spectrum.values))
    assert len(compared_points(spectrum, 60_000.0)) > 300


def test_a_measured_depolarisation_is_left_out():
    light = pl.Light(angle=65.0, signal="psi-delta")
    window = pl.Scene(pl.Layer(2.1, 180.0), pl.Substrate("BK7", back="air"), light=light)
    measured = pl.simulate(window, NM)
    assert measured.depolarisation is not None
    problem = Problem((SignalView(compared_points(measured, 2000.0), window),), 3000.0)
    assert {x.change.size for x in problem.instrument} == {3 * NM.size}


def test_a_metric_is_the_inverse_of_noise_and_columns():
    rng = np.random.default_rng(0)
    sigma, columns = rng.uniform(0.5, 2.0, 30), rng.normal(size=(30, 4))
    inverse = np.linalg.inv(np.diag(sigma**2) + columns @ columns.T)
    a, b = rng.normal(size=(30, 3)), rng.normal(size=(30, 2))
    metric = Metric(sigma, columns)
    np.testing.assert_allclose(metric.costs(a.T), np.diag(a.T @ inverse @ a), rtol=1e-9)
    normal, gradient = metric.grams(a.T[None], b[None, :, 0])
    np.testing.assert_allclose(normal[0], a.T @ inverse @ a, rtol=1e-9)
    np.testing.assert_allclose(gradient[0], a.T @ inverse @ b[:, 0], rtol=1e-9)
