"""Thicknesses from simulated 8-bit colours, whose noise the inverse knows."""

import numpy as np
import pytest

from pellicle.colour import (
    ColourInverse,
    FilmColourTable,
    film_colour,
    invert,
    lab,
    linear_srgb,
    sensor,
    srgb,
)
from pellicle.colour.spaces import SPACES, encoding

SIGMA, TOP, COUNT = 1.5 / 255, 900.0, 300
OXIDE, SILICON = 1.46, 4.1 + 0.03j
WHITE = sensor().white


@pytest.fixture(scope="module")
def table():
    return FilmColourTable.build(OXIDE, SILICON, (0, TOP))


def measured(thickness, angles, exposure=1.0):
    """8-bit sRGB (films, angles, 3) by 64 samples of the spectrum, with noise."""
    rng = np.random.default_rng(5)
    found = [film_colour(thickness, OXIDE, SILICON, angle=a, method="uniform-64").linear_srgb for a in angles]
    linear = np.stack([np.asarray(x) for x in found], axis=1) * np.reshape(exposure, (-1, 1, 1))
    coded = np.asarray(srgb(linear))
    return np.clip(np.round(255 * (coded + rng.normal(0, SIGMA, coded.shape))), 0, 255) / 255


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angles", "exposure", "least"),
    [((0.0,), 1.0, 0.92), ((0.0,), (0.5, 2.0), 0.7), ((0.0, 35.0, 60.0), (0.5, 2.0), 0.98)],
)
def test_orders_and_probabilities(table, angles, exposure, least):
    """The best order is right as often as its probability says, and no wrong one is called certain."""
    rng = np.random.default_rng(4)
    truth = rng.uniform(0, TOP, COUNT)
    factor = 1.0 if exposure == 1.0 else np.exp(rng.uniform(*np.log(exposure), COUNT))
    found = invert(table, measured(truth, angles, factor), np.array(angles), exposure=exposure)
    off = np.abs(found.thickness - truth[:, None])
    right = off[:, 0] < np.maximum(5.0, 4 * found.stderr[:, 0])
    assert np.mean(off[:, 0] < 5) > least
    expected = found.probability[:, 0]
    scatter = np.sqrt(np.sum(expected * (1 - expected)))
    assert abs(np.sum(right) - np.sum(expected)) < 4 * scatter + 2
    assert np.sum(found.status[~right] != "ambiguous") <= 0.05 * np.sum(~right) + 1
    assert np.mean(found.status == "misfit") < 0.01
    listed = np.any(off < np.maximum(5.0, 4 * found.stderr), axis=1)
    assert np.mean(listed) > 0.98
    scores = ((found.thickness[:, 0] - truth) / found.stderr[:, 0])[right]
    assert 0.85 < np.sqrt(np.mean(scores**2)) < 1.2


def test_probabilities_sum_to_one_and_fall(table):
    found = invert(table, measured(np.linspace(5, 890, 20), (0.0,))[:, 0], orders=30)
    np.testing.assert_allclose(np.nansum(found.probability, axis=1), 1.0, rtol=1e-9)
    fell = np.diff(found.probability, axis=1)
    assert np.all(fell[np.isfinite(fell)] <= 0)


@pytest.mark.parametrize("space", SPACES)
def test_encodings(space):
    """Against `colour.spaces`, at an exposure, for dark and bright colours; and back."""
    code, xyz = encoding(space, WHITE), np.array([[0.3, 0.4, 0.2], [0.002, 0.001, 0.003], [0.01, 0.02, 0.03]])
    channels = code.channels(xyz)
    linear = np.asarray(linear_srgb(1.7 * xyz, WHITE))
    coded = {"srgb": srgb(linear), "linear-rgb": linear, "xyz": 1.7 * xyz, "lab": lab(1.7 * xyz, WHITE)}
    result = code.encode(channels, code.roots(channels), 1.7**code.power)
    np.testing.assert_allclose(result, coded[space], atol=1e-9)
    if space != "srgb":  # which clips negative channels
        np.testing.assert_allclose(code.decode(result), 1.7 * xyz, atol=1e-9)


@pytest.mark.parametrize(("space", "sigma"), [("lab", 0.5), ("xyz", 0.003), ("linear-rgb", 0.003)])
@pytest.mark.parametrize("exposure", [1.0, (0.25, 4.0)])
def test_other_spaces(table, space, sigma, exposure):
    colours = film_colour(np.array([120.0, 312.0, 455.0]), OXIDE, SILICON, angle=30.0, method="uniform-64")
    coded = {"lab": colours.lab, "xyz": colours.xyz, "linear-rgb": colours.linear_srgb}[space]
    found = invert(table, coded, 30.0, space=space, sigma=sigma, exposure=exposure)
    off = np.abs(found.thickness - np.array([[120.0], [312.0], [455.0]]))
    assert np.all(np.any(off < np.maximum(1.0, found.stderr), axis=1))  # the mean of a skew order
    assert np.all(found.delta_e[:, 0] < 1.0)
    assert np.all(np.abs(found.exposure[:, 0] - 1) < 0.2)


def test_clipped_channels_are_limits(table):
    """Eight times overexposed, many channels are at 1; the rest and the limits leave few orders."""
    truth = np.array([93.0, 260.0, 301.0])
    overexposed = measured(truth, (0.0, 50.0), 8.0)
    assert np.mean(overexposed == 1) > 0.3
    found = invert(table, overexposed, [0.0, 50.0], exposure=8.0)
    assert np.all(np.nanmin(np.abs(found.thickness - truth[:, None]), axis=1) < 5)
    assert not np.any(found.status == "misfit")
    all_white = invert(table, [1.0, 1.0, 1.0], exposure=20.0)
    assert all_white.status in ("not-identifiable", "ambiguous")


def test_a_wide_range_of_the_exposure_has_a_grid_as_fine(table):
    """Where the brightest of 100 times is clipped everywhere, its colours say nothing of the grid."""
    narrow, wide = (ColourInverse.build(table, exposure=(low, 1 / low)) for low in (0.5, 0.01))
    assert len(wide.thickness) > 0.8 * len(narrow.thickness)
    truth = np.array([93.0, 120.0, 301.0])
    found = wide(measured(truth, (0.0,), 0.1)[:, 0])
    assert np.all(np.nanmin(np.abs(found.thickness - truth[:, None]) / found.stderr, axis=1) < 4)


def test_orders_with_an_error_of_the_camera(table):
    """Against a sum over the flare, which a Gaussian of 0.02 has, of the posterior by noise alone."""
    flare, truth = 0.02, np.array([150.0, 333.0, 480.0])
    linear = np.asarray(film_colour(truth, OXIDE, SILICON, method="uniform-64").linear_srgb)
    colours = np.asarray(srgb(linear + 0.7 * flare))
    found = ColourInverse.build(table, errors=lambda linear: [np.full(linear.shape, flare)])(colours)
    nm, size = np.linspace(0, TOP, 9001), np.linspace(-4, 4, 81)
    films = np.asarray(film_colour(nm, OXIDE, SILICON, method="uniform-64").linear_srgb)
    shown = np.asarray(srgb(np.clip(films[:, None] + flare * size[:, None], 0, None)))
    for colour, orders, probability in zip(colours, found.thickness, found.probability, strict=True):
        chi2 = np.sum(((shown - colour) / SIGMA) ** 2, axis=-1) + size**2
        posterior = np.sum(np.exp(-0.5 * (chi2 - chi2.min())), axis=1)
        edges = 0.5 * (np.sort(orders[np.isfinite(orders)])[1:] + np.sort(orders[np.isfinite(orders)])[:-1])
        share = np.bincount(np.digitize(nm, edges), posterior, len(edges) + 1) / posterior.sum()
        order = np.argsort(orders[np.isfinite(orders)])
        np.testing.assert_allclose(probability[np.isfinite(orders)][order], share, atol=0.05)
        assert np.min(np.abs(nm[np.argmax(posterior)] - orders[:1])) < 5


def test_status(table):
    assert invert(table, [0.1, 0.9, 0.1]).status == "misfit"
    beyond = measured(np.array([411.0]), (0.0, 60.0))
    ended = invert(table, beyond, [0.0, 60.0], thickness=(300.0, 410.0), sigma=0.05)
    assert ended.status == "at-bound"
    assert invert(table, beyond, [0.0, 60.0]).status == "converged"


def test_an_image_is_its_pixels(table):
    """A large array, in which repeated colours are computed once."""
    inverse = ColourInverse.build(table)
    image = np.round(measured(np.linspace(10, 800, 90), (0.0,))[:, 0], 6)
    tiled = np.tile(image, (60, 1)).reshape(60, 90, 3)
    found = inverse(tiled, orders=3)
    assert found.thickness.shape == (60, 90, 3)
    assert found.status.shape == (60, 90)
    one = inverse(image[17], orders=3)
    np.testing.assert_allclose(found.thickness[33, 17], one.thickness, rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"colours": [0.1, 0.2]}, "colours"),
        ({"colours": [0.1, 0.2, np.nan]}, "finite"),
        ({"space": "hsv"}, "expected one of srgb"),
        ({"exposure": (2.0, 1.0)}, "exposure"),
        ({"sigma": 0.0}, "sigma"),
        ({"thickness": (100.0, 2000.0)}, "thickness"),
        ({"angle": 85.0}, "angle"),
        ({"angle": [0.0, 30.0]}, "2, 3"),
    ],
)
def test_refusals(table, given, words, refuses):
    refuses(ValueError, words, invert, table, **{"colours": [0.2, 0.3, 0.4]} | given)
