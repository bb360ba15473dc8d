"""Encodings of colour spaces: their inverses and slopes."""

import numpy as np
import pytest

from pellicle.colour import sensor
from pellicle.colour.spaces import camera_encoding, encoding

WHITE = sensor("1931", "D50").white


@pytest.mark.parametrize("code", [encoding("srgb", WHITE), encoding("lab", WHITE), camera_encoding(2.2)])
def test_the_slope_is_that_of_finite_differences(code):
    channels, step = np.array([[0.2, 0.3, 0.1], [0.4, 0.001, 0.05]]), 1e-6

    def of(x):
        return code.encode(x, code.roots(x))

    differences = [(of(channels + step * e) - of(channels - step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(code.rise(channels), np.stack(differences, axis=-1), rtol=1e-5, atol=1e-6)
