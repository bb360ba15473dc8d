"""A small cube, the comparison with it, and refusals."""

import numpy as np
import pytest

from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)


@pytest.fixture(scope="session")
def values():
    """Reflectances of 7 by 5 pixels at 9 bands; every number is different."""
    return (np.arange(7 * 5 * 9).reshape(7, 5, 9) / 400.0).astype("f4")


@pytest.fixture
def same(values):
    """Check that a source is read to the cube of `values`, whole and by blocks."""

    def check(source, expected=values, nm=NM, **options):
        cube = read_cube(source, **options)
        rank = len(cube.dims)
        np.testing.assert_allclose(cube.wavelength, nm, rtol=1e-9)
        np.testing.assert_allclose(np.asarray(cube.arrays["values"]), expected, rtol=1e-6)
        assert cube.shape == expected.shape[:rank]
        where = tuple(slice(n // 3, n // 3 + 2) for n in cube.shape)
        block = cube.pixels(where)["values"]
        np.testing.assert_allclose(block, expected[where].reshape(-1, cube.points), rtol=1e-6)
        return cube

    return check


@pytest.fixture
def refused():
    """Check that a source is refused by one sentence with these words, and return it."""

    def refused(source, *words, error=(DataError, UsageError), **options):
        with pytest.raises(error) as caught:
            read_cube(source, **options)
        message = str(caught.value)
        assert "\n" not in message
        for word in words:
            assert word in message, message
        return message

    return refused
