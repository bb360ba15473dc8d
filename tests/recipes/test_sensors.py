"""Sensors of surfaces by name and file, and what is refused."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import sensor
from pellicle.errors import DataError

HEAD = '[scene.surface]\nmodel = "microfacet-film"\n'
NM = np.arange(390, 731, 10.0)
BANDS = np.exp(-(((NM[:, None] - [600, 540, 460]) / 40) ** 2))
LAMP = 1 + (NM - 390) / 340


@pytest.fixture
def surface(tmp_path):
    """Builds the surface of a recipe that lies beside the files of a camera and a lamp."""
    table = np.column_stack([NM, BANDS])
    np.savetxt(tmp_path / "camera.csv", table, delimiter=",", header="wavelength_nm,R,G,B", comments="")
    lamp = np.column_stack([NM, LAMP])
    np.savetxt(tmp_path / "lamp.csv", lamp, delimiter=",", header="wavelength_nm,power", comments="")

    def build(keys: str):
        (tmp_path / "surface.toml").write_text(HEAD + keys)
        return pl.read_recipe(tmp_path / "surface.toml").scene()

    return build


def mean_wavelengths(surface) -> np.ndarray:
    return surface.bands.wavelength @ surface.bands.weights


def test_observers_under_illuminants(surface):
    """Mean wavelengths of the bands, against the CIE's tables."""
    e = sensor("1931", "E")
    np.testing.assert_allclose(
        mean_wavelengths(surface('sensor = "1931"\nilluminant = "E"')), e.wavelength @ e.weights, atol=0.1
    )
    day, bulb = (mean_wavelengths(surface(f'sensor = "1931"\nilluminant = "{x}"')) for x in ("D65", "A"))
    assert np.all(bulb > day + 5)
    np.testing.assert_array_equal(day, mean_wavelengths(surface('sensor = "1931"')))
    red, green, blue = mean_wavelengths(surface('sensor = "srgb"'))
    assert red > 600 > green > 520 > 480 > blue


def test_a_camera_under_a_lamp(surface):
    fine = np.arange(390, 731.0)
    weights = np.stack([np.interp(fine, NM, band) * np.interp(fine, NM, LAMP) for band in BANDS.T], axis=1)
    found = surface('sensor = "camera.csv"\nlamp = "lamp.csv"\nbase = "Si"')
    np.testing.assert_allclose(mean_wavelengths(found), fine @ weights / weights.sum(axis=0), atol=0.1)
    assert found.fixed_numbers()["base_n"].shape == found.bands.wavelength.shape


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('sensor = "1932"', "sensor '1932' is unknown: expected 1931, 1964, srgb or a file"),
        ('lamp = "lamp.csv"', "lamp needs a sensor"),
        ('sensor = "1931"\nilluminant = "A"\nlamp = "lamp.csv"', "illuminant and lamp exclude each other"),
        ('sensor = "none.csv"', "none.csv"),
        ('sensor = "1931"\nwavelengths = [600, 550, 450]', "either wavelengths or a sensor"),
    ],
)
def test_what_is_no_sensor(surface, keys, said, refuses):
    refuses(DataError, said, surface, keys)
