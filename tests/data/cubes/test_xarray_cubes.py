"""xarray objects, zarr stores and NetCDF files."""

import numpy as np
import pytest
import xarray as xr

from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

NM = np.linspace(400.0, 800.0, 9)


@pytest.fixture
def array(values):
    coords = {"wavelength": NM, "y": ("y", np.arange(7) * 0.1, {"units": "mm"})}
    return xr.DataArray(values, dims=("y", "x", "wavelength"), coords=coords, name="R")


@pytest.mark.parametrize(
    ("name", "y", "x"), [("wl", "row", "col"), ("lambda", "lines", "samples"), ("band", "rows", "columns")]
)
def test_synonyms_and_descending_bands(array, same, name, y, x):
    renamed = array.rename(wavelength=name, y=y, x=x).isel({name: slice(None, None, -1)})
    renamed[name].attrs["units"] = "nm"
    cube = same(renamed)
    assert cube.dims == ("y", "x")
    assert "bands sorted by wavelength" in cube.notes


@pytest.mark.parametrize(
    ("unit", "convert"),
    [("um", lambda nm: nm / 1000), ("m", lambda nm: nm * 1e-9), ("eV", lambda nm: 1239.841984 / nm)],
)
def test_units_of_the_axis(array, same, unit, convert):
    cube = same(array.assign_coords(wavelength=("wavelength", convert(NM), {"units": unit})))
    assert f"wavelength unit: {unit}, converted to nm" in cube.notes


def test_scalar_and_axis_of_angles(array, values):
    assert_read(read_cube(array.assign_coords(angle=60.0)), points=9, angle=[60.0])
    two = xr.concat([array, 2 * array], xr.IndexVariable("aoi", [60.0, 70.0]))
    cube = read_cube(two.transpose("aoi", "y", "x", "wavelength"), calibrated=False)
    np.testing.assert_array_equal(cube.angle, [60.0, 70.0])
    pixel = cube.pixels((slice(2, 3), slice(3, 4)))["values"][0]
    expected = np.stack([values[2, 3], 2 * values[2, 3]], axis=-1).reshape(-1)  # wavelength before angle
    np.testing.assert_allclose(pixel, expected, rtol=1e-6)


def test_variables_and_what_they_state(array, same, refused):
    assert same(array.assign_attrs(polarization="P")).polarisation == "p"
    assert same(array.to_dataset().assign_attrs(polarisation="s")).polarisation == "s"
    assert same(array.assign_attrs(polarization="unpolarized")).polarisation == "unpolarised"
    assert same(xr.Dataset({"R": array, "T": array / 2}), signal="R").signal == "R"
    dataset = xr.Dataset({"before": array, "after": array / 2})
    same(dataset, variable="before")
    refused(dataset, "'before', 'after'", "`variable`", error=UsageError)
    refused(dataset, "no variable 'aftr'", "did you mean 'after'", error=UsageError, variable="aftr")


def test_scales(array, values, same):
    same(100 * array, signal_unit="percent")
    same(10000 * array, signal_unit=10000)
    percent = (100 * array).assign_attrs(units="%")
    cube = same(xr.Dataset({"T": percent, "uncertainty": percent * 0 + 0.5}))
    assert cube.signal == "T"
    np.testing.assert_allclose(np.asarray(cube.arrays["sigma"]), 0.005, rtol=1e-6)
    bright = array + 0.1
    same((-np.log10(bright)).assign_attrs(units="absorbance"), expected=bright.values)
    assert not same(4000 * array, expected=4000 * values, calibrated=False).calibrated


@pytest.mark.parametrize("form", ["variables", "axis"])
def test_psi_and_delta(array, same, refused, form):
    psi, delta = 20 + 10 * array, 100 * array
    dataset = xr.Dataset({"psi": psi, "delta": delta, "psi_std": psi * 0 + 0.1, "sigma_delta": psi * 0 + 0.2})
    if form == "axis":
        dataset = xr.concat([psi, delta], xr.IndexVariable("signal", ["psi", "delta"])).rename("measured")
    cube = same(dataset, expected=psi.values)
    block = cube.pixels((slice(0, 2), slice(0, 2)))
    assert cube.signal == "psi-delta"
    np.testing.assert_allclose(block["delta"][3], delta.values[1, 1], rtol=1e-6)
    if form == "variables":
        np.testing.assert_allclose([block["sigma"][0], block["delta_sigma"][0]], [[0.1] * 9, [0.2] * 9])
    refused(xr.Dataset({"psi": psi}), "'psi' alone", "delta", error=DataError)
    refused(xr.Dataset({"psi": array, "delta": 3 * array}), "radians", "degrees", error=DataError)


def test_time_comes_first_and_dates_become_seconds(array, values):
    dates = np.array(["2026-01-01T00:00:00", "2026-01-01T00:00:30"], "M8[ns]")
    series = xr.concat([array, array / 2], xr.IndexVariable("time", dates)).transpose("y", "x", "time", ...)
    cube = read_cube(series)
    assert_read(cube, dims=("time", "y", "x"), shape=(2, 7, 5))
    np.testing.assert_array_equal(cube.coords["time"], [0.0, 30.0])
    np.testing.assert_allclose(np.asarray(cube.arrays["values"])[1], values / 2, rtol=1e-6)
    assert cube.coarse(2).shape == (2, 3, 2)


def test_a_curve_of_errors_is_one_for_all_pixels(array):
    curve = xr.DataArray(np.linspace(0.01, 0.02, 9), dims="wavelength")
    cube = read_cube(xr.Dataset({"R": array, "R_sigma": curve}))
    np.testing.assert_allclose(cube.pixels((slice(0, 3), slice(0, 1)))["sigma"][2], curve.values)


def test_scale_factor_and_fill_value_of_netcdf(array, values, tmp_path):
    packed = {"R": {"dtype": "i2", "scale_factor": 1e-4, "_FillValue": -1}}
    array.where(array > 0.1).to_netcdf(tmp_path / "packed.nc", engine="h5netcdf", encoding=packed)
    read = np.asarray(read_cube(tmp_path / "packed.nc").arrays["values"])
    np.testing.assert_array_equal(np.isnan(read), values <= 0.1)
    np.testing.assert_allclose(read[values > 0.1], values[values > 0.1], atol=1e-4)


def test_dask_blocks_are_computed_only_when_read(array):
    computed = []

    def count(block):
        computed.append(block.shape)
        return block

    wide = xr.concat([array] * 60, "y")  # 420 rows, above nothing but a sample is read
    wide = wide.reset_coords(drop=True).chunk({"y": 7})
    lazy = wide.copy(data=wide.data.map_blocks(count, meta=np.zeros((0, 0, 0), "f4")))
    cube = read_cube(lazy.isel(x=[0] * 500))  # 1.9 million values
    sampled = len(computed)
    assert 0 < sampled <= 2 * 25 * 2  # the check and the fingerprint: 25 blocks of 8 rows, in two chunks each
    computed.clear()
    cube.pixels((slice(12, 16), slice(0, 5)))
    assert len(computed) == 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: a.rename(wavelength="height"), ("no axis of wavelength", "y 7", "x 5")),
        (lambda a: a.rename(x="lat"), ("'lat'", "rename")),
        (lambda a: a.isel(y=0, x=0, drop=True), ("no axis of pixels", "wavelength 9")),
        (lambda a: a.drop_vars("wavelength"), ("no wavelengths", "`wavelengths`")),
        (lambda a: a.assign_coords(wavelength=NM / 1000), ("0.4 to 0.8", "µm", "`wavelength_unit`")),
        (lambda a: a.assign_coords(wavelength=NM * 1000), ("400000 to 800000", "`wavelength_unit`")),
        (lambda a: a.assign_coords(wavelength=("wavelength", NM, {"units": "parsec"})), ("'parsec'",)),
        (lambda a: a.assign_coords(wavelength=("wavelength", NM / 1000, {"units": "nm"})), ("0.8 nm", "µm")),
        (lambda a: a.assign_coords(wavelength=[400.0, 400, *NM[2:]]), ("bands 1 and 2", "400 nm")),
        (lambda a: a.assign_coords(wavelength=[np.nan, *NM[1:]]), ("band 1", "not above zero")),
        (lambda a: a * np.nan, ("only NaN",)),
        (lambda a: a * 0, ("is zero",)),
        (lambda a: a + 0j, ("complex",)),
        (lambda a: a.astype(str), ("no numbers",)),
        (lambda a: 100 * a, ("looks like percent", '`signal_unit="percent"`')),
        (lambda a: (4000 * a).astype("u2"), ("counts of a camera (uint16)", "`white_frame`")),
        (lambda a: a.assign_attrs(units="counts"), ("counts of a camera",)),
        (lambda a: -a, ("below zero",)),
    ],
)
def test_refusals(array, refused, change, words):
    refused(change(array), *words, error=(DataError, UsageError))
