"""Few wavelengths in place of a sensor's table, against sums over the table of reflectances by tmm."""

import numpy as np
import pytest

from pellicle.brdf.sensor_bands import ERROR, quadrature
from pellicle.colour import sensor

from ..by_tmm import films

CIE = sensor("1931", "D65")
CAMERA_NM = np.arange(400.0, 721.0)
_STEPS = np.arange(400.0, 721.0, 10)
CAMERA = np.stack(
    [np.interp(CAMERA_NM, _STEPS, np.exp(-(((_STEPS - peak) / 35) ** 2))) for peak in (600, 540, 460)], axis=1
)
"""A camera tabulated in steps of 10 nm, which still sees light at 400 nm, where its table ends."""


@pytest.mark.parametrize("table", [(CIE.wavelength, CIE.weights), (CAMERA_NM, CAMERA)], ids=["CIE", "camera"])
@pytest.mark.parametrize(
    ("film", "base", "thickness", "angle"),
    [(1.46, 4.1 + 0.05j, 320, 0.3), (2.4 + 0.02j, 1.2 + 6j, 500, 1.2), (1.33, 1.5, 1500, 1.0)],
)
def test_few_wavelengths_integrate_like_the_whole_table(table, film, base, thickness, angle):
    nm, weights = table
    few = quadrature(nm, weights, np.real(film) * thickness)
    assert len(few.wavelength) < len(nm) / 2
    layer = [1, film, base], [thickness], np.rad2deg(angle)
    truth = films("sp", nm, *layer) @ (weights / weights.sum(axis=0))
    found = films("sp", few.wavelength, *layer) @ few.weights
    np.testing.assert_allclose(found, truth, rtol=0, atol=ERROR)


def test_thick_films_and_narrow_bands_keep_the_table():
    lasers = np.exp(-(((CAMERA_NM[:, None] - [633, 532, 473]) / 1.5) ** 2))
    for nm, weights, path in ((CIE.wavelength, CIE.weights, 1e5), (CAMERA_NM, lasers, 300.0)):
        kept = quadrature(nm, weights, path)
        np.testing.assert_allclose(np.diff(kept.wavelength), 1.0)
        np.testing.assert_allclose(kept.weights.sum(axis=0), 1.0)


def test_two_wavelengths_are_their_own_quadrature():
    few = quadrature(np.array([450.0, 550.0]), np.array([[2.0, 0.0], [0.0, 4.0]]), 1e3)
    assert few.wavelength.tolist() == [450.0, 550.0]
    np.testing.assert_array_equal(few.weights, np.eye(2))
