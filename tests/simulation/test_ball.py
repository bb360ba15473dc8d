"""Pixels of a coated ball against the textbook formula in complex NumPy and rays traced by vectors."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import linear_srgb, sensor
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.simulation.environment import Environment, sphere, studio
from pellicle.simulation.film_sphere import ball, stack

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


@pytest.fixture(scope="module")
def hematite():
    films = stack(pl.Scene(pl.Layer("Fe2O3", 100.0), "BK7"))
    return films, ball(films, 140.0, studio(), SIZE)


@pytest.mark.parametrize("at", [(10, 10), (6, 13), (15, 4)])
def test_pixels_of_a_hematite_ball(hematite, at):
    """Reflection, straight through, and with one to four reflections inside; steps of 1 nm against 64."""
    _, rendering = hematite
    media = np.array([np.broadcast_to(pl.medium(m)(EYE.wavelength), 351) for m in (1.0, "Fe2O3", "BK7")])
    x, y = ((at[1] + 0.5) * 2 / SIZE - 1) / 0.95, -((at[0] + 0.5) * 2 / SIZE - 1) / 0.95
    normal = np.array([x, y, np.sqrt(1 - x * x - y * y)])
    R, T, back = airy(140.0, media, normal[2])
    sight = np.array([0.0, 0.0, -1.0])
    mirrored = colour(R) * studio().radiance(sight + 2 * normal[2] * normal)
    np.testing.assert_allclose(rendering.reflected.linear[at], mirrored, atol=3e-4)

    index = np.real(np.interp(550.0, EYE.wavelength, np.real(media[2])))
    ray, point, through, spectrum = refracted(sight, normal, 1 / index), normal, 0.0, T * T
    for _ in range(5):
        point = point - 2 * (ray @ point) * ray
        out = refracted(ray, -point, index)
        through = through + colour(spectrum) * studio().radiance(out)
        ray, spectrum = ray - 2 * (ray @ point) * point, spectrum * back
    assert rendering.transmitted is not None
    np.testing.assert_allclose(rendering.transmitted.linear[at], through, atol=3e-4)


def test_light_is_conserved_where_nothing_absorbs():
    """In white surroundings a ball of glass under a transparent film is invisible."""
    films = stack(pl.Scene(pl.Layer(2.0, 100.0), 1.5))
    whole = ball(films, 180.0, WHITE, SIZE).whole
    inside = (whole.coverage == 1) & (np.hypot(*np.mgrid[-1 : 1 : SIZE * 1j, -1 : 1 : SIZE * 1j]) < 0.8)
    np.testing.assert_allclose(whole.linear[inside], 1.0, atol=0.005)  # what five chords leave


def test_an_opaque_ball_and_layers_without_a_thickness_of_their_own():
    films = stack(pl.Scene(pl.Layer("SiO2", 100.0), "Si"))
    rendering = ball(films, 120.0, WHITE, 5)
    assert rendering.transmitted is None
    np.testing.assert_array_equal(rendering.whole.linear, rendering.reflected.linear)
    with pytest.raises(UsageError, match="coherent layers only"):
        stack(pl.Scene([pl.Layer("SiO2", 100.0), pl.Plate("BK7", 1.0)], "Si"))
    with pytest.raises(UsageError, match="no data between 380 and 730"):
        stack(pl.Scene(pl.Layer(Table(np.array([450.0, 700.0]), np.array([1.5, 1.5])), 100.0), "Si"))


def test_the_limb_is_smooth():
    pixels = sphere(31)
    assert pixels.share.min() > 0
    assert pixels.share.sum() / 31**2 == pytest.approx(np.pi / 4 * 0.95**2, rel=0.005)
    np.testing.assert_allclose(np.linalg.norm(pixels.normal, axis=1), 1.0)
    assert pixels.cosine.min() > 0
