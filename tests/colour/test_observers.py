"""Observers, colour spaces and differences against colour-science."""

import colour
import jax
import numpy as np
import pytest
from jax.test_util import check_grads

from pellicle.colour import delta_e76, delta_e2000, lab, linear_srgb, sensor, srgb
from pellicle.colour.observers import ILLUMINANTS

NAMES = {"1931": "CIE 1931 2 Degree Standard Observer", "1964": "CIE 1964 10 Degree Standard Observer"}


@pytest.mark.parametrize("observer", NAMES)
@pytest.mark.parametrize("illuminant", ILLUMINANTS)
def test_white_agrees_with_colour_science(observer, illuminant):
    """To 5e-4 of xy: the span ends at 730 nm, and the published points have five digits."""
    white = sensor(observer, illuminant).white
    published = colour.CCS_ILLUMINANTS[NAMES[observer]][illuminant]
    np.testing.assert_allclose(white[:2] / white.sum(), published, atol=5e-4)
    assert white[1] == pytest.approx(1.0)


def test_xyz_agrees_with_colour_science():
    at = sensor("1931", "D65").wavelength
    reflectance = 0.5 + 0.4 * np.sin(at / 17.0)
    spectrum = colour.SpectralDistribution(dict(zip(at, reflectance, strict=True)))
    observer = colour.MSDS_CMFS[NAMES["1931"]].copy().align(spectrum.shape)
    lamp = colour.SDS_ILLUMINANTS["D65"].copy().align(spectrum.shape)
    expected = colour.sd_to_XYZ(spectrum, observer, lamp, method="Integration")
    # colour-science interpolates the illuminant by a polynomial; CIE 15 and pellicle, linearly
    np.testing.assert_allclose(reflectance @ sensor("1931", "D65").weights, expected / 100, atol=2e-4)


XYZ = np.array([[0.2, 0.3, 0.1], [0.5, 0.4, 0.6], [0.004, 0.003, 0.002], [0.9, 0.95, 1.0]])
D65 = np.array([0.95047, 1.0, 1.08883])


def test_spaces_agree_with_colour_science():
    xy = D65[:2] / D65.sum()
    np.testing.assert_allclose(lab(XYZ, D65), colour.XYZ_to_Lab(XYZ, xy), atol=1e-9)
    space = colour.RGB_COLOURSPACES["sRGB"]
    linear = colour.XYZ_to_RGB(XYZ, space, illuminant=xy, chromatic_adaptation_transform="Bradford")
    np.testing.assert_allclose(linear_srgb(XYZ, D65), linear, atol=2e-3)
    steps = np.linspace(0, 1, 33)
    np.testing.assert_allclose(srgb(steps), colour.cctf_encoding(steps, function="sRGB"), atol=1e-6)


@pytest.mark.slow
def test_differences():
    """ΔE2000: the first pair of Sharma, Wu and Dalal 2005, table 1."""
    one, other = np.array([50.0, 2.6772, -79.7751]), np.array([50.0, 0.0, -82.7485])
    assert delta_e2000(one, other) == pytest.approx(2.0425, abs=1e-4)
    assert float(delta_e76(one, other)) == pytest.approx(float(colour.delta_E(one, other, method="CIE 1976")))
    np.testing.assert_array_equal(jax.grad(delta_e76)(one, one), 0.0)
    check_grads(lambda x: delta_e76(lab(x, D65), other), (XYZ[2],), 1, eps=1e-7, rtol=1e-5)


def test_unknown_names_list_the_known_ones(refuses):
    refuses(ValueError, "D65", sensor, "1931", "D60")
    refuses(ValueError, "1964", sensor, "2015")
