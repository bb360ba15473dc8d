"""Simulated colours against tmm for the film and colour-science for observer, lamp and spaces."""

import colour
import jax
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.colour import film, sensor
from pellicle.colour.observers import camera_sensor
from pellicle.data.colours import CameraMatrix
from pellicle.errors import UsageError

NM = sensor("1931", "A").wavelength
ANGLES = [0.0, 40.0, 70.0]
LAYER, BASE, D = 1.46, 3.9 + 0.02j, 310.0


@pytest.fixture(scope="module")
def spectra():
    """Unpolarised reflectance of the film by tmm, (angles, wavelengths)."""

    def reflectance(angle, nm):
        film = [1, LAYER, BASE], [np.inf, D, np.inf], np.deg2rad(angle), nm
        return np.mean([tmm.coh_tmm(polarisation, *film)["R"] for polarisation in "sp"])

    return np.array([[reflectance(angle, nm) for nm in NM[::5]] for angle in ANGLES])


def scene(**light):
    return pl.Scene(pl.Layer(LAYER, D), BASE, light=pl.Light(**light))


@pytest.fixture(scope="module")
def xyz(spectra):
    """XYZ by colour-science's functions and lamp."""
    found = []
    for spectrum in spectra:
        sd = colour.SpectralDistribution(dict(zip(NM[::5], spectrum, strict=True)))
        sd = sd.interpolate(colour.SpectralShape(380, 730, 1), interpolator=colour.CubicSplineInterpolator)
        cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(sd.shape)
        lamp = colour.SDS_ILLUMINANTS["A"].copy().align(sd.shape)
        found.append(colour.sd_to_XYZ(sd, cmfs, lamp, method="Integration") / 100)
    return np.array(found)


@pytest.mark.parametrize("space", ["xyz", "srgb", "lab"])
def test_colours_agree_with_tmm_and_colour_science(xyz, space):
    eye = sensor("1931", "A")
    made = pl.simulate(scene(), sensor=eye, space=space, angle=ANGLES)
    assert made.angle.tolist() == ANGLES
    assert made.space == space
    white = colour.XYZ_to_xy(eye.white)
    if space == "lab":
        expected = colour.XYZ_to_Lab(xyz / eye.white * colour.xy_to_XYZ(white), white)
    elif space == "srgb":
        adapted = colour.XYZ_to_RGB(xyz, "sRGB", white, "Bradford")
        expected = colour.models.eotf_inverse_sRGB(np.clip(adapted, 0, 1))
    else:
        expected = xyz
    # the lamp is interpolated otherwise by colour-science, and the matrix of IEC 61966-2-1 has four digits
    np.testing.assert_allclose(made.values, expected, atol={"lab": 0.05}.get(space, 1e-3))


def test_channels_of_a_camera_with_gamma_exposure_and_matrix(spectra):
    nm = NM[::5]
    bands = np.exp(-(((nm[:, None] - [600.0, 540.0, 460.0]) / 35) ** 2))
    exposed = pl.Scene(pl.Layer(LAYER, D), BASE, instrument=pl.Instrument(scale=0.8))
    seen = camera_sensor(nm, bands, nm, np.ones(nm.size))
    matrix = CameraMatrix(np.array([[1.2, -0.1, -0.1], [0, 1, 0], [0, 0.1, 0.9]]), np.zeros((9, 9)))
    linear = 0.8 * spectra @ bands / bands.sum(axis=0)
    made = pl.simulate(exposed, sensor=seen, space="rgb", angle=ANGLES, gamma=2.2)
    np.testing.assert_allclose(made.values, linear ** (1 / 2.2), atol=2e-3)
    like = pl.Colours(made.values, seen, "rgb", angle=made.angle, gamma=2.2, camera=matrix)
    coded = (linear @ matrix.matrix.T) ** (1 / 2.2)
    np.testing.assert_allclose(pl.simulate(exposed, sensor=like).values, coded, atol=2e-3)


def test_noise_becomes_sigma_and_stays_within_the_codes():
    made = pl.simulate(scene(angle=30.0), space="srgb", noise=0.5, seed=4)
    assert made.sigma.tolist() == [[0.5] * 3]
    assert made.angle.tolist() == [30.0]
    noisy = pl.simulate(scene(), space="lab", angle=np.zeros(400), noise=2.0, seed=4).values
    np.testing.assert_allclose(noisy.std(axis=0), 2.0, rtol=0.15)
    quiet = pl.simulate(scene(), space="lab").values
    np.testing.assert_allclose(noisy.mean(axis=0), quiet[0], atol=0.4)
    many = pl.simulate(scene(), space="srgb", angle=np.zeros(400), noise=0.5).values
    assert many.min() == 0
    assert many.max() == 1


def test_what_has_no_colour(refuses):
    refuses(ValueError, "ellipsometry", pl.simulate, scene(signal="psi-delta", angle=60.0), space="srgb")
    refuses(ValueError, "`space` must be one of", pl.simulate, scene(), space="hsv")
    refuses(TypeError, "wavelength", pl.simulate, scene(), [500.0], space="srgb")
    refuses(TypeError, "angle", pl.simulate, scene(), [500.0], angle=[1.0])


def test_film_colour_takes_what_reflectance_takes(refuses):
    """By the sum over wavelengths of 1 nm of the reflectance that the tmm package confirms elsewhere."""
    observed = sensor("1931", "D65")
    for thickness, layer in ((300.0, "SiO2"), ([100.0, 60.0], ["SiO2", "TiO2"])):
        with jax.enable_x64(True):
            spectrum = pl.reflectance(observed.wavelength, thickness, layer, "Si", angle=30.0)
        expected = np.asarray(spectrum) @ observed.weights
        np.testing.assert_allclose(
            pl.film_colour(thickness, layer, "Si", angle=30.0, method="uniform-64").xyz, expected, atol=2e-3
        )
    refuses(ValueError, "pl.film_colour", film.film_colour, 300.0, "SiO2", 3.9)
    refuses(ValueError, "uniform-64", pl.film_colour, [1.0, 2.0], [1.5, 2.0], 3.9, method="gaussians-8")
    refuses(UsageError, "negative", pl.film_colour, -300.0, "SiO2", "Si")
    refuses(UsageError, "index -4 has a negative real part", pl.film_colour, 300.0, "SiO2", -4.0)
    refuses(UsageError, "index 0 is that of no medium", pl.film_colour, 300.0, np.array([1.5, 0.0]), "Si")
