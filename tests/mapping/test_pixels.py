"""Minima of pixels against `pellicle.fit`, pixel by pixel."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.data.cube import Cube
from pellicle.errors import DataError
from pellicle.mapping.pixels.data import pixel_data
from pellicle.mapping.pixels.fit import fit_pixels, prepare, spectrum
from pellicle.mapping.pixels.results import CODES
from pellicle.mapping.pixels.search import minima
from pellicle.scene.priors import Normal

NM, SIGMA = np.linspace(420.0, 780.0, 48), 0.002
FREE = pl.Free(20, 900)
ALL = (slice(None), slice(None))


def cube_of(thickness, index=1.46, scale=1.0, offset=0.0, **arrays) -> Cube:
    """A row of pixels of a layer on a substrate of index 3.9, with noise."""
    clean = np.stack([np.asarray(pl.reflectance(NM, d, index, 3.9)) for d in thickness])
    noise = np.random.default_rng(0).normal(0, SIGMA, clean.shape)
    values = np.reshape(scale, (-1, 1)) * clean + offset + noise
    return Cube({"values": values[None], **arrays}, NM)


def found(cube, scene):
    """The model of a cube, and the minima of its pixels."""
    model = prepare(cube, scene)
    with jax.enable_x64(True):
        return model, minima(model.search, pixel_data(cube.pixels(ALL), model.problem.views[0].noise))


def fit_of(cube, scene, pixel):
    block = cube.pixels((slice(0, 1), slice(pixel, pixel + 1)))
    return pl.fit(spectrum(cube, {name: rows[0] for name, rows in block.items()}), scene)


def check(cube, scene, pixels, share=1e-3, best=None):
    """The best minimum is that of `fit`, within a `share` of its standard error by noise."""
    model, best = best or found(cube, scene)
    for pixel in pixels:
        fit = fit_of(cube, scene, pixel)
        for j, p in enumerate(model.parameters):
            assert best.values[pixel, 0, j] == pytest.approx(
                fit[p.name].value, abs=share * fit[p.name].stderr_noise
            )
    assert best.converged[list(pixels), 0].all()
    return best


@pytest.fixture(scope="module")
def wedge():
    """Pixels of every thickness, one without data, some without bands; σ is given."""
    cube = cube_of(np.linspace(30, 880, 60), sigma=np.full(NM.size, SIGMA))
    values = cube.arrays["values"]
    values[0, 5], values[0, 6, 10:14], values[0, 7, ::2], values[:, :, 30] = np.nan, np.nan, np.nan, np.nan
    scene = pl.Scene(pl.Layer(1.46, FREE), 3.9)
    return cube, scene, *found(cube, scene)


@pytest.mark.slow  # compiles for 7 s; test_pixel_errors.py compares the same fits
def test_thickness_is_that_of_fit(wedge):
    cube, scene, model, best = wedge
    check(cube, scene, (6, 7, 59), best=(model, best))
    known = np.arange(60) != 5
    truth = np.linspace(30, 880, 60)
    assert np.all(np.abs(best.values[known, 0, 0] - truth[known]) < 1.0)


@pytest.mark.slow
def test_a_pixel_without_data_has_no_numbers(wedge):
    cube, _, model, best = wedge
    assert np.isnan(best.values[5]).all()
    assert np.isinf(best.deviance[5]).all()
    assert not best.converged[5].any()
    fits = fit_pixels(model, cube, (slice(0, 1), slice(4, 7)))
    assert fits.status[1] == CODES["no-data"]
    assert np.isnan(fits.values[1]).all()
    assert fits.status[0] == fits.status[2] == CODES["converged"]
    # in another block, beside other pixels, the same answer
    assert fits.values[2] == pytest.approx(best.values[6, 0], abs=1e-6)


def test_deviance_is_the_misfit_of_the_model(wedge):
    cube, _, _, best = wedge
    residual = (np.nan_to_num(cube.arrays["values"][0]) - best.model) / SIGMA
    own = np.where(np.isfinite(cube.arrays["values"][0]), residual, 0.0)
    known = np.arange(60) != 5
    assert best.deviance[known, 0] == pytest.approx(np.sum(own[known] ** 2, axis=1), rel=1e-6)
    assert np.all(np.diff(best.deviance[known], axis=1) >= 0)


def test_slope_is_that_of_the_signal(wedge):
    _, _, _, best = wedge
    step = 1e-3
    d = best.values[20, 0, 0]
    moved = [np.asarray(pl.reflectance(NM, d + s, 1.46, 3.9)) for s in (-step, step)]
    assert best.slope[20, :, 0] == pytest.approx((moved[1] - moved[0]) / (2 * step), abs=1e-7)


@pytest.mark.slow  # compiles a scene of its own; test_pixel_errors.py has one in every run
def test_rivals_are_those_of_fit():
    """Thin layers of unknown scale: several thicknesses explain them nearly as well."""
    few = slice(None, None, 4)
    thickness = np.linspace(100, 400, 12)
    whole = cube_of(thickness, sigma=np.full(NM.size, 0.06), scale=0.9, offset=0.005)
    arrays = {"values": whole.arrays["values"][..., few], "sigma": whole.arrays["sigma"][few]}
    cube = Cube(arrays, NM[few])
    scene = pl.Scene(pl.Layer(1.46, FREE), 3.9, instrument=pl.Instrument(scale="free", offset="free"))
    best = check(cube, scene, (1,))
    for pixel in (1, 3):
        prepared = pl.fitting.prepare(
            spectrum(cube, {k: x[pixel] for k, x in cube.pixels(ALL).items()}), scene
        )
        with jax.enable_x64(True):
            starts = np.linspace(25, 895, 30)[:, None]
            every = pl.fitting.solve(prepared, starts)
        values, deviance = np.asarray(every.values)[:, 0], np.asarray(every.deviance)
        listed = best.converged[pixel]
        assert listed.sum() > 1
        for value, own in zip(best.values[pixel, listed, 0], best.deviance[pixel, listed], strict=True):
            nearest = np.argmin(np.abs(values - value))
            # polished to 1e-3 of the distance to the best; with a σ of 0.06 minima are flat
            assert value == pytest.approx(values[nearest], abs=3.0)
            assert own == pytest.approx(deviance[nearest], rel=1e-3, abs=0.05)
        assert best.deviance[pixel, 0] == pytest.approx(deviance.min(), abs=1e-6)


@pytest.mark.slow  # compiles a search of its own
def test_priors_weigh_against_the_noise_of_the_residuals():
    prior = Normal(1.60, 0.004)
    scene = pl.Scene(pl.Layer(pl.Free(1.3, 2.0, prior=prior), FREE), 3.9)
    check(cube_of([350.0, 420.0], 1.62), scene, (1,), share=0.05)


@pytest.mark.slow  # compiles a scene of its own; test_pixel_errors.py has one in every run
def test_ellipsometry_is_that_of_fit():
    """Ψ and Δ at two angles, with errors of their own."""
    nm, angle = np.linspace(420.0, 780.0, 20), np.array([65.0, 72.0])
    rng, thickness = np.random.default_rng(1), np.array([60.0, 210.0, 480.0])
    light = pl.Light(np.repeat(nm, 2), np.tile(angle, nm.size), "psi-delta")
    each = [
        pl.simulate(pl.Scene(pl.Layer(1.46, d), 3.9, light=light), wavelength=light.wavelength)
        for d in thickness
    ]
    psi, delta = (
        np.stack(x).reshape(1, 3, nm.size, 2) for x in zip(*[(s.values, s.delta) for s in each], strict=True)
    )
    arrays = {
        "values": psi + rng.normal(0, 0.05, psi.shape),
        "delta": delta + rng.normal(0, 0.2, psi.shape),
        "sigma": np.full(psi.shape, 0.05),
        "delta_sigma": np.full(psi.shape, 0.2),
    }
    cube = Cube(arrays, nm, signal="psi-delta", angle=angle)
    check(cube, pl.Scene(pl.Layer(1.46, FREE), 3.9), (0, 1, 2))


def test_a_cube_without_data_is_refused():
    cube = Cube({"values": np.full((2, 2, NM.size), np.nan)}, NM)
    with pytest.raises(DataError, match="no pixel has data"):
        prepare(cube, pl.Scene(pl.Layer(1.46, FREE), 3.9))
