"""Tables of fits for pandas and xarray: values, errors, units and coordinates of a fit."""

import numpy as np
import pytest


def test_a_row_for_each_parameter(fit):
    frame = fit.to_dataframe()
    assert list(frame.index) == list(fit.parameters)
    for name, p in fit.parameters.items():
        assert tuple(frame.loc[name, ["value", "stderr", "stderr_noise", "expanded", "unit", "free"]]) == (
            *(p.value, p.stderr, p.stderr_noise, p.expanded, p.unit, p.free),
        )


def test_a_spectrum_lies_along_its_wavelengths(fit):
    made = fit.to_dataset()
    assert made["wavelength"].attrs["units"] == "nm"
    np.testing.assert_array_equal(made["wavelength"], fit.curve.wavelength)
    np.testing.assert_array_equal(made["R"] - made["R_model"], made["R_residual"])
    np.testing.assert_array_equal(made["n_stderr"], fit.curve.n_stderr)
    assert made["R"].dims == made["n"].dims == ("wavelength",)
    lead = fit.free[0]
    assert float(made["value"].sel(parameter=lead.name)) == lead.value
    assert made.attrs["status"] == fit.status


def test_several_angles_are_points(spectroscopic):
    made = spectroscopic.to_dataset()
    assert made["psi"].dims == made["delta"].dims == made["angle"].dims == ("point",)
    assert made["psi"].attrs["units"] == "degree"
    np.testing.assert_array_equal(made["angle"], spectroscopic.spectrum.angle)
    assert np.abs(made["delta_residual"]).max() < 3  # the short way round


def test_netcdf_keeps_a_dataset(fit, tmp_path):
    xarray = pytest.importorskip("xarray")
    fit.to_dataset().to_netcdf(tmp_path / "fit.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "fit.nc", engine="h5netcdf") as kept:
        xarray.testing.assert_allclose(kept.load(), fit.to_dataset())


def test_samples_of_a_brdf_have_no_wavelengths(brdf_fit):
    with pytest.raises(TypeError, match="BRDF samples were fitted"):
        brdf_fit.to_dataset()
