"""Coated balls and bubbles against a formula in NumPy, traced rays and energy; their surroundings."""

import numpy as np
import pytest
from scipy.integrate import quad

import pellicle as pl
from pellicle.colour import linear_srgb, sensor
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.simulation.environment import Environment, SoftBox, light_tent, one_lamp, sphere, studio
from pellicle.simulation.film_sphere import ball, bubble, drained_thickness, stack

SIZE = 21
EYE = sensor()
WHITE = Environment((), 1.0, 1.0, 1.0, 1.0)


def airy(nm, media, cosine):
    """R, T and R from below, each (2, wavelengths), of one film; `media` are complex (3, wavelengths)."""
    n0, n1, n2 = media
    sine = n0 * np.sqrt(1 - cosine**2)
    q0, q1, q2 = (np.sqrt(n * n - sine**2 + 0j) for n in media)
    turn = np.exp(2j * np.pi / EYE.wavelength * nm * q1)
    rows = []
    for a, b, c in ((q0, q1, q2), (q0 / n0**2, q1 / n1**2, q2 / n2**2)):
        above, below = (a - b) / (a + b), (b - c) / (b + c)
        bottom = 1 + above * below * turn**2
        r = (above + below * turn**2) / bottom
        t = (1 + above) * (1 + below) * turn / bottom
        back = -(below + above * turn**2) / bottom
        rows.append([np.abs(r) ** 2, np.abs(t) ** 2 * np.real(c) / np.real(a), np.abs(back) ** 2])
    return np.swapaxes(np.array(rows), 0, 1)


def colour(spectrum):
    return np.asarray(linear_srgb(spectrum.mean(axis=0) @ EYE.weights, EYE.white))


def refracted(direction, normal, ratio):
    """Snell's law for a ray against the normal, by vectors."""
    cosine = -direction @ normal
    return ratio * direction + (ratio * cosine - np.sqrt(1 - ratio**2 * (1 - cosine**2))) * normal


def normal_of(at):
    """Normal of the sphere at a pixel."""
    x, y = ((at[1] + 0.5) * 2 / SIZE - 1) / 0.95, -((at[0] + 0.5) * 2 / SIZE - 1) / 0.95
    return np.array([x, y, np.sqrt(1 - x * x - y * y)])


@pytest.fixture(scope="module")
def hematite():
    return ball(stack(pl.Scene(pl.Layer("Fe2O3", 100.0), "BK7")), 140.0, studio(), SIZE)


@pytest.mark.parametrize("at", [(10, 10), (6, 13), (15, 4)])
def test_pixels_of_a_hematite_ball(hematite, at):
    """Reflection, straight through, and with one to four reflections inside; steps of 1 nm against 64."""
    media = np.array([np.broadcast_to(pl.medium(m)(EYE.wavelength), 351) for m in (1.0, "Fe2O3", "BK7")])
    normal = normal_of(at)
    R, T, back = airy(140.0, media, normal[2])
    sight = np.array([0.0, 0.0, -1.0])
    mirrored = colour(R) * studio().radiance(sight + 2 * normal[2] * normal)
    np.testing.assert_allclose(hematite.reflected.linear[at], mirrored, atol=3e-4)

    index = np.real(np.interp(550.0, EYE.wavelength, np.real(media[2])))
    ray, point, through, spectrum = refracted(sight, normal, 1 / index), normal, 0.0, T * T
    for _ in range(5):
        point = point - 2 * (ray @ point) * ray
        out = refracted(ray, -point, index)
        through = through + colour(spectrum) * studio().radiance(out)
        ray, spectrum = ray - 2 * (ray @ point) * point, spectrum * back
    np.testing.assert_allclose(hematite.transmitted.linear[at], through, atol=3e-4)


def test_light_is_conserved_where_nothing_absorbs():
    """In white surroundings a ball of glass under a transparent film is invisible."""
    films = stack(pl.Scene(pl.Layer(2.0, 100.0), 1.5))
    whole = ball(films, 180.0, WHITE, SIZE).whole
    inside = (whole.coverage == 1) & (np.hypot(*np.mgrid[-1 : 1 : SIZE * 1j, -1 : 1 : SIZE * 1j]) < 0.8)
    np.testing.assert_allclose(whole.linear[inside], 1.0, atol=0.005)  # what five chords leave


def test_an_opaque_ball_and_layers_without_a_thickness_of_their_own(refuses):
    films = stack(pl.Scene(pl.Layer("SiO2", 100.0), "Si"))
    rendering = ball(films, 120.0, WHITE, 5)
    assert rendering.transmitted is None
    np.testing.assert_array_equal(rendering.whole.linear, rendering.reflected.linear)
    plate = pl.Scene([pl.Layer("SiO2", 100.0), pl.Plate("BK7", 1.0)], "Si")
    refuses(UsageError, "coherent layers only", stack, plate)
    short = pl.Layer(Table(np.array([450.0, 700.0]), np.array([1.5, 1.5])), 100.0)
    refuses(UsageError, "no data between 380 and 730", stack, pl.Scene(short, "Si"))


def test_the_limb_is_smooth():
    pixels = sphere(31)
    assert pixels.share.min() > 0
    assert pixels.share.sum() / 31**2 == pytest.approx(np.pi / 4 * 0.95**2, rel=0.005)
    np.testing.assert_allclose(np.linalg.norm(pixels.normal, axis=1), 1.0)
    assert pixels.cosine.min() > 0


SOAP = 1.333


@pytest.fixture(scope="module")
def film_of_soap():
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


def test_a_line_of_sight_crosses_front_and_back(film_of_soap):
    top, at = 220.0, (7, 13)
    normal = normal_of(at)
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
    found = bubble(film_of_soap, top, tent, SIZE).linear[at]
    np.testing.assert_allclose(found, expected, atol=3e-4)


def test_a_bubble_in_white_surroundings_is_invisible(film_of_soap):
    found = bubble(film_of_soap, 400.0, WHITE, SIZE)
    np.testing.assert_allclose(found.linear[5:16, 5:16], 1.0, atol=0.003)  # three reflections within: R³
    black = bubble(film_of_soap, 400.0, Environment((), 0.0, 0.0, 0.0, 0.0), SIZE)
    np.testing.assert_array_equal(black.linear, 0.0)


def test_a_film_on_glass_is_no_bubble():
    with pytest.raises(UsageError, match="same medium on both sides"):
        bubble(stack(pl.Scene(pl.Layer(SOAP, 100.0), "BK7")), 300.0, WHITE, 5)


UP, RIGHT, VIEWER = np.eye(3)[[1, 0, 2]]
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
    np.testing.assert_array_equal(dark.radiance(np.array([*beyond, -RIGHT, UP, VIEWER])), 0.0)
    assert dark.radiance(towards(10.0, 0.0)) == pytest.approx(2.5, rel=1e-6)  # half at the edge


def test_sky_and_ground_fade_from_the_horizon():
    bare = studio()._replace(boxes=())
    at = np.array([UP, -UP, towards(0, 5), towards(0, -5), VIEWER])
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
    hemisphere = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    step = np.pi / 1800 * np.pi / 360 * np.sin(theta)
    assert np.sum(lamp.radiance(hemisphere) * step) == pytest.approx(np.pi, rel=0.02)  # fading edges


def test_the_tent_is_dark_behind():
    assert light_tent().radiance(-VIEWER) == pytest.approx(0.02)
