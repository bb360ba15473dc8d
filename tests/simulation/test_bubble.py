"""A bubble against the equation of drainage, a line of sight followed by vectors, and energy."""

import numpy as np
import pytest
from scipy.integrate import quad

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.simulation.environment import Environment, light_tent
from pellicle.simulation.film_sphere import bubble, drained_thickness, stack
from tests.simulation.test_ball import SIZE, WHITE, airy, colour

SOAP = 1.333


@pytest.fixture(scope="module")
def films():
    return stack(pl.Scene(pl.Layer(SOAP, 100.0), 1.0))


@pytest.mark.parametrize("degrees", [1.0, 40.0, 90.0, 130.0, 170.0])
def test_thickness_of_a_draining_sphere(degrees):
    angle = np.deg2rad(degrees)
    integral = quad(lambda x: np.sin(x) ** (1 / 3), 0, angle)[0]
    assert drained_thickness(angle, 300.0) == pytest.approx(
        300.0 * np.sqrt(4 / 3 * integral) / np.sin(angle) ** (2 / 3), rel=1e-6
    )


def test_the_profile_solves_the_equation_of_drainage():
    """−f/2 + c/(sin θ) d(sin²θ f³)/dθ = 0 with one c at all angles, for d = f(θ)/√t."""
    angle = np.deg2rad(np.linspace(5.0, 165.0, 33))
    step = 1e-5

    def flow(at):
        return np.sin(at) ** 2 * drained_thickness(at, 1.0) ** 3

    slope = (flow(angle + step) - flow(angle - step)) / (2 * step)
    c = 0.5 * drained_thickness(angle, 1.0) * np.sin(angle) / slope
    np.testing.assert_allclose(c, 0.25, rtol=1e-6)  # 2 f(0)² c = 1/2 at the top


def test_a_line_of_sight_crosses_front_and_back(films):
    top, at = 220.0, (7, 13)
    x, y = ((at[1] + 0.5) * 2 / SIZE - 1) / 0.95, -((at[0] + 0.5) * 2 / SIZE - 1) / 0.95
    normal = np.array([x, y, np.sqrt(1 - x * x - y * y)])
    media = np.array([np.full(351, m, complex) for m in (1.0, SOAP, 1.0)])

    def film(point):
        return airy(drained_thickness(np.arccos(point[1]), top), media, normal[2])[:2]

    tent, ray, point = light_tent(), np.array([0.0, 0.0, -1.0]), normal
    R, T = film(point)
    expected, passed = colour(R) * tent.radiance(ray + 2 * normal[2] * normal), T
    for _ in range(3):
        point = point - 2 * (ray @ point) * ray
        R, T = film(point)
        expected = expected + colour(passed * T) * tent.radiance(ray)
        ray, passed = ray - 2 * (ray @ point) * point, passed * R
    found = bubble(films, top, tent, SIZE).linear[at]
    np.testing.assert_allclose(found, expected, atol=3e-4)


def test_a_bubble_in_white_surroundings_is_invisible(films):
    found = bubble(films, 400.0, WHITE, SIZE)
    np.testing.assert_allclose(found.linear[5:16, 5:16], 1.0, atol=0.003)  # three reflections within: R³
    black = bubble(films, 400.0, Environment((), 0.0, 0.0, 0.0, 0.0), SIZE)
    np.testing.assert_array_equal(black.linear, 0.0)


def test_a_film_on_glass_is_no_bubble():
    with pytest.raises(UsageError, match="same medium on both sides"):
        bubble(stack(pl.Scene(pl.Layer(SOAP, 100.0), "BK7")), 300.0, WHITE, 5)
