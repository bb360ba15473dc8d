"""Radiance of an environment where it is known, and the irradiance of a lamp by quadrature."""

import numpy as np
import pytest

from pellicle.simulation.environment import Environment, SoftBox, light_tent, one_lamp, studio

UP, RIGHT, EYE = np.eye(3)[[1, 0, 2]]
BOX = SoftBox(polar=90.0, azimuth=0.0, width=20.0, height=40.0, radiance=5.0)


def towards(across: float, up: float) -> np.ndarray:
    """The direction so many degrees beside and above the right."""
    across, up = np.tan(np.deg2rad([across, up]))
    direction = np.array([1.0, up, -across])
    return direction / np.linalg.norm(direction)


def test_a_box_lies_where_it_was_put():
    dark = Environment((BOX,), 0.0, 0.0, 0.0, 0.0)
    inside = [towards(*at) for at in ((0, 0), (8, 0), (-8, 18), (0, -18))]
    beyond = [towards(*at) for at in ((12, 0), (0, 22), (-12, -22))]
    np.testing.assert_allclose(dark.radiance(np.array(inside)), 5.0)
    np.testing.assert_array_equal(dark.radiance(np.array([*beyond, -RIGHT, UP, EYE])), 0.0)
    assert dark.radiance(towards(10.0, 0.0)) == pytest.approx(2.5, rel=1e-6)  # half at the edge


def test_sky_and_ground_fade_from_the_horizon():
    bare = studio()._replace(boxes=())
    at = np.array([UP, -UP, towards(0, 5), towards(0, -5), EYE])
    expected = [bare.zenith, bare.nadir, bare.above_horizon, bare.below_horizon]
    found = bare.radiance(at)
    np.testing.assert_allclose(found[:2], expected[:2])
    np.testing.assert_allclose(found[2:4], expected[2:], atol=0.05)
    assert found[4] == pytest.approx(0.5 * (bare.above_horizon + bare.below_horizon))


@pytest.mark.parametrize("width", [10.0, 40.0])
def test_one_lamp_lights_what_faces_it_as_much_as_white_surroundings(width):
    """The solid angle counts, not the cosine: for 40° they differ by 2 %."""
    lamp = one_lamp(0.0, width)
    theta = (np.arange(900) + 0.5) * np.pi / 1800
    phi = (np.arange(720) + 0.5) * np.pi / 360
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    sphere = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    step = np.pi / 1800 * np.pi / 360 * np.sin(theta)
    assert np.sum(lamp.radiance(sphere) * step) == pytest.approx(np.pi, rel=0.02)  # fading edges


def test_the_tent_is_dark_behind():
    assert light_tent().radiance(-EYE) == pytest.approx(0.02)
