"""`pellicle read` of a cube of spectra."""

import numpy as np
import pytest
import xarray as xr

NM = np.linspace(400.0, 800.0, 9)


@pytest.fixture
def cube():
    """Reflectance that rises along x, with one pixel that was not measured."""
    values = np.full((4, 5, 9), 0.1) * np.arange(1, 6)[:, None] + NM / 1e5
    values[0, 0] = np.nan
    return values


@pytest.fixture
def netcdf(cube, tmp_path):
    coords = {"wavelength": ("wavelength", NM / 1000, {"units": "um"})}
    array = xr.DataArray(cube, dims=("y", "x", "wavelength"), coords=coords, name="R")
    array.to_netcdf(tmp_path / "cube.nc", engine="h5netcdf")
    return tmp_path / "cube.nc"


def test_summary(pellicle, netcdf):
    ran = pellicle("read", netcdf, code=0)
    for words in (
        "y 4, x 5",
        "400 to 800 nm, 9 bands",
        "5 % missing",
        "um, converted to nm",
        "0.304 at 400 nm",
    ):
        assert words in ran.out, ran.out


def test_record(pellicle, netcdf, cube):
    [record] = pellicle("read", netcdf, "--json", "--range", "440:760", "--signal", "R").objects
    assert record["schema"] == "pellicle.cube/1"
    assert record["pixels"] == {"y": 4, "x": 5}
    assert (record["bands"], record["range_nm"]) == (7, [450, 750])
    np.testing.assert_allclose(record["median"]["values"], np.nanmedian(cube, (0, 1))[1:8])
    np.testing.assert_allclose(record["missing"]["values"], 1 / 20)


def test_flags_of_cubes(pellicle, cube, tmp_path):
    np.save(tmp_path / "raw.npy", 100 + 3000 * cube)
    np.save(tmp_path / "white.npy", np.full(9, 3100.0))
    np.save(tmp_path / "dark.npy", np.full(9, 100.0))
    frames = ["--white-frame", tmp_path / "white.npy", "--dark-frame", tmp_path / "dark.npy"]
    given = ["--wavelengths", "400:800:50", "--white-reflectance", "0.5", *frames]
    [record] = pellicle("read", tmp_path / "raw.npy", "--json", *given).objects
    np.testing.assert_allclose(record["median"]["values"], 0.5 * np.nanmedian(cube, (0, 1)))
    pellicle("read", tmp_path / "raw.npy", *given[:2]).refused(3, "looks like counts", "--white-frame")


def test_white_that_is_a_material(pellicle, cube, tmp_path):
    np.save(tmp_path / "raw.npy", 3000 * cube)
    np.save(tmp_path / "white.npy", np.full(9, 3000.0))
    given = ["--wavelengths", "400:800:50", "--white-frame", tmp_path / "white.npy"]
    given += ["--white-reflectance", "99"]
    pellicle("read", tmp_path / "raw.npy", *given).refused(3, "--white-reflectance")
    given[-1] = "1.5+0.0j"  # a glass: 4 % at normal incidence
    [record] = pellicle("read", tmp_path / "raw.npy", "--json", *given).objects
    np.testing.assert_allclose(record["median"]["values"], 0.04 * np.nanmedian(cube, (0, 1)), rtol=1e-6)


def test_flags_that_do_not_apply(pellicle, netcdf, tmp_path):
    pellicle("read", netcdf, "--columns", "wavelength,R").refused(3, "--columns")
    pellicle("read", netcdf, "--out", tmp_path / "out").refused(2, "--out")
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_no_cube(pellicle, tmp_path):
    (tmp_path / "film.csv").write_text("wavelength_nm,R\n400,0.1\n500,0.2\n600,0.3\n")
    pellicle("read", tmp_path / "film.csv", "--mask", "mask.png").refused(3, "is no cube")
    (tmp_path / "bad.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    pellicle("read", tmp_path / "bad.nc").refused(3, "bad.nc")
