"""`pellicle map`: thickness along a wedge and over a photograph, from simulated photographs."""

import json

import numpy as np
import pytest
from PIL import Image

import pellicle as pl
from pellicle.colour import linear_srgb, sensor, srgb

RECIPE = """
[data]
signal = "{signal}"

[scene]
substrate = {{ model = "constant", n = 3.9 }}
layer = [{{ material = 1.46, thickness = {{ lower = 20, upper = 200 }} }}]

{more}
"""


@pytest.fixture
def recipe(write):
    return lambda signal="srgb", more="": write(RECIPE.format(signal=signal, more=more), "film.toml")


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
    np.testing.assert_allclose(record["positions"]["thickness"], THICKNESS, atol=4)
    assert record["converged"] > 0.9
    assert json.loads((tmp_path / "out" / "result.json").read_text())["schema"] == "pellicle.map/1"
    header, first, *_ = (tmp_path / "out" / "strip.csv").read_text().splitlines()
    row = dict(zip(header.split(","), first.split(","), strict=True))
    assert float(row["thickness_nm"]) == pytest.approx(THICKNESS[0], abs=4)
    assert (tmp_path / "out" / "map.png").stat().st_size > 5000


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
    ],
)
def test_errors_name_flags(pellicle, recipe, colours, tmp_path, words, message):
    path = photo(tmp_path / "wedge.png", colours)
    ran = pellicle("map", path, "--recipe", recipe(), *words)
    assert ran.code in (2, 3)
    assert message in ran.err
