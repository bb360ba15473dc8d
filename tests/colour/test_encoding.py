"""Encodings of colour spaces: their inverses and slopes."""

import numpy as np
import pytest

from pellicle.colour import sensor
from pellicle.colour.encoding import camera_encoding, encoding
from pellicle.colour.spaces import lab, linear_srgb, srgb

WHITE = sensor("1931", "D50").white
COLOURS = WHITE * np.array([[0.2, 0.25, 0.15], [0.002, 0.002, 0.0022], [0.6, 0.55, 0.5]])


def coded(space, code, xyz):
    channels = code.channels(xyz)
    return code.encode(channels, code.roots(channels))


@pytest.mark.parametrize("space", ["srgb", "linear-rgb", "xyz", "lab"])
def test_a_colour_comes_back(space):
    code = encoding(space, WHITE)
    np.testing.assert_allclose(code.decode(coded(space, code, COLOURS)), COLOURS, atol=1e-12)


def test_codes_are_those_of_the_standards():
    assert np.allclose(coded("lab", encoding("lab", WHITE), COLOURS), lab(COLOURS, WHITE), atol=1e-9)
    expected = np.asarray(srgb(linear_srgb(COLOURS, WHITE)))
    assert np.allclose(coded("srgb", encoding("srgb", WHITE), COLOURS), expected, atol=1e-6)


@pytest.mark.parametrize("code", [encoding("srgb", WHITE), encoding("lab", WHITE), camera_encoding(2.2)])
def test_the_slope_is_that_of_finite_differences(code):
    channels, step = np.array([[0.2, 0.3, 0.1], [0.4, 0.001, 0.05]]), 1e-6

    def of(x):
        return code.encode(x, code.roots(x))

    differences = [(of(channels + step * e) - of(channels - step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(code.rise(channels), np.stack(differences, axis=-1), rtol=1e-5, atol=1e-6)
