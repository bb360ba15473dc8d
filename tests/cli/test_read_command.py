"""`pellicle read`: what is understood of files and cubes, and their conversion."""

import numpy as np
import pytest
import xarray as xr

from pellicle.data.read_spectrum import read_spectrum

WIDE = "Instrument: X-100\nY units: %R\nWavelength (nm),left,right\n" + "".join(
    f"{nm},{20 + nm / 100},{30 + nm / 100}\n" for nm in range(400, 500, 10)
)


def test_every_spectrum_is_described(pellicle, write):
    path = write(WIDE)
    text = pellicle("read", path, code=0).out
    assert text.count(str(path)) == 2
    assert [word for word in ("left", "400 to 490 nm", "X-100", "percent") if word not in text] == []
    [record] = pellicle("read", path, "--spectrum", "right", "--json").objects
    assert (record["name"], record["values"]["values"]) == ("right", [0.34, 0.349])
    assert (record["declared"], record["range_nm"]) == ({"instrument": "X-100"}, [400, 490])


def test_samples_of_a_brdf_are_described(pellicle, write, tmp_path):
    rows = "".join(f"{angle},0,{angle},180,{0.1 + angle / 100:g},0.2,0.3,0.01\n" for angle in (0, 30, 60))
    path = write("theta_i,phi_i,theta_o,phi_o,R,G,B,sigma\n" + rows, "steel.csv")
    text = pellicle("read", path, code=0).out
    for words in ("3 pairs of directions", "0 to 60° from the normal", "0.1 to 0.7 1/sr", "given, 0.01 1/sr"):
        assert words in text
    [found] = pellicle("read", path, "--json", code=0).objects
    assert (found["schema"], found["samples"]) == ("pellicle.brdf/1", 3)
    assert found["values"]["R"] == pytest.approx([0.1, 0.7])
    pellicle("read", path, "--out", tmp_path / "out").refused(2, "--out writes spectra")


@pytest.mark.parametrize(
    ("name", "content", "fault"),
    [
        (
            "a.csv",
            b"theta_i,phi_i,theta_o,phi_o,value\n30,0,30,180,1\n30,0,40,180,-1\n",
            "line 3: value: -1 is",
        ),
        ("a.txt", b"#DIM 4 1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n0 0 0 0 -1\n", "line 3: value: -1 is a BRDF"),
        ("a.binary", np.array([90, 90, 180, 0], "<i4").tobytes(), "is cut short, 16 bytes"),
        ("a.bsdf", b"tensor_file\0" + bytes([1, 0, 1, 0, 0, 0]), "is a damaged tensor file"),
    ],
)
def test_faults_of_a_file_of_a_brdf_are_named(pellicle, tmp_path, name, content, fault):
    (tmp_path / name).write_bytes(content)
    pellicle("read", tmp_path / name).refused(3, fault)


def test_noise_is_the_scatter_of_neighbours(pellicle, write):
    noise = np.random.default_rng(5).normal(0, 0.01, 2000)
    rows = [f"{400 + i / 10},{0.3 + 0.1 * np.sin(i / 300) + x}" for i, x in enumerate(noise)]
    [record] = pellicle("read", write("nm,R\n" + "\n".join(rows)), "--json").objects
    np.testing.assert_allclose(record["noise"]["values"], 0.01, rtol=0.1)


def test_conversion(pellicle, write, tmp_path):
    folder = tmp_path / "converted"
    pellicle("read", write(WIDE), "--out", folder, code=0)
    assert sorted(path.name for path in folder.iterdir()) == [
        *("film-left.csv", "film-left.png", "film-right.csv", "film-right.png")
    ]
    np.testing.assert_allclose(read_spectrum(folder / "film-right.csv").values[0], 0.34, rtol=1e-15)
    assert "is not overwritten" in pellicle("read", write(WIDE), "--out", folder, code=2).err


def test_a_bad_file_does_not_stop_the_others(pellicle, write):
    ran = pellicle("read", write("nothing", "bad.csv"), write(WIDE), "--json", code=3)
    assert [record["schema"] for record in ran.objects] == ["pellicle.error/1"] + ["pellicle.spectrum/1"] * 2
    assert "bad.csv" in ran.err


def test_an_angle_goes_into_the_copy(pellicle, write, tmp_path):
    path = write("nm,psi,delta\n400,20,170\n500,21,160\n600,22,150\n")
    assert pellicle("read", path, "--angle", "70", "--out", tmp_path / "out").code == 0
    copy = tmp_path / "out" / "film.csv"
    assert read_spectrum(copy).angle.tolist() == [70, 70, 70]
    pellicle("read", copy, "--angle", "65").refused(3, "leave --angle out")


def test_wrong_usage(pellicle, write):
    path = write(WIDE)
    assert pellicle("read").code == 2
    assert "csv, netcdf, nexus" in pellicle("read", path, "--to", "xlsx").err
    assert "--dark needs --reference" in pellicle("read", path, "--dark", "dark.csv").err


def test_counts_of_a_sample_beside_those_of_a_reference(pellicle, write):
    text = "Wavelength (nm),Sample,Dark,Reference\n400,110,10,210\n500,60,10,210\n600,60,10,110\n"
    path = write(text)
    assert "--reference-material Si" in pellicle("read", path, "--signal", "R").err
    [record] = pellicle("read", path, "--reference-material", "Si", "--json").objects
    # 0.25 and 0.5 of the reflectance of silicon at 500 and 400 nm, 0.387 and 0.486 (n, k of Green 2008)
    np.testing.assert_allclose(record["values"]["values"], [0.25 * 0.387, 0.5 * 0.486], atol=0.002)


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
    (tmp_path / "glass.csv").write_text("wavelength_nm,n,k\n350,1.5,0\n900,1.5,0\n")
    given[-1] = tmp_path / "glass.csv"
    [again] = pellicle("read", tmp_path / "raw.npy", "--json", *given).objects
    assert again["median"] == record["median"]


def test_flags_that_do_not_apply(pellicle, netcdf, tmp_path):
    pellicle("read", netcdf, "--columns", "wavelength,R").refused(3, "--columns")
    pellicle("read", netcdf, "--out", tmp_path / "out").refused(2, "--out")
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_no_cube(pellicle, tmp_path):
    (tmp_path / "film.csv").write_text("wavelength_nm,R\n400,0.1\n500,0.2\n600,0.3\n")
    pellicle("read", tmp_path / "film.csv", "--mask", "mask.png").refused(3, "is no cube")
    (tmp_path / "bad.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    pellicle("read", tmp_path / "bad.nc").refused(3, "bad.nc")
