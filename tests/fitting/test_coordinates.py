"""The unit cube of a search: even, logarithmic, and a disc of tilts, folded or not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.fitting.coordinates import LEAST_SQUARE, Box, Coordinates, box
from pellicle.scene.priors import HalfNormal, LogUniform, Normal

from ..differences import jacobian

REACH = 20.0
FOLDED = Coordinates((False, True, False, False), (2, 3), folded=True)
DISC = FOLDED._replace(folded=False)
"""A thickness, an exponent by its logarithm, and a deviation with its azimuth."""


def bounds(coordinates: Coordinates) -> Box:
    lowest = LEAST_SQUARE if coordinates.folded else -1.0
    lower = np.array([10.0, np.log(1.0), -1.0, lowest])
    return box(lower, np.array([1000.0, np.log(1000.0), 1.0, 1.0]), [None] * 4, REACH)


def tilts(coordinates: Coordinates, units: np.ndarray) -> np.ndarray:
    """Deviation and azimuth in degrees at points (points, 4) of the cube: (2, points)."""
    return np.asarray(coordinates.values(bounds(coordinates), units))[:, 2:].T


@pytest.mark.parametrize("coordinates", [DISC, FOLDED])
def test_the_corners_are_the_bounds(coordinates):
    ends = coordinates.values(bounds(coordinates), np.array([np.zeros(4), np.ones(4)]))
    np.testing.assert_allclose(ends[:, :2], [[10, 1], [1000, 1000]], rtol=1e-12)
    np.testing.assert_allclose(ends[1, 2:], [REACH, 45.0], rtol=1e-12)
    middle = coordinates.values(bounds(coordinates), np.full(4, 0.5))
    np.testing.assert_allclose(middle[:2], [505.0, np.sqrt(1000)], rtol=1e-12)


@pytest.mark.parametrize("coordinates", [DISC, FOLDED])
def test_numpy_agrees_with_a_traced_program(coordinates):
    own, units = bounds(coordinates), np.random.default_rng(3).uniform(0, 1, (50, 4))
    units[0, 2:] = 0.5  # the centre of the disc
    before = units.copy()
    found = coordinates.values(own, units)
    assert isinstance(found, np.ndarray)
    np.testing.assert_array_equal(units, before)
    np.testing.assert_allclose(found, jax.jit(coordinates.values)(own, units), rtol=1e-13)


@pytest.mark.parametrize(("coordinates", "least"), [(DISC, -180.0), (FOLDED, 0.0)])
def test_a_tilt_fills_a_disc_and_folded_half_of_one(coordinates, least):
    units = np.random.default_rng(0).random((4000, 4))
    deviation, azimuth = tilts(coordinates, units)
    assert deviation.max() <= REACH * (1 + 1e-12)
    assert deviation.max() > 0.99 * REACH
    assert least <= azimuth.min() < least + 2
    assert 178 < azimuth.max() <= 180


def test_folded_coordinates_step_by_the_square_of_the_tilt_out_of_the_plane():
    """Samples in the plane depend on cos δ alone: at no tilt along the plane it falls in proportion to y²."""
    reach = np.deg2rad(REACH)

    def upright(square):
        values = FOLDED.values(bounds(FOLDED), jnp.full(4, 0.5).at[3].set(square))
        return jnp.cos(jnp.deg2rad(values[2]))

    cosine, slope = jax.jit(jax.vmap(jax.value_and_grad(upright)))(jnp.array([0.0, 1e-4, 0.25]))
    np.testing.assert_allclose(slope[:2], -(reach**2) / 2, rtol=1e-4)
    np.testing.assert_allclose(cosine, np.cos([0, reach / 100, reach / 2]), atol=1e-6)


def test_log_area_is_that_of_the_disc():
    """Against the determinant of the map onto the plane of tilts, by finite differences."""

    def tilt(x, y):
        deviation, azimuth = tilts(DISC, np.array([[0.5, 0.5, x, y]]))[:, 0]
        return deviation * np.exp(1j * np.deg2rad(azimuth))

    def area(x, y, step=1e-5):
        along, across = tilt(x + step, y) - tilt(x - step, y), tilt(x, y + step) - tilt(x, y - step)
        return abs((np.conj(along) * across).imag)

    points = ((0.6, 0.3), (0.1, 0.9), (0.5, 0.95))
    log = [DISC.log_area(bounds(DISC), jnp.array([0.5, 0.5, x, y])) for x, y in points]
    areas = np.array([area(x, y) for x, y in points])
    np.testing.assert_allclose(np.exp(np.subtract(log, log[0])), areas / areas[0], rtol=1e-6)
    assert Coordinates().log_area(bounds(DISC), jnp.full(4, 0.5)) == 0


@pytest.mark.parametrize("coordinates", [Coordinates(), DISC, FOLDED])
def test_slope_by_finite_differences(coordinates):
    unit, around = np.array([0.3, 0.6, 0.7, 0.4]), bounds(coordinates)
    expected = jacobian(lambda unit: coordinates.values(around, unit), unit, 1e-6)
    np.testing.assert_allclose(coordinates.slope(around, unit), expected, rtol=1e-6, atol=1e-6)


def test_the_centre_of_the_disc_has_a_slope_and_plain_coordinates_go_evenly():
    assert np.isfinite(DISC.slope(bounds(DISC), np.full(4, 0.5))).all()
    plain = box(np.zeros(2), np.array([2.0, 4.0]), [None] * 2)
    np.testing.assert_allclose(Coordinates().values(plain, np.array([0.25, 0.5])), [0.5, 2.0])


def test_priors_of_a_box():
    priors = [Normal(5.0, 2.0), HalfNormal(0.5), LogUniform(), None]
    around = box(np.array([0.0, 0.0, 1.0, 0.0]), np.full(4, 10.0), priors)
    values = np.array([8.0, 1.0, 3.0, 7.0])
    np.testing.assert_allclose(around.prior_rows(values), [1.5, 2.0, 0.0, 0.0])
    log = -0.5 * (1.5**2 + 2.0**2) - np.log(3.0)
    np.testing.assert_allclose(around.log_prior(values), log)
