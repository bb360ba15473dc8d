"""xarray objects, zarr stores and NetCDF files."""

import numpy as np
import pytest
import xarray as xr
import zarr

from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)


@pytest.fixture
def array(values):
    return xr.DataArray(
        values,
        dims=("y", "x", "wavelength"),
        coords={"wavelength": NM, "y": ("y", np.arange(7) * 0.1, {"units": "mm"})},
        name="R",
    )


@pytest.mark.parametrize(
    "dims", [("y", "x", "wavelength"), ("wavelength", "x", "y"), ("x", "wavelength", "y")]
)
def test_axes_in_any_order(array, same, dims):
    cube = same(array.transpose(*dims))
    assert cube.dims == ("y", "x")
    np.testing.assert_allclose(cube.coords["y"], np.arange(7) * 0.1)
    assert cube.units == {"y": "mm"}


@pytest.mark.parametrize(
    ("name", "y", "x"), [("wl", "row", "col"), ("lambda", "lines", "samples"), ("band", "rows", "columns")]
)
def test_synonyms(array, same, name, y, x):
    renamed = array.rename(wavelength=name, y=y, x=x)
    renamed[name].attrs["units"] = "nm"
    assert same(renamed).dims == ("y", "x")


@pytest.mark.parametrize(
    ("unit", "convert"),
    [
        ("nm", lambda nm: nm),
        ("um", lambda nm: nm / 1000),
        ("µm", lambda nm: nm / 1000),
        ("m", lambda nm: nm * 1e-9),
        ("angstrom", lambda nm: nm * 10),
        ("eV", lambda nm: 1239.841984 / nm),
        ("cm-1", lambda nm: 1e7 / nm),
    ],
)
def test_units_of_the_axis(array, values, unit, convert):
    coordinate = ("wavelength", convert(NM), {"units": unit})
    cube = read_cube(array.assign_coords(wavelength=coordinate))
    np.testing.assert_allclose(cube.wavelength, NM, rtol=1e-9)  # hc is known to 1e-10 here
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), values, rtol=1e-6)
    assert any("wavelength unit" in note for note in cube.notes)


def test_descending_bands_are_sorted(array, same):
    cube = same(array.isel(wavelength=slice(None, None, -1)))
    assert "bands sorted by wavelength" in cube.notes


def test_scalar_and_axis_of_angles(array, values):
    one = read_cube(array.assign_coords(angle=60.0))
    np.testing.assert_array_equal(one.angle, [60.0])
    assert one.points == 9
    two = xr.concat([array, 2 * array], xr.IndexVariable("aoi", [60.0, 70.0]))
    cube = read_cube(two.transpose("aoi", "y", "x", "wavelength"), calibrated=False)
    np.testing.assert_array_equal(cube.angle, [60.0, 70.0])
    pixel = cube.pixels((slice(2, 3), slice(3, 4)))["values"][0]
    expected = np.stack([values[2, 3], 2 * values[2, 3]], axis=-1).reshape(-1)  # wavelength before angle
    np.testing.assert_allclose(pixel, expected, rtol=1e-6)


def test_polarisation_of_the_variable(array):
    assert read_cube(array.assign_attrs(polarization="P")).polarisation == "p"
    assert read_cube(array.to_dataset().assign_attrs(polarisation="s")).polarisation == "s"
    assert read_cube(array.assign_attrs(polarization="unpolarized")).polarisation == "unpolarised"


def test_psi_without_delta(array, refused):
    refused(xr.Dataset({"psi": 20 + 10 * array}), "'psi' alone", "delta", error=DataError)


def test_time_comes_first_and_dates_become_seconds(array, values):
    dates = np.array(["2026-01-01T00:00:00", "2026-01-01T00:00:30"], "M8[ns]")
    series = xr.concat([array, array / 2], xr.IndexVariable("time", dates)).transpose("y", "x", "time", ...)
    cube = read_cube(series)
    assert cube.dims == ("time", "y", "x")
    assert cube.shape == (2, 7, 5)
    np.testing.assert_array_equal(cube.coords["time"], [0.0, 30.0])
    np.testing.assert_allclose(np.asarray(cube.arrays["values"])[1], values / 2, rtol=1e-6)
    assert cube.coarse(2).shape == (2, 3, 2)


def test_psi_and_delta_with_errors(array):
    psi, delta = 20 + 10 * array, 100 * array
    dataset = xr.Dataset({"psi": psi, "delta": delta, "psi_std": psi * 0 + 0.1, "sigma_delta": psi * 0 + 0.2})
    cube = read_cube(dataset)
    assert cube.signal == "psi-delta"
    block = cube.pixels((slice(0, 2), slice(0, 2)))
    assert set(block) == {"values", "delta", "sigma", "delta_sigma"}
    np.testing.assert_allclose(block["sigma"], 0.1, rtol=1e-6)
    np.testing.assert_allclose(block["delta_sigma"], 0.2, rtol=1e-6)
    np.testing.assert_allclose(block["delta"][3], delta.values[1, 1], rtol=1e-6)


def test_an_axis_of_signals(array):
    both = xr.concat([20 + 10 * array, 100 * array], xr.IndexVariable("signal", ["psi", "delta"]))
    cube = read_cube(both.rename("ellipsometry"))
    assert cube.signal == "psi-delta"
    np.testing.assert_allclose(np.asarray(cube.arrays["delta"]), 100 * array.values, rtol=1e-6)


def test_percent_and_its_error(array, values):
    array = (100 * array).assign_attrs(units="%")
    dataset = xr.Dataset({"T": array, "uncertainty": array * 0 + 0.5})
    cube = read_cube(dataset)
    assert cube.signal == "T"
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), values, rtol=1e-5)
    np.testing.assert_allclose(np.asarray(cube.arrays["sigma"]), 0.005, rtol=1e-6)


def test_several_variables_are_asked_for(array, refused, same):
    dataset = xr.Dataset({"before": array, "after": array / 2})
    refused(dataset, "'before', 'after'", "`variable`", error=UsageError)
    refused(dataset, "no variable 'aftr'", "did you mean 'after'", error=UsageError, variable="aftr")
    same(dataset, variable="before")


def test_signal_chooses_among_variables(array, same):
    dataset = xr.Dataset({"R": array, "T": array / 2})
    assert same(dataset, signal="R").signal == "R"


def test_a_curve_of_errors_is_one_for_all_pixels(array):
    curve = xr.DataArray(np.linspace(0.01, 0.02, 9), dims="wavelength")
    cube = read_cube(xr.Dataset({"R": array, "R_sigma": curve}))
    np.testing.assert_allclose(cube.pixels((slice(0, 3), slice(0, 1)))["sigma"][2], curve.values)


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_netcdf(array, same, tmp_path, engine):
    array.to_netcdf(tmp_path / "a.nc", engine=engine)
    assert same(tmp_path / "a.nc").signal == "R"


@pytest.mark.filterwarnings("ignore:Consolidated metadata")  # zarr 3 has no specification of it yet
@pytest.mark.parametrize("consolidated", [False, True])
@pytest.mark.parametrize("version", [2, 3])
def test_zarr(array, same, tmp_path, version, consolidated):
    array.to_dataset().to_zarr(tmp_path / "a.zarr", zarr_format=version, consolidated=consolidated)
    same(tmp_path / "a.zarr")


def test_damaged_zarr(tmp_path, refused):
    (tmp_path / "zarr.json").write_text("{}")
    refused(tmp_path, "zarr.json", "damaged", error=DataError)


def test_zarr_array_with_and_without_names(values, same, tmp_path):
    zarr.create_array(tmp_path / "plain.zarr", data=values)
    same(tmp_path / "plain.zarr", wavelengths=NM)
    names = ["wavelength", "y", "x"]
    zarr.create_array(tmp_path / "named.zarr", data=values.transpose(2, 0, 1), dimension_names=names)
    same(tmp_path / "named.zarr", wavelengths=NM)


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
        (
            lambda a: a.assign_coords(wavelength=("wavelength", NM / 1000, {"units": "nm"})),
            ("0.4 to 0.8 nm", "µm"),
        ),
        (lambda a: a.assign_coords(wavelength=[400.0, 400, *NM[2:]]), ("bands 1 and 2", "400 nm")),
        (lambda a: a.assign_coords(wavelength=[np.nan, *NM[1:]]), ("band 1", "not above zero")),
        (lambda a: a * np.nan, ("only NaN",)),
        (lambda a: a * 0, ("is zero",)),
        (lambda a: a + 0j, ("complex",)),
        (lambda a: a.astype(str), ("no numbers",)),
        (lambda a: 100 * a, ("looks like percent", '`signal_unit="percent"`')),
        (lambda a: 4000 * a, ("looks like counts", "`white_frame`")),
        (lambda a: (4000 * a).astype("u2"), ("counts of a camera (uint16)", "`white_frame`")),
        (lambda a: a.assign_attrs(units="counts"), ("counts of a camera",)),
        (lambda a: -a, ("below zero",)),
    ],
)
def test_refusals(array, refused, change, words):
    refused(change(array), *words, error=(DataError, UsageError))


def test_radians_are_refused(array, refused):
    refused(xr.Dataset({"psi": array, "delta": 3 * array}), "radians", "degrees", error=DataError)


def test_percent_when_asked(array, same):
    same(100 * array, signal_unit="percent")
    same(10000 * array, signal_unit=10000)


def test_absorbance(array, values, same):
    bright = array + 0.1
    same((-np.log10(bright)).assign_attrs(units="absorbance"), expected=bright.values)


def test_uncalibrated_counts_are_taken_as_they_are(array, values):
    cube = read_cube(4000 * array, calibrated=False)
    assert not cube.calibrated
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), 4000 * values, rtol=1e-6)
