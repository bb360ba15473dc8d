"""Fits of colours against films simulated with tmm."""

import dataclasses

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import sensor
from pellicle.colour.spaces import camera_encoding, encoding
from pellicle.data.colours import CameraMatrix, Colours
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.colour_measurements import measured_colours
from pellicle.fitting.film.problem import make

from ...airy import airy
from ...by_tmm import films
from ...differences import derivative

EYE = sensor("1931", "D65")
NM = EYE.wavelength[::5]
SENSOR = NM, EYE.weights[::5] / EYE.weights[::5, 1].sum()
ANGLES = np.array([0.0, 40.0, 60.0])
EXACT = pl.Uncertainty.none()
SIGMA = 1.5 / 255


def scene(scale=1.0, thickness=(50.0, 700.0)):
    return pl.Scene(
        pl.Layer(1.46, pl.Free(*thickness)), 3.9, instrument=pl.Instrument(scale=scale), uncertainty=EXACT
    )


def xyz(thickness, angles=ANGLES):
    """Colours of a film of 1.46 on 3.9 by tmm, (angles, 3)."""
    return np.array([films("sp", NM, [1, 1.46, 3.9], [thickness], x) for x in angles]) @ SENSOR[1]


def colours(thickness, code=None, angles=ANGLES, exposure=1.0, seed=0, sigma=SIGMA, **words):
    """The film's colours with noise, in a space that is sRGB by default."""
    code = code or encoding("srgb", SENSOR[1].sum(axis=0))
    channels = exposure * code.channels(xyz(thickness, angles))
    values = code.encode(channels, code.roots(channels))
    values = values + sigma * np.random.default_rng(seed).standard_normal(values.shape)
    values = np.clip(values, 0, 1) if code.clips else values
    noise = np.full(values.shape, sigma)
    return Colours(values, SENSOR, **{"angle": angles, "sigma": noise, **words})


@pytest.mark.slow
@pytest.mark.parametrize(("space", "sigma"), [("srgb", SIGMA), ("lab", 0.5), ("xyz", 0.003)])
def test_three_angles_determine_the_thickness(space, sigma):
    data = colours(432.0, encoding(space, SENSOR[1].sum(axis=0)), sigma=sigma, space=space)
    fit = pl.fit(data, scene())
    assert fit.status == "converged"
    assert abs(fit["thickness"].value - 432.0) < 3 * fit["thickness"].stderr < 10.0
    assert fit.probability > 0.999
    # ΔE*ab by the standard's own formula
    if space == "lab":
        apart = np.linalg.norm(fit.model - data.values, axis=1)
        np.testing.assert_allclose(fit.parts[0].curve.difference, apart, atol=1e-9)


@pytest.mark.slow
def test_one_colour_of_unknown_exposure_has_several_thicknesses():
    data = colours(432.0, angles=ANGLES[:1])
    fit = pl.fit(data, scene("free"))
    orders = [(fit["thickness"].value, fit.probability)]
    orders += [(rival.parameters["thickness"], rival.probability) for rival in fit.rivals]
    assert fit.status == "ambiguous"
    assert min(abs(nm - 432.0) for nm, share in orders if share > 0.01) < 10.0
    assert sum(share for _, share in orders) == pytest.approx(1.0)
    # the posterior on a grid; the prior of the exposure is uniform in its logarithm
    grid, gains = np.arange(50.0, 700.0, 2.0), np.geomspace(0.5, 2.0, 801)
    seen = airy(NM, grid[:, None], 1.46, 3.9) @ SENSOR[1]
    np.testing.assert_allclose(seen[125], xyz(300.0, ANGLES[:1])[0], rtol=1e-9)
    code = encoding("srgb", SENSOR[1].sum(axis=0))
    density = np.empty(len(grid))
    for i, colour in enumerate(seen):
        channels = gains[:, None] * code.channels(colour)
        shown = code.encode(channels, code.roots(channels))
        chi2 = np.sum(((shown - data.values) / SIGMA) ** 2, axis=1)
        density[i] = np.trapezoid(np.exp(-chi2 / 2), np.log(gains))
    for nm, share in orders:
        if share > 0.01:
            own = density[np.abs(grid - nm) < 40].sum() / density.sum()
            assert own == pytest.approx(share, abs=0.1)


@pytest.mark.slow  # compiles a scene of its own
def test_a_camera_with_free_white_balance():
    gains = np.array([0.8, 1.0, 1.3])
    code = camera_encoding(2.2)._replace(linear=np.diag(1 / SENSOR[1].sum(axis=0)))
    channels = 0.6 * gains * code.channels(xyz(300.0))
    values = code.encode(channels, code.roots(channels))
    fit = pl.fit(Colours(values, SENSOR, "rgb", angle=ANGLES, gamma=2.2, white_balance="free"), scene(1.0))
    assert fit["thickness"].value == pytest.approx(300.0, abs=0.05)
    found = [fit[f"instrument.white_balance_{letter}"].value for letter in "RGB"]
    np.testing.assert_allclose(found, 0.6 * gains, rtol=1e-3)


@pytest.mark.slow  # several fits of a chart; cameras are tested in tests/data and tests/recipes
def test_a_chart_says_what_an_unknown_camera_sees():
    matrix = np.array([[0.6, 0.2, 0.1], [-0.2, 1.0, 0.1], [0.05, -0.1, 0.9]])
    values = xyz(300.0) @ matrix.T
    sigma = np.full((3, 3), 1e-3)
    cameras = (CameraMatrix(matrix, size * np.eye(9)) for size in (1e-6, 0.0))
    by_chart, alone = (
        pl.fit(Colours(values, SENSOR, "rgb", angle=ANGLES, sigma=sigma, camera=camera), scene())
        for camera in cameras
    )
    assert by_chart["thickness"].value == pytest.approx(300.0, abs=0.05)
    # the error of the chart adds to that of the colours
    assert by_chart["thickness"].stderr > 1.02 * alone["thickness"].stderr


@pytest.mark.slow
def test_clipped_channels_are_limits():
    bright = colours(300.0, exposure=3.0)
    assert np.any(bright.values == 1.0)
    fit = pl.fit(bright, scene("free"))
    assert fit["thickness"].value == pytest.approx(300.0, abs=3 * fit["thickness"].stderr)
    assert fit["instrument.scale"].value == pytest.approx(3.0, rel=0.02)


@pytest.mark.slow
def test_the_camera_clips_the_model_too():
    """A soap film of a colour outside sRGB: red is 0.004 by noise, where the film has less than none."""
    nm, water, noise = NM, 1.333, np.array([0.004, 0.0, 0.0])
    r = (1 - water) / (1 + water)
    wave = np.exp(4j * np.pi * water * 230.0 / nm)
    code = encoding("srgb", SENSOR[1].sum(axis=0))
    channels = code.channels(np.abs(r * (1 - wave) / (1 - r * r * wave)) ** 2 @ SENSOR[1])
    assert channels[0] < -0.005
    values = np.clip(code.encode(channels, code.roots(channels)), 0, 1) + noise
    film = pl.Scene(pl.Layer(water, pl.Free(50.0, 700.0)), 1.0)
    fit = pl.fit(Colours(values[None], SENSOR, angle=np.zeros(1)), film)
    assert fit["thickness"].value == pytest.approx(230.0, abs=1.0)
    assert fit.model[0, 0] == 0.0
    # with an unknown exposure red must not pull it to 0
    brighter = np.clip(code.encode(9 * channels, code.roots(9 * channels)), 0, 1) + noise
    free = dataclasses.replace(film, instrument=pl.Instrument(scale="free"))
    fit = pl.fit(Colours(brighter[None], SENSOR, angle=np.zeros(1)), free)
    assert fit["instrument.scale"].value == pytest.approx(9.0, rel=0.1)
    names = [row.name for row in fit.budget]
    assert {"balance of red", "flare or black level", "saturation", "slope of the lamp"} <= {*names}
    assert "scale" not in names  # it is free


@pytest.mark.slow
def test_colours_far_from_those_of_the_film_are_a_misfit_whatever_their_noise():
    right = colours(300.0, sigma=0.12, seed=0)
    film = colours(300.0).values
    near, far = (
        dataclasses.replace(right, values=np.clip(film + size * np.array([1.0, -1.0, 1.0]), 0, 1))
        for size in (0.01, 0.12)
    )
    fits = [pl.fit(data, scene(thickness=(290.0, 310.0))) for data in (near, far)]
    assert [np.max(fit.parts[0].curve.difference) > 10 for fit in fits] == [False, True]
    assert all(fit.chi2_reduced < 3 for fit in fits)
    assert [fit.status == "misfit" for fit in fits] == [False, True]


def test_channels_of_an_unknown_camera_determine_nothing():
    code = camera_encoding()._replace(linear=np.diag(1 / SENSOR[1].sum(axis=0)))
    values = code.channels(xyz(300.0))
    known, unknown = (
        pl.fit(Colours(values, SENSOR, "rgb", angle=ANGLES, calibrated=known), scene())
        for known in (True, False)
    )
    assert known.status == "converged"
    assert unknown.status == "not-identifiable"
    assert "The camera is not calibrated" in unknown.verdict


@pytest.mark.slow  # two kinds of data, and each alone
def test_a_joint_fit_with_a_spectrum_narrows_both():
    nm = np.linspace(500.0, 700.0, 41)
    values = films("s", nm, [1, 1.46, 3.9], [432.0])
    noise = 0.01 * np.random.default_rng(1).standard_normal(nm.size)
    spectrum = pl.Spectrum(nm, values + noise, "R", sigma=np.full(nm.size, 0.01))
    parts = colours(432.0), spectrum
    alone = [pl.fit(part, scene())["thickness"].stderr for part in parts]
    both = pl.fit(list(parts), scene())
    weights = sum(1 / error**2 for error in alone)
    assert [part.name for part in both.parts] == ["srgb", "R"]
    assert both["thickness"].value == pytest.approx(432.0, abs=3 * both["thickness"].stderr)
    assert both["thickness"].stderr == pytest.approx(weights**-0.5, rel=0.25)


def test_the_jacobian_is_that_of_finite_differences():
    with jax.enable_x64(True):
        (view,) = make(measured_colours(colours(300.0, exposure=0.8), scene("free"))).views
        at = view.local(np.array([320.0]))
        rows = view.jacobian(at)

        def weighted(thickness):  # with the exposure where it was
            exposed = at.exposure * at.coefficients[0] * view.local(thickness).colours
            return np.einsum("pij,pj->pi", view.data.frame, exposed @ view.data.response.channels.T).ravel()

        np.testing.assert_allclose(rows[:, 0], derivative(weighted, np.array([320.0]), 1e-3), rtol=1e-5)
        (scale,) = view.nuisances(at)
        expected = weighted(np.array([320.0]))
        np.testing.assert_allclose(rows[:, 1] * scale.value / scale.prior_sd, expected, rtol=1e-9)


def test_different_colours_at_one_angle_are_refused(write, refuses):
    """A column that was ignored may have the angles."""
    path = write("Winkel,R,G,B\n0,0.5,0.4,0.3\n60,0.3,0.4,0.5\n")
    for data, words in (
        (Colours(np.array([[0.5, 0.4, 0.3], [0.3, 0.4, 0.5]]), SENSOR), "2 colours of one film at one angle"),
        (pl.read_colours(path), r"deviations \(ignored: Winkel\)"),
    ):
        refuses(DataError, f"{words}.* a column angle_deg", pl.fit, data, scene())


@pytest.mark.parametrize(
    ("own", "message"),
    [
        ({"instrument": pl.Instrument(scale="slow")}, "a colour has one scale"),
        ({"instrument": pl.Instrument(offset="free")}, "a colour has no offset"),
        ({"light": pl.Light(angle=pl.Free(0, 60))}, "several angles of incidence"),
        ({"light": pl.Light(angle=20.0)}, "contradict `angle=20`"),
    ],
)
def test_refusals(own, message, refuses):
    layer = pl.Layer(1.46, pl.Free(50, 700))
    values = np.full((3, 3), 0.5)
    refuses(UsageError, message, pl.fit, Colours(values, SENSOR, angle=ANGLES), pl.Scene(layer, 3.9, **own))
