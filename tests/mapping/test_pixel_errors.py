"""Errors and status of pixels beside `pellicle.fit` of each, from the same minima."""

import numpy as np
import pytest
from minima_by_search import searched

import pellicle as pl
from pellicle.data.cube import Cube
from pellicle.fitting.noise import integrated_time, local_noise, student
from pellicle.mapping.pixel_covariance import Normal, solve, solve_within
from pellicle.mapping.pixel_errors import PixelErrors
from pellicle.mapping.pixel_fits import STATUSES
from pellicle.mapping.pixel_noise import correlation, students, typical_noise
from pellicle.mapping.pixels import prepare

NM, SIGMA = np.linspace(400, 900, 100), 0.003
OXIDE = pl.Scene(pl.Layer(1.46, pl.Free(0, 1600)), "Si")


def reflectance(thickness, n=1.46, **layer):
    return pl.simulate(pl.Scene(pl.Layer(n, thickness, **layer), "Si"), wavelength=NM).values


def check(cube, scene, whole=None):
    """Compare every pixel with its own fit; `whole` is a cube without missing points."""
    model = prepare(whole or cube, scene)
    data, minima, fits = searched(model, cube)
    found = PixelErrors(model).fits(data, minima)
    words = [STATUSES[code] for code in found.status]
    assert words == [str(fit.status) for fit in fits]
    for j, p in enumerate(model.parameters):
        own = [fit[p.name] for fit in fits]
        assert found.stderr[:, j] == pytest.approx([each.stderr for each in own], rel=0.01)
        assert found.stderr_noise[:, j] == pytest.approx([each.stderr_noise for each in own], rel=0.01)
    assert found.chi2_reduced == pytest.approx([fit.chi2_reduced for fit in fits], rel=1e-6)
    assert found.rms == pytest.approx([fit.rms for fit in fits], rel=1e-6)
    for i, fit in enumerate(fits):
        near = [rival.delta_chi2 for rival in fit.rivals[:3] if rival.delta_chi2 < 100]
        assert found.delta_chi2[i, 1 : len(near) + 1] == pytest.approx(near, rel=0.02)
    return words


def noisy(rows, rng, size=SIGMA):
    return np.clip(rows + size * rng.normal(size=np.shape(rows)), 0, None)


def test_status_and_errors_are_those_of_a_fit_of_each_pixel():
    rng = np.random.default_rng(0)
    rows = noisy([reflectance(d) for d in (0.5, 3.0, 12.0, 90.0, 200.0, 700.0, 1400.0)], rng)
    rows = [*rows, *noisy([reflectance(d, n) for d, n in ((500, 1.48), (300, 1.6), (900, 2.0))], rng)]
    rows += [*noisy([reflectance(400.0), reflectance(800.0)], rng, 5 * SIGMA)]
    rows += [*noisy([reflectance(600.0, thickness_spread=20.0)], rng)]
    outliers = noisy(reflectance(550.0), rng)
    outliers[::20] += 0.1
    gaps = noisy(reflectance(650.0), rng)
    gaps[[3, 4, 50]] = np.nan
    values = np.array([*rows, outliers, gaps])
    cube = Cube({"values": values, "sigma": np.full(values.shape, SIGMA)}, NM, dims=("site",))
    whole = Cube({"values": values[:3], "sigma": np.full((3, 100), SIGMA)}, NM, dims=("site",))
    words = check(cube, OXIDE, whole)
    assert {"converged", "misfit", "not-identifiable"} <= set(words)


@pytest.mark.slow
def test_noise_that_is_not_given_is_that_of_the_residuals():
    rng = np.random.default_rng(1)
    values = noisy([reflectance(d, n) for d, n in ((60, 1.46), (400, 1.46), (900, 1.47), (700, 1.6))], rng)
    check(Cube({"values": values}, NM, dims=("site",)), OXIDE)


@pytest.mark.slow
def test_drifting_scale_and_offset():
    rng = np.random.default_rng(2)
    tilt = 1 + 0.1 * np.linspace(-1, 1, 100)
    values = noisy([0.8 * tilt * reflectance(d) + 0.02 for d in (60, 250, 600, 1000, 1400)], rng)
    scene = pl.Scene(*OXIDE.layers, "Si", instrument=pl.Instrument(scale="slow", offset="slow"))
    words = check(Cube({"values": values}, NM, dims=("site",)), scene)
    assert "not-identifiable" in words  # fewer fringes than a drift can imitate


@pytest.mark.slow
def test_opaque_layers_have_no_error():
    rng = np.random.default_rng(3)
    values = noisy([reflectance(d, 1.8 + 0.3j) for d in (100, 400, 700, 900, 1200, 1500)], rng)
    cube = Cube({"values": values, "sigma": np.full(values.shape, SIGMA)}, NM, dims=("site",))
    words = check(cube, pl.Scene(pl.Layer(1.8 + 0.3j, pl.Free(0, 1600)), "Si"))
    assert "not-identifiable" in words


@pytest.mark.slow
def test_thickness_and_index():
    rng = np.random.default_rng(4)
    values = noisy([reflectance(d, n) for d, n in ((30, 1.5), (200, 1.4), (600, 1.9), (1200, 1.6))], rng)
    cube = Cube({"values": values, "sigma": np.full(values.shape, SIGMA)}, NM, dims=("site",))
    check(cube, pl.Scene(pl.Layer(pl.Free(1.3, 2.3), pl.Free(0, 1600)), "Si"))


@pytest.mark.slow
@pytest.mark.parametrize("given", [True, False])
def test_psi_and_delta_at_two_angles(given):
    rng, nm, angles = np.random.default_rng(5), np.linspace(400, 900, 40), np.array([65.0, 75.0])
    psi, delta = np.zeros((2, 4, 40, 2))
    for i, d in enumerate((20.0, 110.0, 400.0, 800.0)):
        for j, angle in enumerate(angles.tolist()):
            light = pl.Light(signal="psi-delta", angle=angle)
            own = pl.simulate(pl.Scene(pl.Layer(1.46, d), "Si", light=light), wavelength=nm)
            psi[i, :, j], delta[i, :, j] = own.values, own.delta
    psi, delta = psi + 0.05 * rng.normal(size=psi.shape), delta + 0.1 * rng.normal(size=psi.shape)
    arrays = {"values": psi, "delta": (delta + 180) % 360 - 180}
    if given:
        arrays |= {"sigma": np.full(psi.shape, 0.05), "delta_sigma": np.full(psi.shape, 0.1)}
    check(Cube(arrays, nm, "psi-delta", ("site",), angles), pl.Scene(pl.Layer(1.46, pl.Free(0, 1000)), "Si"))


@pytest.mark.parametrize("points", [7, 51, 100])
def test_typical_noise_is_the_median_of_the_local_noise(points):
    values = np.random.default_rng(0).normal(size=(20, points))
    assert typical_noise(values) == pytest.approx([np.median(local_noise(row)) for row in values])


def test_correlation_by_sums_of_products_is_that_by_a_fourier_transform():
    rng = np.random.default_rng(0)
    white, walks = rng.normal(size=(20, 100)), np.cumsum(rng.normal(size=(20, 100)), axis=1)
    series = np.concatenate([white, white + 0.3 * walks, np.zeros((1, 100))])
    expected = [integrated_time(row[:, None]) for row in series]
    assert correlation(series[..., None], [np.arange(100)]) == pytest.approx(expected)


def test_students_of_many_degrees_of_freedom():
    freedom = np.array([1.0, 3.3, 60.0, 2000.0, np.inf])
    expected = [student(each, 6.0) for each in freedom.tolist()]
    assert students(freedom, 6.0) == pytest.approx(expected, rel=1e-4)


def test_solutions_stay_on_bounds():
    # without bounds (1, -1); with the second held at 0 the first solves 2 x = 1
    matrix, right = np.array([[[2.0, 1.0], [1.0, 2.0]]]), np.array([[1.0, -1.0]])
    lower, upper = np.array([[-9.0, 0.0]]), np.full((1, 2), 9.0)
    free = solve(matrix, right)
    assert free == pytest.approx(np.array([[1.0, -1.0]]))
    found = solve_within(Normal(matrix, right), lower, upper, free)
    assert found == pytest.approx(np.array([[0.5, 0.0]]))
