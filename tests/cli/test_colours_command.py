"""Colours on the command line: read, simulate, plan and fit, by flags and by recipes."""

import json

import numpy as np
import pytest
from PIL import Image

import pellicle as pl
from pellicle.data.colours import write_colours
from tests.film_recipes import film_recipe

FILM = ("--layer", "1.46", "--substrate", "3.9", "--thickness", "10:500")
RECIPE = film_recipe(
    'signal = "srgb"\nangle = [0, 45]\nnoise = 0.006\n[camera]\nilluminant = "A"',
    "material = 1.46\nthickness = { lower = 10, upper = 500, value = 310 }",
    substrate="3.9",
)


@pytest.fixture
def recipe(write):
    return write(RECIPE, "film.toml")


@pytest.mark.slow
def test_simulated_colours_are_read_and_fitted(pellicle, recipe, tmp_path):
    out = tmp_path / "c.csv"
    assert pellicle("simulate", recipe, "--out", out, "--seed", "3").code == 0
    assert "truth: thickness = 310 nm" in out.read_text()
    shown = pellicle("read", out, "--illuminant", "A", "--json")
    record = json.loads(shown.out)
    assert record["signal"] == "srgb"
    assert record["angles_deg"] == [0, 45]
    assert record["range_nm"] == [380, 730]
    assert np.shape(record["colours"]) == (2, 3)
    assert "observer 1931 under A" in record["notes"]
    fitted = pellicle("fit", out, "--recipe", recipe, "--json")
    fit = json.loads(fitted.out)
    assert fit["data"]["signal"] == "srgb"
    assert fit["parameters"]["thickness"]["value"] == pytest.approx(310, abs=5)


@pytest.mark.slow  # measures every effect
def test_a_plan_of_colours_is_that_of_the_spectra_behind_them(pellicle, recipe):
    found = pellicle("plan", recipe, "--json", "--tolerance", "1e-3", code=0)
    effects = {row["effect"]: row["on"] for row in json.loads(found.out)["effects"]}
    assert effects["oblique"]
    assert not effects["absorption"]
    assert "380 to 730 nm every 1 nm" in found.err


@pytest.fixture
def photo(tmp_path):
    """Two films at 0 degrees, in a photograph of 8 bits."""
    scenes = [pl.Scene(pl.Layer(1.46, d), 3.9) for d in (100.0, 200.0)]
    colours = [pl.simulate(scene, space="srgb").values[0] for scene in scenes]
    pixels = np.zeros((20, 40, 3), np.uint8)
    pixels[:, :20], pixels[:, 20:] = (np.round(255 * c) for c in colours)
    Image.fromarray(pixels).save(tmp_path / "photo.png")
    return tmp_path / "photo.png", colours


def test_regions_of_a_photo_are_read_as_films(pellicle, photo):
    path, colours = photo
    records = pellicle("read", path, "--region", "2,2,9,9;22,2,9,9", "--json", code=0).objects
    assert [record["name"] for record in records] == ["2,2,9,9", "22,2,9,9"]
    for record, colour in zip(records, colours, strict=True):
        np.testing.assert_allclose(record["colours"][0], colour, atol=0.5 / 255 + 1e-6)
    text = pellicle("read", path, "--points", "5,5", "--spectrum", "3,3,5,5")
    assert "mean of 25 pixels in linear light" in text.out
    assert "#" in text.out


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["read", "photo.png"], 3, "give --region x,y,width,height or --points x,y"),
        (["read", "photo.png", "--region", "1,1,90,9"], 3, "leaves the photograph"),
        (["read", "photo.png", "--region", "1,1,9,9", "--range", "400:700"], 3, "--range: of spectra"),
        (["read", "photo.png", "--region", "1,1,9,9", "--chart", "a.csv"], 3, "--chart goes with"),
        (["read", "s.csv", "--region", "1,1,9,9"], 3, "only photographs have pixels"),
        (["read", "photo.webp", "--region", "1,1,9,9"], 3, "an image of another kind; save it as PNG"),
        (["read", "photo.webp", "--signal", "srgb", "--region", "1,1,9,9"], 3, "save it as PNG or TIFF"),
        (["read", "photo.webp"], 3, "save it as PNG or TIFF"),
        (["read", "absent.png", "--region", "1,1,9,9"], 3, "no such file"),
        (["read", "photo.png", "--region", "1,1,9,9", "--gamma", "2"], 3, "--gamma goes with --signal rgb"),
        (["read", "c.csv", "--out", "o", "--to", "netcdf"], 2, "colours are written as csv"),
        (["read", "c.csv", "--spectrum", "b"], 3, "its films are 'a'"),
        (["read", "c.csv", "--signal-unit", "bit"], 2, "--signal-unit"),
        (["read", "s.csv", "--illuminant", "A", "--gamma", "2"], 2, "--illuminant, --gamma: of colours"),
        (["fit", "s.csv", *FILM, "--transmitted"], 2, "s.csv: --transmitted: of colours"),
        (["read", "absent.csv", "--illuminant", "A"], 3, "no such file"),
    ],
)
def test_errors_name_flags(pellicle, photo, tmp_path, monkeypatch, words, code, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.csv").write_text("wavelength_nm,R\n500,0.2\n600,0.3\n")
    (tmp_path / "c.csv").write_text("name,R,G,B\na,0.1,0.2,0.3\n")
    Image.open(photo[0]).save(tmp_path / "photo.webp")
    found = pellicle(*words)
    assert found.code == code
    assert message in found.err


@pytest.mark.parametrize("command", [("read", "photo.png"), ("fit", "photo.png", *FILM)])
@pytest.mark.parametrize(
    ("flag", "value", "said"),
    [
        ("--observer", "1930", "1931, 1964"),
        ("--illuminant", "D66", "D65"),
        ("--white-balance", "auto", "fixed, free"),
        ("--gamma", "20", "0.1 to 10"),
        ("--region", "1,1,9", "x,y,width,height"),
        ("--white", "0,0,2,2,2", "x,y,width,height"),
        ("--points", "1", "x,y"),
    ],
)
def test_wrong_words_are_wrong_usage(pellicle, photo, tmp_path, monkeypatch, command, flag, value, said):
    """Whatever the file: the code is 2, as for every flag."""
    monkeypatch.chdir(tmp_path)
    pellicle(*command, flag, value).refused(2, flag, said)


def test_a_flag_of_colours_goes_to_the_files_that_have_them(pellicle, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.csv").write_text("wavelength_nm,R\n500,0.2\n600,0.3\n")
    (tmp_path / "c.csv").write_text("R,G,B\n0.1,0.2,0.3\n")
    assert pellicle("read", "s.csv", "c.csv", "--illuminant", "A").code == 0


@pytest.mark.slow
def test_a_fit_states_what_its_colours_are(pellicle, tmp_path, monkeypatch):
    """fit.csv is read back in its space, and not for another observer or illuminant."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.csv").write_text("angle_deg,R,G,B\n0,0.33,0.26,0.21\n50,0.22,0.32,0.31\n")
    words = ("--layer", "1.46", "--substrate", "3.9", "--thickness", "10:500", "--out", "out")
    light = ("--signal", "rgb", "--illuminant", "A")
    assert pellicle("fit", "c.csv", *words, *light).code in (0, 4)
    pellicle("read", "out/fit.csv").refused(3, "observer 1931 under A", "--illuminant A")
    [record] = pellicle("read", "out/fit.csv", "--illuminant", "A", "--json").objects
    assert record["signal"] == "rgb"


def test_colours_come_back_from_their_file(pellicle, tmp_path):
    sensor = pl.simulate(pl.Scene(pl.Layer(1.4, 100.0), 1.5), space="lab", angle=[0.0, 30.0], noise=0.4)
    write_colours(tmp_path / "a.csv", [sensor], comments=["a comment"])
    found = pl.read_colours(tmp_path / "a.csv")
    np.testing.assert_allclose(found.values, sensor.values, rtol=1e-6)
    np.testing.assert_allclose(found.sigma, 0.4)
    assert found.angle.tolist() == [0, 30]
    assert found.space == "lab"
    assert pellicle("read", tmp_path / "a.csv", "--out", tmp_path / "out").code == 0
    again = pl.read_colours(tmp_path / "out" / "a.csv")
    np.testing.assert_allclose(again.values, sensor.values, rtol=1e-6)


@pytest.mark.parametrize("command", ["simulate", "plan"])
def test_colours_have_no_wavelengths_of_their_own(pellicle, recipe, tmp_path, command):
    recipe.write_text(RECIPE.replace("noise", "wavelengths = [400, 500]\nnoise"))
    words = ("--out", tmp_path / "x.csv") if command == "simulate" else ()
    pellicle(command, recipe, *words).refused(3, "colours take those of their sensor")


def test_films_and_spectra_of_one_recipe(pellicle, recipe, tmp_path):
    """Each file is read by its own signal, with a camera of its own."""
    from pellicle.cli.inputs import inputs

    (tmp_path / "c.csv").write_text("R,G,B\n0.2,0.3,0.4\n")
    (tmp_path / "s.csv").write_text("wavelength_nm,R\n500,0.2\n600,0.3\n")
    files = """[[data.file]]
path = "c.csv"
signal = "srgb"
camera = { illuminant = "D50" }

[[data.file]]
path = "s.csv"
signal = "R"
"""
    recipe.write_text(files + RECIPE.partition("[data]")[2].partition("noise = 0.006")[2])
    found = inputs([], str(recipe), joint=True)
    [colours], [spectrum] = (file.read() for file in found.files)
    assert isinstance(colours, pl.Colours)
    assert "observer 1931 under D50" in colours.notes
    assert spectrum.signal == "R"
