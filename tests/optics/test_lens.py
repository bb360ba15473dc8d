"""Rays of a lens and their number on birefringent films, against vectors and the 4×4 method in fixed axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pellicle.optics.quadrature import AZIMUTHS, RINGS, Film, chosen_rays, lens_rays

from .lens_reference import muellers, permittivity

NM = 500.0


def radians(*degrees: float) -> list[np.float64]:
    return [np.float64(np.deg2rad(x)) for x in degrees]


@pytest.mark.parametrize(("angle", "half"), [(0.0, 30.0), (10.0, 25.0), (55.0, 8.0)])
def test_rays_and_the_turns_of_their_polarisation(angle, half):
    """A lens turns a ray and its field about the axis perpendicular to the axis of light and to the ray."""
    theta, sine = radians(angle)[0], np.sin(radians(half)[0])
    found = lens_rays(theta, sine, 4, 7)
    s_beta, c_beta, s_theta, c_theta = (f(x) for x in (found.azimuth, found.angle) for f in (np.sin, np.cos))
    ray = np.stack([s_theta * c_beta, s_theta * s_beta, c_theta], axis=-1)
    p_ray = np.stack([c_theta * c_beta, c_theta * s_beta, -s_theta], axis=-1)
    s_ray = np.stack([-s_beta, c_beta, 0 * c_beta], axis=-1)
    axis = np.array([np.sin(theta), 0.0, np.cos(theta)])
    p, s = np.array([np.cos(theta), 0.0, -np.sin(theta)]), np.array([0.0, 1.0, 0.0])
    # an even disc: means of both squared coordinates
    np.testing.assert_allclose(found.weight @ ray @ np.stack([p, s]).T, 0.0, atol=1e-15)
    across = ray @ np.stack([p, s]).T
    np.testing.assert_allclose(
        across.T @ (found.weight[:, None] * across), sine**2 / 4 * np.eye(2), atol=1e-15
    )
    about = np.cross(axis, ray)
    size = np.linalg.norm(about, axis=1)
    turn = Rotation.from_rotvec(about * (np.arcsin(size) / size)[:, None])
    np.testing.assert_allclose(turn.apply(axis), ray, atol=1e-14)
    for field, on_p, on_s in (
        (p, found.turn.cosine, found.turn.sine),
        (s, -found.turn.sine, found.turn.cosine),
    ):
        np.testing.assert_allclose(np.sum(turn.apply(field) * p_ray, axis=1), on_p, atol=1e-14)
        np.testing.assert_allclose(np.sum(turn.apply(field) * s_ray, axis=1), on_s, atol=1e-14)


FILMS = [  # angle, half angle, indices, angles of the axis, nm, foot
    (0.0, 23.6, (1.6, 1.75), (40.0, 25.0), 240.0, 3.9 + 0.02j),
    (0.0, 50.0, (1.66, 1.49), (60.0, 70.0), 900.0, 1.5),
    (60.0, 5.0, (1.66, 1.49), (45.0, 25.0), 1500.0, 3.9 + 0.02j),
    (70.0, 2.0, (2.61, 2.9), (90.0, 45.0), 60.0, 1.5),
]


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "half", "indices", "axis", "depth", "foot"), FILMS)
def test_the_stated_error_is_that_of_real_films(angle, half, indices, axis, depth, foot):
    """All orders of interference, not only the few of the model."""
    (ordinary, extraordinary), (theta, phi) = indices, radians(*axis)
    films = [Film(1.0, ordinary, extraordinary, (theta, phi), 2 * np.pi / NM * depth, 1.0, 0.0)]
    layers = [(permittivity(indices, *axis), depth)]
    truth, _ = muellers(angle, half, layers, foot, NM, (24, 49))
    for columns in (1, 4):
        count, around, error = chosen_rays(films, radians(angle), np.sin(radians(half)[0]), columns, 1e-6)
        assert error < 1e-6
        found, _ = muellers(angle, half, layers, foot, NM, (count, around))
        if columns == 4:
            np.testing.assert_allclose(found / found[0, 0], truth / truth[0, 0], atol=1e-6)
        else:
            assert abs(found[0, 0] - truth[0, 0]) < 1e-6
        # and fewer would not do
        fewer, _ = muellers(angle, half, layers, foot, NM, (1, 3))
        assert np.max(np.abs(fewer - truth)) > 1e-6


def test_films_that_are_too_thick_state_their_error():
    film = Film(1.0, 1.5, 1.7, (0.7, 0.4), 2 * np.pi / NM * 1e5, 1.0, 0.0)
    count, around, error = chosen_rays([film], radians(0.0), 0.5, 4, 1e-6)
    assert (count, around) == (RINGS[-1], AZIMUTHS[-1])
    assert error > 1e-3
