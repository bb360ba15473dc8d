"""Reflectance from counts with frames of white and dark, masks, errors, and dead bands."""

import pickle

import numpy as np
import pytest
import tifffile
import xarray as xr
from PIL import Image

from pellicle.data.cubes import checks
from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)


@pytest.fixture
def camera(values):
    """Counts of a camera with 12 bits whose light and dark current differ from pixel to pixel."""
    rng = np.random.default_rng(0)
    dark = rng.uniform(90, 110, (1, 5, 9))
    white = dark + rng.uniform(1500, 3000, (1, 5, 9))
    return dark + (white - dark) * 0.99 * values, white, dark


@pytest.mark.parametrize("form", ["image", "line", "lines"])
def test_forms_of_frames(camera, values, form):
    counts, white, dark = camera
    shapes = {
        "image": lambda a: np.repeat(a, 7, 0),
        "line": lambda a: a[0],
        "lines": lambda a: np.repeat(a, 100, 0) * np.linspace(0.9, 1.1, 100)[:, None, None],
    }
    frames = {"white_frame": shapes[form](white), "dark_frame": shapes[form](dark)}
    cube = read_cube(counts, wavelengths=NM, white_reflectance=0.99, **frames)
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), 0.99**2 * values, rtol=1e-6, atol=1e-12)
    block = cube.pixels((slice(2, 5), slice(1, 3)))["values"]
    np.testing.assert_allclose(block, 0.99**2 * values[2:5, 1:3].reshape(-1, 9), rtol=1e-6)
    coarse = np.asarray(cube.coarse(2).arrays["values"])
    np.testing.assert_allclose(coarse, 0.99**2 * values[1::2, 1::2], rtol=1e-6)


def test_one_spectrum_and_bands_in_another_order(values):
    white = np.linspace(1000, 3000, 9)
    counts = (100 + (white - 100) * values)[..., ::-1]
    options = {"white_frame": white[::-1].copy(), "dark_frame": np.full(9, 100.0)}
    cube = read_cube(counts, wavelengths=NM[::-1], range=(450, 750), **options)
    np.testing.assert_array_equal(cube.wavelength, NM[1:8])
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), values[..., 1:8], rtol=1e-6, atol=1e-9)


def test_frames_from_files(camera, values, tmp_path):
    counts, white, dark = camera
    np.save(tmp_path / "raw.npy", counts)
    np.save(tmp_path / "dark.npy", dark[0])
    stack = np.repeat(white, 7, 0).transpose(2, 0, 1)
    tifffile.imwrite(tmp_path / "white.tif", stack, photometric="minisblack")
    frames = {"white_frame": tmp_path / "white.tif", "dark_frame": str(tmp_path / "dark.npy")}
    white = {"white_reflectance": lambda nm: 0.5 + nm / 2000}
    cube = read_cube(tmp_path / "raw.npy", wavelengths=NM, **frames, **white)
    expected = 0.99 * values * (0.5 + NM / 2000)
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), expected, rtol=1e-6, atol=1e-12)
    assert any("white frame" in note and "an image" in note for note in cube.notes)


def test_reflectance_of_white_from_a_table(camera, values, tmp_path):
    counts, white, dark = camera
    (tmp_path / "white.csv").write_text("wavelength_nm,R\n350,0.9\n900,0.9\n")
    frames = {"white_frame": white, "dark_frame": dark, "white_reflectance": str(tmp_path / "white.csv")}
    cube = read_cube(counts, wavelengths=NM, **frames)
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), 0.9 * 0.99 * values, rtol=1e-6, atol=1e-12)


def test_dead_and_saturated_pixels(camera):
    counts, white, dark = (np.round(a).astype("u2") for a in camera)
    white = np.repeat(white, 7, 0)
    white[1, 1, 2] = dark[0, 1, 2]  # a dead pixel
    counts[2, 2, 3] = 4095
    white[3, 3, 4] = 4095
    cube = read_cube(counts, wavelengths=NM, white_frame=white, dark_frame=dark)
    lost = np.argwhere(np.isnan(np.asarray(cube.arrays["values"])))
    np.testing.assert_array_equal(lost, [[1, 1, 2], [2, 2, 3], [3, 3, 4]])
    assert any("4095 are saturated" in note for note in cube.notes)
    given = read_cube(counts, wavelengths=NM, white_frame=white, dark_frame=dark, saturation=2000)
    high = (counts >= 2000) | (white >= 2000) | (white <= dark)
    kept = ~high.all((0, 1))  # bands that are saturated everywhere are left out
    np.testing.assert_array_equal(given.wavelength, NM[kept])
    np.testing.assert_array_equal(np.isnan(np.asarray(given.arrays["values"])), high[..., kept])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"dark_frame": np.zeros(9)}, ("need `white_frame`",)),
        ({"white_frame": np.ones((7, 5, 8))}, ("8 bands", "9")),
        ({"white_frame": np.ones((7, 6, 9))}, ("7 x 6", "7 x 5")),
        ({"white_frame": np.ones((2, 2, 7, 5, 9))}, ("5 axes",)),
        ({"white_frame": "absent.npy"}, ("absent.npy", "no such file")),
        ({"white_frame": np.full(9, 4000.0), "white_reflectance": 99}, ("`white_reflectance`",)),
        ({"white_frame": np.full(9, 4000.0), "signal_unit": "percent"}, ("leave `signal_unit` out",)),
    ],
)
def test_refused_frames(camera, refused, options, words):
    refused(camera[0], *words, error=(DataError, UsageError), wavelengths=NM, **options)


def test_dead_bands(values, refused):
    dead = values.copy()
    dead[..., 0] = np.nan
    dead[..., 8] = 0
    dead[2, 3, 4] = np.inf
    cube = read_cube(dead, wavelengths=NM)
    np.testing.assert_array_equal(cube.wavelength, NM[1:8])
    assert any("2 bands left out" in note for note in cube.notes)
    assert np.isnan(np.asarray(cube.arrays["values"])).sum() == 1
    chosen = read_cube(values, wavelengths=NM, range=(440, 760), without_bands="540:610,700")
    np.testing.assert_array_equal(chosen.wavelength, [450, 500, 650, 750])
    one = read_cube(values, wavelengths=NM, without_bands="700")
    assert "1 band left out, as asked" in one.notes
    for wrong, words in {"900:950": "no band at 900", "red": "LO:HI"}.items():
        refused(values, words, error=UsageError, wavelengths=NM, without_bands=wrong)
    refused(values, "no band is left", error=UsageError, wavelengths=NM, range=(900, 950))


@pytest.fixture
def used():
    """A mask with a hole."""
    mask = np.ones((7, 5), bool)
    mask[2:4, 1:3] = False
    return mask


@pytest.mark.parametrize("kind", ["array", "npy", "png", "rgb", "tif"])
def test_masks(values, used, tmp_path, kind):
    path = tmp_path / f"mask.{'png' if kind == 'rgb' else kind}"
    bright = np.where(used, 200, 0).astype("u1")
    if kind == "npy":
        np.save(path, used)
    elif kind in ("png", "rgb"):
        Image.fromarray(bright if kind == "png" else np.stack([bright] * 3, -1)).save(path)
    elif kind == "tif":
        tifffile.imwrite(path, bright)
    cube = read_cube(values, wavelengths=NM, mask=used if kind == "array" else path)
    np.testing.assert_array_equal(cube.mask, used)
    read = cube.pixels((slice(0, 7), slice(0, 5)))["values"]
    np.testing.assert_array_equal(np.isnan(read).all(-1), ~used.reshape(-1))
    np.testing.assert_array_equal(cube.coarse(2).mask, used[1::2, 1::2])


def test_mask_and_noise_that_are_variables(values, used):
    array = xr.DataArray(values, dims=("y", "x", "wavelength"), coords={"wavelength": NM}, name="R")
    valid, spread = (("x", "y"), used.T), (("y", "x"), np.full((7, 5), 0.02))
    dataset = array.to_dataset().assign(valid=valid, spread=spread)
    cube = read_cube(dataset, mask="valid", noise="spread")
    np.testing.assert_array_equal(cube.mask, used)
    np.testing.assert_allclose(cube.pixels((slice(0, 1), slice(0, 2)))["sigma"], np.full((2, 9), 0.02))


def test_refused_masks(values, refused, used, tmp_path):
    refused(values, "6 x 5", "7 x 5", error=DataError, wavelengths=NM, mask=used[:6])
    refused(values, "masks every pixel", error=DataError, wavelengths=NM, mask=np.zeros((7, 5)))
    refused(values, "'valid' is no file", error=UsageError, wavelengths=NM, mask="valid")
    (tmp_path / "mask.csv").write_text("1,1\n")
    refused(values, "no PNG, TIFF or .npy", error=UsageError, wavelengths=NM, mask=tmp_path / "mask.csv")


def test_noise(values, refused):
    where = (slice(1, 3), slice(2, 4))
    fixed = read_cube(values, wavelengths=NM, noise=0.005)
    assert np.ndim(fixed.arrays["sigma"]) == 1
    np.testing.assert_allclose(fixed.pixels(where)["sigma"], 0.005)
    share = read_cube(values, wavelengths=NM, noise="2 %")
    expected = 0.02 * np.maximum(values[where].reshape(-1, 9), 0.01)
    np.testing.assert_allclose(share.pixels(where)["sigma"], expected, rtol=1e-6)
    one = share.coarse(2).pixels((slice(0, 1), slice(0, 1)))["sigma"][0]
    np.testing.assert_allclose(one, 0.02 * values[1, 1], rtol=1e-6)
    refused(values, "`noise`", error=UsageError, wavelengths=NM, noise=-1)


def test_a_small_film_on_an_empty_background():
    """No block of the sample meets it: the cube is read up to the first line with values."""
    large = np.full((300, 300, 20), np.nan, "f4")  # 1.8 million values
    large[40:43, 40:43] = 0.3
    nm = np.linspace(400, 800, 20)
    assert read_cube(large, wavelengths=nm).wavelength.size == 20
    mask = np.zeros((300, 300), bool)
    mask[40:43, 40:43] = True
    large[0] = 1000.0  # glare outside the mask
    assert read_cube(large, wavelengths=nm, mask=mask).wavelength.size == 20


def test_frames_stay_in_their_file(camera, tmp_path):
    """A copy for another process is small, and the fingerprint covers the frame."""
    counts, white, _ = camera
    np.save(tmp_path / "raw.npy", np.tile(counts, (40, 1, 1)))
    np.save(tmp_path / "white.npy", np.tile(white, (280, 1, 1)))
    cube = read_cube(tmp_path / "raw.npy", wavelengths=NM, white_frame=tmp_path / "white.npy")
    assert len(pickle.dumps(cube)) < 10_000  # the frame has 100 kB
    np.save(tmp_path / "white.npy", np.tile(white, (280, 1, 1)) + 1)
    again = read_cube(tmp_path / "raw.npy", wavelengths=NM, white_frame=tmp_path / "white.npy")
    assert again.fingerprint != cube.fingerprint


def test_a_cube_of_missing_values_is_refused_before_it_is_read_whole(monkeypatch, refused):
    class Missing:
        shape, dtype, read = (400, 300, 10), np.dtype("f4"), 0

        def __getitem__(self, where):
            block = np.broadcast_to(np.float32(np.nan), self.shape)[where]
            Missing.read += block.size
            return block

    monkeypatch.setattr(checks, "MOST_SOUGHT", 30_000)
    cube = {"values": Missing()}
    seen = checks.sample(cube, 2)
    assert not np.isfinite(seen["values"]).any()
    sampled = sum(np.empty(cube["values"].shape)[w].size for w in checks.sample_blocks((400, 300), 10))
    assert Missing.read <= sampled + 30_000
    with pytest.raises(DataError, match=r"only NaN.*`mask`"):
        checks.live_bands(seen["values"], 120_000, "cube.npy")
