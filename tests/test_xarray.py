"""Accessor of xarray objects: the spectrum that a fit gets, and what it refuses."""

import numpy as np
import pytest

from pellicle.errors import UsageError

xarray = pytest.importorskip("xarray")
pytest.importorskip("pellicle.xarray")

NM = np.linspace(400.0, 700.0, 11)


def cube(values, dims=("y", "x", "wavelength"), **coords):
    return xarray.DataArray(values, {"wavelength": ("wavelength", NM, {"units": "nm"}), **coords}, dims, "R")


def test_a_pixel_is_a_spectrum_without_its_gaps():
    values = np.random.default_rng(0).uniform(0.2, 0.8, (3, 4, 11))
    values[1, 2, 5] = np.nan
    spectrum = cube(values).isel(y=1, x=2).pellicle.spectrum(noise=0.01)
    kept = np.arange(11) != 5
    np.testing.assert_allclose(spectrum.wavelength, NM[kept])
    np.testing.assert_allclose(spectrum.values, values[1, 2, kept])
    assert (spectrum.signal, set(spectrum.sigma), spectrum.angle) == ("R", {0.01}, None)


def test_a_dataset_of_angles_has_wavelength_before_angle():
    psi = np.random.default_rng(1).uniform(10, 40, (2, 11))
    angle = {"angle": ("angle", [60.0, 70.0], {"units": "degree"})}
    dataset = (
        cube(psi, ("angle", "wavelength"), **angle)
        .to_dataset(name="psi")
        .assign(delta=100 + 0 * cube(psi, ("angle", "wavelength"), **angle))
    )
    spectrum = dataset.pellicle.spectrum()
    np.testing.assert_allclose(spectrum.angle, np.tile([60.0, 70.0], 11))
    np.testing.assert_allclose(spectrum.values, psi.T.ravel())
    np.testing.assert_allclose(spectrum.delta, 100)


def test_more_than_one_spectrum_is_refused(refuses):
    refuses(UsageError, "along y, x: select one", cube(np.full((2, 2, 11), 0.5)).pellicle.spectrum)
