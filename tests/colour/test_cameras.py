"""Sensors of cameras and of observers under measured lamps against the integral on fine steps."""

import numpy as np
import pytest

from pellicle.colour import sensor
from pellicle.colour.observers import camera_sensor, illuminant_spectrum, observer_sensor, srgb_sensor
from pellicle.colour.spaces import linear_srgb

NM = np.arange(380.0, 731.0, 5.0)
BANDS = np.exp(-(((NM[:, None] - [600.0, 540.0, 460.0]) / [35.0, 40.0, 30.0]) ** 2)) * [2.0, 3.0, 1.0]
LAMP_NM = np.array([300.0, 450.0, 610.0, 800.0])
LAMP = np.array([0.2, 1.5, 0.9, 2.0])


def reflectance(nm):
    return 0.4 + 0.3 * np.sin(nm / 25.0)


def test_camera_agrees_with_the_integral_of_its_tables():
    made = camera_sensor(NM, BANDS, LAMP_NM, LAMP)
    fine = np.linspace(380.0, 730.0, 70_001)
    weights = np.stack([np.interp(fine, NM, b) for b in BANDS.T]) * np.interp(fine, LAMP_NM, LAMP)
    expected = np.trapezoid(weights * reflectance(fine), fine) / np.trapezoid(weights, fine)
    np.testing.assert_allclose(reflectance(made.wavelength) @ made.weights, expected, atol=2e-4)
    np.testing.assert_allclose(made.white, 1.0)
    assert set(np.diff(made.wavelength)) == {1.0}
    assert made.wavelength[0] > 385  # its ends hold nothing
    assert made.wavelength[-1] < 725


@pytest.mark.parametrize("name", ["A", "D65", "E"])
def test_the_spectrum_of_an_illuminant_gives_its_sensor(name):
    made, expected = observer_sensor("1964", *illuminant_spectrum(name)), sensor("1964", name)
    np.testing.assert_allclose(made.weights, expected.weights, atol=1e-12)


def test_linear_srgb_as_channels():
    eye = sensor("1931", "A")
    channels = srgb_sensor(eye)
    np.testing.assert_allclose(channels.white, 1.0)
    spectrum = reflectance(eye.wavelength)
    expected = linear_srgb(spectrum @ eye.weights, eye.white)
    np.testing.assert_allclose(spectrum @ channels.weights, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("camera", "lamp", "reason"),
    [
        ((NM, BANDS), ([600.0, 800.0], [1.0, 1.0]), "channel R has .* beyond 600 or 730"),
        ((NM, BANDS), ([700.0, 800.0], [1.0, 1.0]), "share 100 nm"),
        ((NM, BANDS), ([300.0, 800.0], [0.0, 0.0]), "no light"),
        ((NM[::-1], BANDS), ([300.0, 800.0], [1.0, 1.0]), "rising"),
        ((NM, BANDS[:, :2]), ([300.0, 800.0], [1.0, 1.0]), "shapes"),
    ],
)
def test_tables_that_give_no_sensor(camera, lamp, reason, refuses):
    refuses(ValueError, reason, camera_sensor, *camera, *lamp)


def test_a_lamp_too_short_for_an_observer(refuses):
    refuses(ValueError, "from 390 to 720", observer_sensor, "1931", [450.0, 800.0], [1.0, 1.0])
