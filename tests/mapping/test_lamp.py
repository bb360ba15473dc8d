"""Lamp curves of simulated cubes against the curves by which they were multiplied."""

import pickle

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.cube import Cube
from pellicle.errors import DataError, UsageError
from pellicle.mapping.lamp import LampCurve, lamp_curve
from pellicle.mapping.pixels import fit_pixels, prepare

from ..airy import airy

WAVELENGTH = np.linspace(450.0, 900.0, 60)
NOISE = 0.003
LAMP = (1 + 0.25 * (WAVELENGTH - 675) / 225) * (1 + 0.15 * np.exp(-0.5 * ((WAVELENGTH - 610) / 8) ** 2))
"""A slope and a narrow line."""
SCENE = pl.Scene(pl.Layer(1.46, pl.Free(100, 1200)), 3.9, instrument=pl.Instrument(scale="slow"))
EVERY = (slice(None), slice(None))


def reflectance(thickness):
    """R of a film of 1.46 on 3.9 at normal incidence."""
    return airy(WAVELENGTH, np.asarray(thickness)[..., None], 1.46, 3.9)


def lit(thickness, seed=0):
    """A cube of these films under the lamp, darker towards the corners."""
    values = reflectance(thickness)
    y, x = (np.linspace(-1, 1, n) for n in thickness.shape)
    vignetting = 1 - 0.15 * (x**2 + y[:, None] ** 2)
    noise = NOISE * np.random.default_rng(seed).standard_normal(values.shape)
    return Cube({"values": vignetting[..., None] * LAMP * values + noise}, WAVELENGTH, fingerprint="a")


@pytest.fixture(scope="module")
def wedge():
    return 300 + 30.0 * np.arange(20) + np.arange(14.0)[:, None]


@pytest.fixture(scope="module")
def joint(wedge):
    return lamp_curve(lit(wedge), SCENE)


@pytest.mark.slow  # fits a thousand pixels in several rounds
def test_a_joint_curve_is_the_lamp_within_its_errors(joint):
    away = np.log(joint.gain / LAMP)
    pull = (away - away.mean()) / (joint.stderr / joint.gain)
    # 60 bands less the smooth terms: the mean square of normal numbers is within 0.5 of 1
    assert 0.5 < np.mean(pull**2) < 1.5
    assert np.max(np.abs(pull)) < 4
    assert np.median(joint.stderr / joint.gain) < 0.002
    assert not joint.level
    assert joint.separation > 0.2
    assert "up to a constant factor" in str(joint)


@pytest.mark.slow  # fits a thousand pixels in several rounds
def test_thicknesses_lose_their_bias(joint, wedge):
    cube = lit(wedge)
    model = prepare(cube, SCENE)
    exact = LampCurve(WAVELENGTH, LAMP, 0 * LAMP, 0)
    errors = []
    for one in (cube, joint.correct(cube), exact.correct(cube)):
        fits = fit_pixels(model, one, EVERY)
        errors.append(np.sqrt(np.mean((fits.values[:, 0] - wedge.ravel()) ** 2)))
    before, after, best = errors
    assert before > 2 * best
    assert after < 1.1 * best


@pytest.mark.slow  # compiles for 3 s
def test_films_of_one_thickness_are_no_evidence(wedge, refuses):
    refuses(UsageError, "too much alike", lamp_curve, lit(600 + 0.002 * wedge), SCENE)


def test_the_curve_of_a_bare_region_is_the_lamp_within_its_errors(wedge):
    wedge = wedge.copy()
    wedge[2:10, 3:13] = 0.0
    cube = lit(wedge)
    values = cube.arrays["values"]
    values[2:10, 3:13] = LAMP * reflectance(np.zeros((8, 10)))
    values[2:10, 3:13] += NOISE * np.random.default_rng(5).standard_normal((8, 10, 60))
    found = lamp_curve(cube, SCENE, "3,2,10,8")
    pull = (found.gain - LAMP) / found.stderr
    assert np.mean(pull**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 60))
    expected = NOISE / reflectance(0.0) / np.sqrt(80)
    assert np.median(found.stderr / expected) == pytest.approx(1.0, abs=0.05)
    assert found.level
    oxide = pl.Scene(pl.Layer(1.46, 100.0), 3.9)
    other = lamp_curve(cube, SCENE, [3, 2, 10, 8], reference=oxide)
    np.testing.assert_allclose(other.gain / found.gain, reflectance(0.0) / reflectance(100.0), rtol=1e-9)


def test_a_cube_is_divided_as_it_is_read():
    class Stored:
        """Values that are read by slicing only."""

        shape, dtype, ndim = (4, 3, 60), np.dtype(np.float32), 3
        read = 0

        def __getitem__(self, key):
            Stored.read += 1
            return np.ones(self.shape, np.float32)[key]

    curve = LampCurve(WAVELENGTH, LAMP, 0.01 * LAMP, 9)
    cube = Cube({"values": Stored(), "sigma": np.full(60, 0.1)}, WAVELENGTH, fingerprint="a")
    corrected = curve.correct(cube)
    assert Stored.read == 0
    block = corrected.pixels((slice(1, 3), slice(0, 2)))
    np.testing.assert_allclose(block["values"], np.broadcast_to(1 / LAMP, (4, 60)))
    np.testing.assert_allclose(block["sigma"], np.broadcast_to(0.1 / LAMP, (4, 60)))
    assert corrected.shape == (4, 3)
    assert corrected.fingerprint != cube.fingerprint
    assert "lamp curve" in corrected.notes[-1]
    angles = Cube({"values": np.ones((2, 2, 60, 3))}, WAVELENGTH, angle=np.arange(3.0))
    read = pickle.loads(pickle.dumps(curve.correct(angles))).pixels(EVERY)["values"]
    np.testing.assert_allclose(read, np.tile(np.repeat(1 / LAMP, 3), (4, 1)))


def test_lamp_curves_that_cannot_be_had_are_refused(wedge, refuses):
    cube, ones = lit(wedge), np.ones((2, 2, 60))
    dark = lit(wedge)
    dark.arrays["values"][:, 1:] = np.nan
    angles = Cube({"values": ones, "delta": ones}, WAVELENGTH, "psi-delta")
    for the_cube, region, options, error, words in (
        (cube, "15,0,10,3", {}, UsageError, "leaves the image"),
        (cube, "0,0,4,4;1,1,2,2", {}, UsageError, "one rectangle"),
        (cube, "0,0,4,4", {"reference": SCENE}, UsageError, "known"),
        (cube, "0,0,1,2", {}, DataError, "fewer than four"),
        (angles, None, {}, UsageError, "ellipsometry"),
        (dark, None, {}, DataError, "too few"),
    ):
        refuses(error, words, lamp_curve, the_cube, SCENE, region, **options)
