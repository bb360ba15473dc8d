"""`pellicle map`: strips and photographs of a wedge; a cube, its folder and its interruption."""

import html
import json
import os
import re
import signal
from typing import Any

import numpy as np
import pytest
import xarray
from PIL import Image

import pellicle as pl
from pellicle.colour import linear_srgb, sensor, srgb
from pellicle.fitting.batch.data import CODES, NO_DATA, ORDERS, BatchFits
from pellicle.reporting.map_figures import figures
from tests.film_recipes import film_recipe

LAYER = "material = 1.46\nthickness = { lower = 20, upper = 200 }"


@pytest.fixture
def recipe(write):
    def recipe(signal="srgb", more=""):
        return write(film_recipe(f'signal = "{signal}"', LAYER, substrate="3.9", end=more), "film.toml")

    return recipe


THICKNESS = np.linspace(30.0, 190.0, 60)


@pytest.fixture(scope="module")
def colours():
    """Colours of a wedge in linear sRGB, by way of the reflectance at steps of 1 nm."""

    eye = sensor()
    spectra = pl.reflectance(eye.wavelength, THICKNESS[:, None], 1.46, 3.9)
    return np.asarray(linear_srgb(np.asarray(spectra) @ eye.weights, eye.white))


def photo(path, linear, gamma=None):
    coded = linear ** (1 / gamma) if gamma else np.asarray(srgb(linear))
    pixels = np.round(255 * np.clip(coded, 0, 1)).astype(np.uint8)
    Image.fromarray(np.broadcast_to(pixels, (12, len(linear), 3))).save(path)
    return path


def test_a_strip_across_a_wedge(pellicle, recipe, colours, tmp_path):
    path = photo(tmp_path / "wedge.png", colours)
    words = ("map", path, "--recipe", recipe(), "--strip", "0,6,59,6")
    [record] = pellicle(*words, "--out", tmp_path / "out", "--json", code=0).objects
    assert record["strip"] == "0,6,59,6"
    assert "nm in the median (noise and camera)" in (tmp_path / "out" / "report.txt").read_text()
    np.testing.assert_allclose(record["positions"]["thickness"], THICKNESS, atol=4)
    assert record["converged"] > 0.9
    assert json.loads((tmp_path / "out" / "result.json").read_text())["schema"] == "pellicle.map/1"
    header, first, *_ = (tmp_path / "out" / "strip.csv").read_text().splitlines()
    row = dict(zip(header.split(","), first.split(","), strict=True))
    assert float(row["thickness_nm"]) == pytest.approx(THICKNESS[0], abs=4)
    assert (tmp_path / "out" / "map.png").stat().st_size > 5000


def test_a_strip_says_which_free_numbers_it_keeps(pellicle, write, colours, tmp_path):
    layer = LAYER.replace("1.46", '{ model = "constant", n = { lower = 1.4, upper = 1.5 } }')
    recipe = write(film_recipe('signal = "srgb"', layer, substrate="3.9"), "film.toml")
    ran = pellicle("map", photo(tmp_path / "wedge.png", colours), "--recipe", recipe, "--strip", "0,6,9,6")
    assert "each colour gives thickness alone, kept are n = 1.45" in " ".join(ran.out.split())


@pytest.mark.slow
def test_a_map_in_python_with_a_white_and_a_free_exposure(colours, tmp_path):
    """A photograph at 0.6 of the exposure, beside a white of 0.6."""
    linear = np.vstack([0.6 * colours, np.full((8, 3), 0.6)])
    path = photo(tmp_path / "dim.png", linear)
    scene = pl.Scene(pl.Layer(1.46, pl.Free(20, 200)), 3.9)
    made = pl.map(path, scene, region="0,0,60,4", white="61,2,6,8")
    assert made.found.thickness.shape[:2] == (4, 60)
    np.testing.assert_allclose(made.found.thickness[0, :, 0], THICKNESS, atol=5)
    free = pl.Scene(pl.Layer(1.46, pl.Free(20, 200)), 3.9, instrument=pl.Instrument(scale="free"))
    alone = pl.map(path, free, strip=[0, 5, 59, 5])
    sure = alone.found.probability[:, 0] > 0.9
    assert sure.mean() > 0.5
    np.testing.assert_allclose(alone.found.thickness[sure, 0], THICKNESS[sure], atol=8)
    np.testing.assert_allclose(np.median(alone.found.exposure[sure, 0]), 0.6, atol=0.05)


@pytest.mark.slow  # another map; tests/data has the gamma
def test_neighbours_choose_the_order_along_a_strip(pellicle, write, colours, tmp_path):
    """A red that is 4 % too bright and 1 % of flare leave most colours two thicknesses, or a wrong one."""
    random = np.random.default_rng(2)
    linear = colours * [1.04, 1.0, 1.0] + 0.01
    path = photo(tmp_path / "wedge.png", np.clip(linear + random.normal(0, 0.004, linear.shape), 0, 1))
    layer = "material = 1.46\nthickness = { lower = 20, upper = 800 }"
    film = write(film_recipe('signal = "srgb"', layer, substrate="3.9"), "film.toml")
    undecided = []
    for more in ([], ["--neighbours"]):
        words = ("map", path, "--recipe", film, "--strip", "0,6,59,6", "--json", *more)
        [record] = pellicle(*words).objects
        off = np.abs(np.array(record["positions"]["thickness"]) - THICKNESS)
        states = np.array(record["positions"]["status"])
        assert not np.any((off > 20) & (states != "ambiguous"))
        undecided.append(np.sum(states == "ambiguous"))
    assert undecided[0] > 20 + undecided[1]
    assert np.sum(states == "by-neighbours") > 20


def test_channels_with_a_gamma(pellicle, recipe, colours, tmp_path):
    path = photo(tmp_path / "raw.png", np.maximum(colours, 0), gamma=2.0)
    file = recipe("rgb", "[camera]\ngamma = 2.0")
    ran = pellicle("map", path, "--recipe", file, "--strip", "0,6,59,6", "--json")
    [record] = ran.objects
    best = np.array(record["positions"]["thickness"])
    assert np.median(np.abs(best - THICKNESS)) < 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--strip", "0,6,90,6"), "--strip is not in its 60 by 12 pixels"),
        (("--strip", "0,6,9,6", "--region", "1,1,2,2"), "exclude each other"),
        (("--region", "1,1,2,2;3,3,2,2"), "one rectangle"),
        (("--chart", "c.csv"), "--chart"),
        (("--signal", "lab"), "srgb or rgb"),
        (("--noise", "0"), "--noise must be a standard deviation above zero"),
    ],
)
def test_errors_name_flags(pellicle, recipe, colours, tmp_path, words, message):
    path = photo(tmp_path / "wedge.png", colours)
    ran = pellicle("map", path, "--recipe", recipe(), *words)
    assert ran.code in (2, 3)
    assert message in ran.err


@pytest.mark.parametrize(
    ("name", "message"),
    [("gone.png", "gone.png: no such file"), ("text.png", "no photograph (PNG, JPEG, TIFF)")],
)
def test_what_is_no_photograph_is_said_before_its_signal(pellicle, recipe, tmp_path, name, message):
    (tmp_path / "text.png").write_text("no image")
    ran = pellicle("map", tmp_path / name, "--recipe", recipe(), code=3)
    assert message in ran.err


def fitted(model, cube, where):
    """A made-up fit: 100 nm for each unit of the first band."""
    values = cube.pixels(where)["values"][:, :1]
    status = np.where(np.isfinite(values[:, 0]), CODES["converged"], CODES[NO_DATA]).astype(np.uint8)
    minima = np.full((len(values), ORDERS, 1), np.nan)
    minima[:, 0] = 100 * values
    delta = np.full((len(values), ORDERS), np.inf)
    delta[:, 0] = 0
    one = np.ones(len(values))
    return BatchFits(100 * values, values, values, status, minima, delta, one, one)


@pytest.fixture
def fits(monkeypatch):
    """Replaces the fit of a block; no figures are drawn."""

    def fits(fit=fitted):
        monkeypatch.setattr("pellicle.mapping.run.fit_pixels", fit)

    monkeypatch.setattr("pellicle.reporting.map_figures.figures", lambda made, summary: [])
    monkeypatch.setattr("pellicle.mapping.run.bands_off", lambda model, cube: [])
    fits()
    return fits


@pytest.fixture
def words(tmp_path, monkeypatch, scene_recipe):
    """The arguments that map a cube of 24 x 20 pixels in 9 blocks into the folder `out`."""
    monkeypatch.setattr("pellicle.mapping.store.PIXELS", 100)
    nm = np.linspace(400.0, 700.0, 30)
    values = np.random.default_rng(0).uniform(0.2, 0.8, (24, 20, 30))
    values[0, 0] = np.nan
    axis = ("wavelength", nm, {"units": "nm"})
    cube = xarray.DataArray(values, {"wavelength": axis}, ("y", "x", "wavelength"))
    cube.to_dataset(name="R").to_netcdf(tmp_path / "wafer.nc")
    return "map", tmp_path / "wafer.nc", "--recipe", scene_recipe(), "--out", tmp_path / "out"


@pytest.fixture
def photograph(tmp_path):
    Image.fromarray(np.full((8, 8, 3), 99, np.uint8)).save(tmp_path / "film.png")
    return "map", tmp_path / "film.png", "--recipe", tmp_path / "film.toml"


def test_the_folder_of_a_map(pellicle, words, fits, tmp_path, monkeypatch):
    monkeypatch.setattr("pellicle.reporting.map_figures.figures", figures)
    [record] = pellicle(*words, "--json", code=0).objects
    assert record["status"] == {"converged": 479, "no-data": 1}
    assert record == json.loads((tmp_path / "out/result.json").read_text())
    assert "converged" in (tmp_path / "out/report.txt").read_text()
    assert (tmp_path / "out/map.png").stat().st_size > 20_000
    wafer, made = tmp_path / "wafer.nc", tmp_path / "out/map.nc"
    with xarray.open_dataset(wafer) as cube, xarray.open_dataset(made) as map:
        np.testing.assert_allclose(map.thickness, 100 * cube.R[..., 0])
        assert map.attrs["recipe"] == words[3].read_text()
    assert xarray.open_zarr(tmp_path / "out/map.zarr").status.shape == (24, 20)
    page = html.unescape((tmp_path / "out/report.html").read_text("utf-8"))
    [program] = re.findall(r"import pellicle as pl.*?print\(result\)", page, re.DOTALL)
    names: dict[str, Any] = {}
    exec(program, names)
    np.testing.assert_array_equal(names["result"].dataset.thickness, map.thickness)


@pytest.mark.slow
def test_the_same_command_goes_on_after_ctrl_c(pellicle, words, fits, tmp_path):
    blocks = []

    def interrupted(model, cube, where):
        blocks.append(where)
        if len(blocks) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return fitted(model, cube, where)

    fits(interrupted)
    ran = pellicle(*words)
    assert (ran.code, ran.out) == (130, "")
    assert "interrupted after" in ran.err
    assert f"they are kept in {tmp_path / 'out'}, and the same command goes on" in ran.err
    ran = pellicle(*words, code=0)
    assert "pixels are from an earlier run" in ran.err
    assert len(blocks) in (9, 10)  # 2 or 3 were in the store
    assert pellicle(*words).code == 0
    assert len(blocks) in (9, 10)


def test_undecided_pixels_have_their_exit_code(pellicle, words, fits):
    def ambiguous(model, cube, where):
        found = fitted(model, cube, where)
        return found._replace(status=np.full_like(found.status, CODES["ambiguous"]))

    fits(ambiguous)
    assert pellicle(*words).code == 4


def test_a_preview_has_its_own_folder(pellicle, words, fits, tmp_path, monkeypatch):
    monkeypatch.setattr("pellicle.mapping.run.PREVIEW", 30)
    [record] = pellicle(*words, "--preview", "--json").objects
    assert record["data"]["shape"] == {"y": 6, "x": 5}
    assert record["preview"] == 4
    assert not (tmp_path / "out").exists()
    assert (tmp_path / "out-preview/map.nc").is_file()


def test_a_folder_of_the_user_stays(pellicle, words, fits, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/notes.txt").write_text("mine")
    pellicle(*words).refused(2, "did not write")
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["notes.txt"]


def test_without_a_folder_nothing_is_written(pellicle, words, fits, tmp_path):
    before = {*tmp_path.iterdir()}
    assert pellicle(*words[:-2], "--json").code == 0
    assert {*tmp_path.iterdir()} == before


def test_flags_of_the_other_kind_are_refused(pellicle, words, photograph):
    pellicle(*words, "--strip", "0,0,5,5").refused(2, "is a cube", "--strip")
    pellicle(*words, "--sensitivities", "a.csv").refused(2, "is a cube", "--sensitivities")
    pellicle(*photograph, "--workers", 2).refused(2, "is a photograph", "--workers")
    pellicle(*photograph, "--mask", "a.png", "--preview").refused(2, "is a photograph", "--preview", "--mask")
    pellicle(*photograph, "--noise", "2 %").refused(2, "--noise")


def test_wrong_use(pellicle, words):
    pellicle(*words, "--workers", 0).refused(2, "--workers")
    pellicle(*words, "--workers", 2, "--scheduler", "tcp://host:1").refused(2, "--scheduler")
    pellicle(*words[:-2], "--overwrite").refused(2, "--out")
    pellicle("map", "absent.nc", *words[2:]).refused(3, "absent.nc")
    words[3].write_text(words[3].read_text().replace("{ lower = 10, upper = 800 }", "300"))
    pellicle(*words).refused(3, "film.toml", "nothing is free")
    assert not words[-1].exists()


def test_a_cube_that_cannot_be_read_leaves_no_folder(pellicle, words, fits, tmp_path):
    pellicle(*words, "--mask", "absent.png").refused(2, "absent.png")
    assert not words[-1].exists()
    words[-1].mkdir()
    pellicle(*words, "--scheduler", "nonsense").refused(2, "nonsense")
    assert list(words[-1].iterdir()) == []
    assert pellicle(*words).code == 0
    before = {*words[-1].iterdir()}
    pellicle(*words, "--mask", "absent.png").refused(2, "absent.png")
    assert {*words[-1].iterdir()} == before


@pytest.mark.slow
def test_a_lamp_curve_of_a_region_divides_the_cube(pellicle, words, fits, tmp_path):
    with xarray.open_dataset(tmp_path / "wafer.nc") as cube:
        lit = cube.R.values[2:8, 4:9]
    pellicle(*words, "--lamp-curve", "4,2,5,6", "--json", code=0)
    bare = (2.9**2 + 0.02**2) / (4.9**2 + 0.02**2)  # Fresnel, air on 3.9 + 0.02i
    wafer, made = tmp_path / "wafer.nc", tmp_path / "out/map.nc"
    with xarray.open_dataset(wafer) as cube, xarray.open_dataset(made) as map:
        gain = lit[..., 0].mean() / bare
        np.testing.assert_allclose(map.thickness, 100 * cube.R[..., 0] / gain, rtol=1e-6)
        assert "lamp curve of region 4,2,5,6" in " ".join(map.attrs["notes"])
    pellicle(*words).refused(2, "another input")


def test_lamp_curves_that_contradict(pellicle, words, fits, tmp_path):
    film = tmp_path / "film.toml"
    for flags, text in (
        (("--lamp-curve", "0,0,99,1"), "--lamp-curve 0,0,99,1 leaves the image"),
        (("--lamp-curve", "0,0,4,4", "--lamp-reference", film), "--lamp-reference must be known"),
        (("--lamp-reference", film), "--lamp-curve, x,y,width,height"),
    ):
        pellicle(*words, *flags).refused(2, text)


@pytest.mark.slow
def test_a_series_has_rates(pellicle, words, fits, tmp_path):
    values = 0.5 - 0.01 * np.arange(6.0)[:, None, None, None] + np.zeros((1, 4, 5, 30))
    coords = {
        "wavelength": ("wavelength", np.linspace(400.0, 700.0, 30), {"units": "nm"}),
        "time": np.datetime64("2024-01-01", "ns") + np.arange(6) * np.timedelta64(2, "s"),
    }
    series = xarray.DataArray(values, coords, ("time", "y", "x", "wavelength")).to_dataset(name="R")
    series.to_netcdf(tmp_path / "series.nc")
    ran = pellicle("map", tmp_path / "series.nc", *words[2:], code=0)
    assert "rate.nc" in ran.err
    with xarray.open_dataset(tmp_path / "out/rate.nc") as rate:
        np.testing.assert_allclose(rate.thickness_rate, np.full((4, 5), -0.5))  # of 1 nm in 2 s
        assert rate.thickness_rate.attrs["units"] == "nm/s"
