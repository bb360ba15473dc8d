"""Sweeps of a spectrum, and the correlation of residuals along them."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.sweeps import sweeps

NM = np.linspace(400.0, 800.0, 41)
ANGLES = np.array([20.0, 45.0, 60.0, 70.0])


def rows(*arrays):
    return [np.asarray(x).tolist() for x in arrays]


def test_one_angle_is_one_sweep():
    assert rows(*sweeps(NM, np.zeros(41))) == rows(np.arange(41))
    assert rows(*sweeps(NM[::-1], np.zeros(41))) == rows(np.arange(41))


@pytest.mark.parametrize("interleaved", [True, False])
def test_each_angle_is_a_sweep(interleaved):
    nm, angle = (x.ravel() for x in np.meshgrid(NM, ANGLES, indexing="ij" if interleaved else "xy"))
    result = sweeps(nm, angle)
    assert len(result) == 4
    for part, each in zip(result, ANGLES, strict=True):
        assert (angle[part] == each).all()
        np.testing.assert_array_equal(nm[part], NM)


def test_there_and_back_are_two_sweeps():
    nm = np.concatenate([NM, NM[-2::-1]])
    assert rows(*sweeps(nm, np.zeros(81))) == rows(np.arange(41), np.arange(41, 81))


def test_one_wavelength_is_swept_along_the_angle():
    angle = np.concatenate([np.arange(50.0, 71.0), np.arange(50.0, 71.0)])
    assert rows(*sweeps(np.full(42, 658.0), angle)) == rows(np.arange(21), np.arange(21, 42))


def test_rows_in_no_order_are_one_sorted_sweep():
    nm = np.random.default_rng(0).permutation(NM)
    [part] = sweeps(nm, np.zeros(41))
    np.testing.assert_array_equal(nm[part], NM)


@pytest.mark.parametrize("interleaved", [True, False])
@pytest.mark.slow  # compiles a scene of its own
def test_a_misfit_does_not_hide_between_angles(interleaved):
    """One measurement in two orders: structured residuals of thirteen angles are no noise."""
    angles = np.linspace(0.0, 60.0, 13)
    nm, angle = (x.ravel() for x in np.meshgrid(NM, angles, indexing="ij" if interleaved else "xy"))
    layers = [pl.Layer("SiO2", 300.0), pl.Layer("TiO2", 60.0)]
    truth = np.concatenate(
        [pl.simulate(pl.Scene(layers, "Si", light=pl.Light(angle=a)), NM).values for a in angles]
    )
    values = truth.reshape(13, 41).T.ravel() if interleaved else truth
    values = values + np.random.default_rng(1).normal(0.0, 0.002, values.size)
    fit = pl.fit(
        pl.Spectrum(nm, values, "R", angle=angle), pl.Scene(pl.Layer("SiO2", pl.Free(100, 600)), "Si")
    )
    assert fit.rms > 0.02
    assert fit.status is pl.Status.MISFIT
