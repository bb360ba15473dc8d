"""Spheres of surfaces against quadrature over the hemisphere in NumPy, and what follows the noise."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.brdf.directions import direction, frame
from pellicle.colour import film_colour, sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation
from pellicle.simulation.environment import Environment, one_lamp, sphere, studio
from pellicle.simulation.surface_sphere import following, in_colour, in_plane, relief, render

from ..airy import airy

STEEL = {"n": 2.9, "base_n": 2.7, "base_k": 2.8, "roughness": 0.3, "diffuse": 0.1}
UNEVEN = pl.Surface("microfacet-film", STEEL | {"thickness": pl.Free(10, 70)})
LAYERED = pl.Surface("granier-heidrich-diffuse", {"thickness": 260.0, "n": [1.4, 1.45, 1.6], "diffuse": 0.2})
BOXES = studio().boxes
WHITE = Environment(tuple(box._replace(radiance=1.0) for box in BOXES), 1.0, 1.0, 1.0, 1.0)
EYE = sensor()
TO_LINEAR = EYE.weights @ (TO_SRGB @ adaptation(EYE.white, SRGB_WHITE)).T
SIZE = 11


def hemisphere(count):
    """Directions and weights of the midpoint rule, in the frame of the normal."""
    theta = (np.arange(count) + 0.5) * np.pi / (2 * count)
    phi = (np.arange(2 * count) + 0.5) * np.pi / count
    theta, phi = (x.ravel() for x in np.meshgrid(theta, phi, indexing="ij"))
    vectors = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return vectors, np.sin(theta) * np.cos(theta) * np.pi / (2 * count) * np.pi / count


def film(nm, cosine, wavelength=EYE.wavelength):
    """Spectra (..., wavelengths) of the oxide on steel."""
    return airy(wavelength, nm, 2.9, 2.7 + 2.8j, cosine[..., None])


def lobe(i, o):
    """GGX with Smith's shadowing over 4 cos cos, and the cosines on the facets."""
    h = (i + o) / np.linalg.norm(i + o, axis=-1, keepdims=True)
    square = STEEL["roughness"] ** 2
    ggx = square / (np.pi * (1 + (square - 1) * h[..., 2] ** 2) ** 2)
    shadows = [0.5 * (np.sqrt(1 + square * (1 / v[..., 2] ** 2 - 1)) - 1) for v in (i, o)]
    return ggx / (4 * i[..., 2] * o[..., 2] * (1 + sum(shadows))), np.sum(i * h, axis=-1)


def seen(normal, nm, environment, count=40):
    """Radiance to the eye of the rough film, by quadrature over the whole hemisphere in steps of 1 nm."""
    i, weight = hemisphere(count)
    beside = np.cross(normal, [0.3, 0.9, 0.1])
    beside /= np.linalg.norm(beside)
    axes = np.stack([beside, np.cross(normal, beside), normal])
    facets, cosine = lobe(i, axes @ [0.0, 0.0, 1.0])
    brdf = facets[:, None] * (film(nm, cosine) @ TO_LINEAR) + STEEL["diffuse"]
    return (brdf * (environment.radiance(i @ axes) * weight)[:, None]).sum(axis=0)


def pixel(at):
    x, y = ((at[1] + 0.5) * 2 / SIZE - 1) / 0.95, -((at[0] + 0.5) * 2 / SIZE - 1) / 0.95
    return np.array([x, y, np.sqrt(1 - x * x - y * y)])


@pytest.fixture(scope="module")
def steel():
    """Renderings in white surroundings and in the studio, with enough directions to converge."""
    return {at: render(UNEVEN, at, SIZE, count=2048).linear for at in (WHITE, studio())}


@pytest.mark.slow
@pytest.mark.parametrize("at", [(5, 5), (3, 7), (8, 2)])
def test_pixels_of_a_rough_uneven_film(steel, at):
    """The thickness is that of the noise at the pixel."""
    pixels = sphere(SIZE)
    x, y, z = pixels.normal.T
    axes = np.asarray(frame(*np.rad2deg([np.arccos(z), np.arctan2(y, x)])))
    maps = following(UNEVEN, relief(pixels.normal, axes, np.random.default_rng(0)))
    nm = maps["thickness"][np.count_nonzero(pixels.mask.ravel()[: at[0] * SIZE + at[1]])]
    for environment, rendering in steel.items():
        np.testing.assert_allclose(rendering[at], seen(pixel(at), nm, environment), rtol=0.01)


@pytest.mark.slow
def test_few_directions_are_within_four_per_cent(steel):
    found, expected = render(UNEVEN, WHITE, SIZE).linear, steel[WHITE]
    assert 0 < np.max(np.abs(found - expected)) < 0.04 * expected.max()


@pytest.mark.slow  # renders for 3 s
def test_pixels_of_a_diffuse_layer():
    """Its colour is π ρ, by the model at 351 wavelengths; n is linear between its three channels."""
    n = np.interp(EYE.wavelength, [445.0, 525.0, 645.0], [1.6, 1.45, 1.4])
    numbers = {"thickness": 260.0, "n": n, "diffuse": 0.2, "wavelengths": EYE.wavelength}
    up = direction(0.0, 0.0)
    expected = np.pi * np.asarray(LAYERED.brdf(numbers, up, up)) @ TO_LINEAR
    found = render(LAYERED, WHITE, SIZE).linear[5, 5]
    np.testing.assert_allclose(found / found.sum(), expected / expected.sum(), rtol=2e-3)
    np.testing.assert_allclose(found, expected, rtol=0.01)
    rgb = np.pi * np.asarray(LAYERED.brdf(LAYERED.start_numbers(), up, up))
    assert np.max(np.abs(rgb - expected)) > 0.05  # three wavelengths have another colour


@pytest.mark.slow  # compiles for 2 s
def test_the_side_away_from_the_lamp_is_dark():
    lamp = one_lamp(90.0, 10.0).boxes[0]._replace(azimuth=0.0)
    image = render(UNEVEN, Environment((lamp,) * len(BOXES), 0.0, 0.0, 0.0, 0.0), SIZE).linear.sum(axis=-1)
    assert np.all(image[:, :3] < 1e-3 * image.max())  # the terminator is as soft as the lamp's edge
    assert image[:, 6:].sum() > 0.9 * image.sum()


def test_deviation_and_thickness_follow_the_noise_between_their_bounds():
    normal = direction(np.linspace(1, 80, 50), np.linspace(0, 300, 50))
    noise = relief(np.asarray(normal), np.broadcast_to(np.eye(3), (50, 3, 3)), np.random.default_rng(0))
    tilted = pl.Surface("granier-heidrich", {"thickness": pl.Free(10, 70), "deviation": pl.Free(0, 8)})
    found = following(tilted, noise)
    assert (found["thickness"].min(), found["thickness"].max()) == pytest.approx((10, 70))
    assert found["deviation"].max() == pytest.approx(8)
    assert following(LAYERED, noise) == {}


@pytest.mark.slow  # renders for 3 s
def test_media_have_their_own_index_at_each_wavelength():
    """A table of a named film and base is that of `film_colour`, whatever the channels of the surface."""
    media = {"film": "Fe2O3", "base": "BK7"}
    oxide = pl.Surface("microfacet-film", {"thickness": 140.0}, wavelengths=(550.0,), **media)
    found = in_colour(oxide).numbers["table"].xyz(140.0, 1.0)
    expected = film_colour(140.0, pl.material("Fe2O3"), pl.material("BK7"), method="uniform-64").xyz
    np.testing.assert_allclose(found, expected, atol=3e-4)


def test_the_brdf_in_the_plane_of_incidence():
    """Positive angles are on the mirror side; free parameters take their start values."""
    leaving, nm = np.array([-45.0, 20.0, 45.0]), UNEVEN.start_numbers()["thickness"]
    at = np.deg2rad(leaving)
    o = np.stack([-np.sin(at), 0 * at, np.cos(at)], axis=-1)
    i = np.broadcast_to([np.sqrt(0.5), 0.0, np.sqrt(0.5)], o.shape)
    facets, cosine = lobe(i, o)
    expected = facets[:, None] * film(nm, cosine, UNEVEN.bands.wavelength) + STEEL["diffuse"]
    np.testing.assert_allclose(in_plane(UNEVEN, 45.0, leaving), expected, rtol=1e-5)
