"""Pixels of cubes beside `pellicle.fit` of each: minima, errors and status."""

from typing import Any

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.data.cube import Cube
from pellicle.errors import DataError
from pellicle.fitting.batch.data import CODES, STATUSES, batch_data
from pellicle.fitting.batch.effects import _simulation
from pellicle.fitting.batch.search import minima
from pellicle.fitting.film.extended_scene import Number, Program
from pellicle.fitting.film.systematic_effects import SimulatedEffect
from pellicle.fitting.problem import Noise
from pellicle.mapping.pixels import _example, bands_off, fit_pixels, prepare, spectrum

from .. import by_tmm
from ..airy import airy

NM, SIGMA = np.linspace(400, 900, 100), 0.003
FREE = pl.Free(0, 1600)
OXIDE = pl.Scene(pl.Layer(1.46, FREE), "Si")


def films(*films: Any, seed: int = 0, size: float = SIGMA, **layer: Any) -> np.ndarray:
    """Noisy reflectances of layers on silicon, each a thickness or (thickness, n)."""
    each = [film if isinstance(film, tuple) else (film, 1.46) for film in films]
    scenes = [pl.Scene(pl.Layer(n, float(d), **layer), "Si") for d, n in each]
    clean = np.array([pl.simulate(scene, wavelength=NM).values for scene in scenes])
    return np.clip(clean + size * np.random.default_rng(seed).normal(size=clean.shape), 0, None)


def cube_of(values: np.ndarray, sigma: float | None = SIGMA) -> Cube:
    known = {} if sigma is None else {"sigma": np.full(values.shape, sigma)}
    return Cube({"values": values, **known}, NM, dims=("site",))


def every_kind() -> Cube:
    """Thin and thick, of another index, with outliers and missing points, uneven, and with more noise."""
    values = films(3, 12, 90, 200, 700, 1400, (500, 1.48), (300, 1.6), (900, 2.0), 550, 650)
    values[9, ::20] += 0.1
    values[10, [3, 4, 50]] = np.nan
    uneven = films(600, thickness_spread=20.0)
    return cube_of(np.concatenate([values, uneven, films(400, 800, size=5 * SIGMA)]))


def drifting() -> Cube:
    tilt = 1 + 0.1 * np.linspace(-1, 1, 100)
    return cube_of(0.8 * tilt * films(60, 250, 600, 1000, 1400, seed=2) + 0.02, None)


def angles(given: bool) -> Cube:
    """Ψ and Δ at two angles."""
    rng, nm, angles = np.random.default_rng(5), np.linspace(400, 900, 40), np.array([65.0, 75.0])
    light = pl.Light(np.repeat(nm, 2), np.tile(angles, 40), "psi-delta")
    scenes = [pl.Scene(pl.Layer(1.46, d), "Si", light=light) for d in (20.0, 110.0, 400.0, 800.0)]
    seen = [pl.simulate(scene, light.wavelength) for scene in scenes]
    psi, delta = (np.reshape([getattr(s, name) for s in seen], (4, 40, 2)) for name in ("values", "delta"))
    psi, delta = psi + 0.05 * rng.normal(size=psi.shape), delta + 0.1 * rng.normal(size=psi.shape)
    arrays = {"values": psi, "delta": (delta + 180) % 360 - 180}
    if given:
        arrays |= {"sigma": np.full(psi.shape, 0.05), "delta_sigma": np.full(psi.shape, 0.1)}
    return Cube(arrays, nm, "psi-delta", ("site",), angles)


def bare() -> Cube:
    """A substrate of index 1.5 without a film, and with one."""
    scenes = [pl.Scene(pl.Layer(n, 300.0), 1.5) for n in (1.5, 1.5, 1.7)]
    clean = np.array([pl.simulate(scene, wavelength=NM).values for scene in scenes])
    return cube_of(clean + 5e-4 * np.random.default_rng(6).normal(size=clean.shape), 5e-4)


def index(prior: Any = None) -> pl.Scene:
    return pl.Scene(pl.Layer(pl.Free(1.3, 2.3, prior=prior), FREE), "Si")


SLOW = pl.Instrument(scale="slow", offset="slow")
CASES = {
    "every kind": (every_kind, OXIDE, {"converged", "misfit", "not-identifiable"}),
    "noise that is not given": (
        lambda: cube_of(films(60, 400, (900, 1.47), (700, 1.6), seed=1), None),
        OXIDE,
        {"converged"},
    ),
    # fewer fringes than a drift can imitate
    "drifting scale and offset": (
        drifting,
        pl.Scene(OXIDE.layers, "Si", instrument=SLOW),
        {"not-identifiable"},
    ),
    "opaque": (
        lambda: cube_of(films(*((d, 1.8 + 0.3j) for d in (100, 400, 700, 900, 1200, 1500)), seed=3)),
        pl.Scene(pl.Layer(1.8 + 0.3j, FREE), "Si"),
        {"not-identifiable"},
    ),
    "thickness and index": (
        # of the last, (110 nm, 2.16) is worse by 103 in χ², and by 4 with the systematic effects
        lambda: cube_of(films((30, 1.5), (200, 1.4), (600, 1.9), (1200, 1.6), (140, 1.7), seed=4)),
        index(),
        {"converged", "ambiguous"},
    ),
    "prior and noise of the residuals": (
        lambda: cube_of(films((350, 1.62), (420, 1.62)), None),
        index(pl.priors.Normal(1.60, 0.004)),
        {"converged"},
    ),
    "no film": (lambda: cube_of(films(0, 0, 20)), OXIDE, {"not-identifiable", "converged"}),
    "the index of the substrate": (
        bare,
        pl.Scene(pl.Layer(pl.Free(1.3, 2.3), FREE), 1.5),
        {"not-identifiable", "converged"},
    ),
    "psi and delta": (lambda: angles(True), OXIDE, {"converged"}),
    "psi and delta without sigma": (lambda: angles(False), OXIDE, {"converged"}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_pixels_are_those_of_fit(name):
    make, scene, words = CASES[name]
    cube = make()
    model, where = prepare(cube, scene), tuple(slice(None) for _ in cube.shape)
    found, block = fit_pixels(model, cube, where), cube.pixels(where)
    fits = [
        pl.fit(spectrum(cube, {key: rows[i] for key, rows in block.items()}), scene)
        for i in range(len(found.status))
    ]
    assert [STATUSES[code] for code in found.status] == [str(fit.status) for fit in fits]
    assert words <= {str(fit.status) for fit in fits}
    for i, fit in enumerate(fits):
        determined = all(np.isfinite(p.stderr) for p in fit.free)
        for j, p in enumerate(model.parameters):
            own = fit[p.name]
            # effects are interpolated between thicknesses 1/96 of a fringe apart: within 10 %
            if determined or p.key == "thickness":  # on a plateau any point is a minimum
                assert found.stderr[i, j] == pytest.approx(own.stderr, rel=0.1), (i, p.name)
                assert found.stderr_noise[i, j] == pytest.approx(own.stderr_noise, rel=0.1), (i, p.name)
            if determined:  # on a plateau any point is a minimum
                assert found.values[i, j] == pytest.approx(own.value, abs=1e-2 * own.stderr_noise)
                assert found.chi2_reduced[i] == pytest.approx(fit.chi2_reduced, rel=1e-4)
                assert found.rms[i] == pytest.approx(fit.rms, rel=1e-4)
        thickness = found.minima[i, :, model.problem.thickness_axis]
        for rival in fit.rivals if determined else ():  # those that both have polished
            away = np.abs(thickness - rival.parameters["thickness"])
            order = np.nanargmin(away)
            if away[order] < 0.01 and rival.delta_chi2 < 20:
                assert found.delta_chi2[i, order] == pytest.approx(rival.delta_chi2, rel=0.02), i


TRUTH = np.linspace(30, 880, 60)


@pytest.fixture(scope="module")
def wedge():
    """Pixels of every thickness, one without data, some without bands; and their minima."""
    values = films(*TRUTH)
    values[5], values[6, 10:14], values[7, ::2], values[:, 30] = np.nan, np.nan, np.nan, np.nan
    cube = cube_of(values)
    model = prepare(cube, OXIDE)
    with jax.enable_x64(True):
        data = batch_data(cube.pixels((slice(None),)), model.problem.views[0].noise)
        return cube, model, minima(model.search, data)


@pytest.mark.slow
def test_a_pixel_without_data_has_no_numbers(wedge):
    cube, model, best = wedge
    assert np.isnan(best.values[5]).all()
    assert np.isinf(best.deviance[5]).all()
    assert not best.converged[5].any()
    fits = fit_pixels(model, cube, (slice(4, 7),))
    assert fits.status[1] == CODES["no-data"]
    assert np.isnan(fits.values[1]).all()
    assert fits.status[0] == fits.status[2] == CODES["converged"]
    # in another block, beside other pixels, the same answer
    assert fits.values[2] == pytest.approx(best.values[6, 0], abs=1e-6)


def test_the_deviance_is_the_misfit_of_the_model_at_the_truth(wedge):
    cube, _, best = wedge
    known, values = np.arange(60) != 5, cube.arrays["values"]
    assert np.all(np.abs(best.values[known, 0, 0] - TRUTH[known]) < 2.0)
    residual = np.where(np.isfinite(values), (np.nan_to_num(values) - best.model) / SIGMA, 0.0)
    assert best.deviance[known, 0] == pytest.approx(np.sum(residual[known] ** 2, axis=1), rel=1e-6)
    assert np.all(np.diff(best.deviance[known], axis=1) >= 0)


def test_noise_beyond_the_fringes_leaves_the_least_misfit():
    """Minima with large residuals, where steps by the slopes of the model alone do not end."""
    values, sigma = films(*np.linspace(60, 1400, 60), size=1.0, seed=8), 1.0
    cube = cube_of(values, sigma)
    model = prepare(cube, OXIDE)
    with jax.enable_x64(True):
        best = minima(model.search, batch_data(cube.pixels((slice(None),)), model.problem.views[0].noise))
    index: Any = pl.material("Si").index(NM)
    silicon = np.asarray(index.re) + 1j * np.asarray(index.im)
    every = airy(NM, np.arange(0, 1600.05, 0.1)[:, None], 1.46, silicon)
    misfit = np.sum(values**2, axis=1, keepdims=True) + np.sum(every**2, axis=1) - 2 * values @ every.T
    assert best.deviance[:, 0] == pytest.approx(misfit.min(axis=1) / sigma**2, abs=1e-5)
    assert best.converged[:, 0].all()


def test_slope_is_that_of_the_signal(wedge):
    _, _, best = wedge
    d, step = best.values[20, 0, 0], 1e-3
    below, above = (np.asarray(pl.reflectance(NM, d + s, 1.46, "Si")) for s in (-step, step))
    assert best.slope[20, :, 0] == pytest.approx((above - below) / (2 * step), abs=1e-7)


@pytest.mark.slow  # compiles a scene of its own
def test_rivals_are_all_minima_of_the_deviance():
    """Thin layers of unknown scale: several thicknesses explain them nearly as well."""
    instrument = pl.Instrument(scale="free", offset="free")
    scene = pl.Scene(pl.Layer(1.46, pl.Free(20, 900)), "Si", instrument=instrument)
    cube = Cube(
        {"values": 0.9 * films(127, 182)[:, ::8] + 0.005, "sigma": np.full((2, 13), 0.06)},
        NM[::8],
        dims=("site",),
    )
    model, block = prepare(cube, scene), cube.pixels((slice(None),))
    with jax.enable_x64(True):
        best = minima(model.search, batch_data(block, model.problem.views[0].noise))
        for pixel in range(2):
            prepared = pl.fitting.prepare(spectrum(cube, {key: x[pixel] for key, x in block.items()}), scene)
            every = pl.fitting.solve(prepared, np.linspace(25, 895, 30)[:, None])
            values, deviance = np.asarray(every.values)[:, 0], np.asarray(every.deviance)
            listed = best.converged[pixel]
            assert listed.sum() > 1
            for value, own in zip(best.values[pixel, listed, 0], best.deviance[pixel, listed], strict=True):
                nearest = np.argmin(np.abs(values - value))
                # polished to 1e-3 of the distance to the best; with a σ of 0.06 minima are flat
                assert value == pytest.approx(values[nearest], abs=3.0)
                assert own == pytest.approx(deviance[nearest], rel=1e-3, abs=0.05)
            assert best.deviance[pixel, 0] == pytest.approx(deviance.min(), abs=1e-6)


@pytest.mark.parametrize("gain", [1.0, 1.1])
def test_bands_that_are_off_at_most_pixels_are_named(gain):
    """An oxide by tmm, two of whose bands have a wrong gain."""
    index: Any = pl.material("Si").index(NM)
    silicon = np.asarray(index.re) + 1j * np.asarray(index.im)
    each = [by_tmm.films("s", NM, [1.0, 1.46, silicon], [d]) for d in np.linspace(120, 850, 12)]
    values = np.array(each) + SIGMA * np.random.default_rng(11).normal(size=(12, 100))
    values[:, [40, 71]] *= gain
    cube = cube_of(values)
    told = bands_off(prepare(cube, OXIDE), cube)
    assert bool(told) == (gain != 1)
    if told:
        assert f"--without-bands {NM[40]:.6g},{NM[71]:.6g}" in told[0]


def test_a_cube_without_data_is_refused(refuses):
    refuses(DataError, "no pixel has data", prepare, cube_of(np.full((4, 100), np.nan), None), OXIDE)


def test_a_dead_pixel_does_not_refuse_the_cube():
    """The first pixel that is looked at has values that no film reflects; noise may give all of them some."""
    values = np.full((9, 100), 0.3)
    values[4], values[1] = -0.5, 2.0
    assert np.all(_example(cube_of(values), {"values": values[[4, 1, 0]]}).values == 0.3)
    seen = _example(cube_of(values), {"values": values[[4, 1]]}).values
    assert np.all(seen == 0)


def test_noise_is_guessed_of_two_bands():
    weight = batch_data({"values": np.array([[0.2, 0.3]])}, Noise()).weight
    np.testing.assert_allclose(weight, 1 / (0.01 * 0.1))


def test_effects_share_the_unchanged_signal():
    narrow = SimulatedEffect("narrow", 2.0, "", Number(0), ((3.0, 0.4), (-3.0, 0.4), (0.0, -0.8)))
    rough = SimulatedEffect("rough", 1.5, "nm", Number(1), ((1.5, 1.7), (0.0, -1.7)))
    program = Program(None, OXIDE, [0, 1])
    plain = _simulation(program, [narrow, rough], [True, False], unchanged=True)
    face = _simulation(program, [narrow, rough], [False, True], unchanged=False)
    assert (len(plain.terms), len(face.terms)) == (3, 1)
    changes = np.zeros(2)
    for part in (plain, face):
        moved = [(effect.number.position, relative * effect.size) for effect, relative in part.terms]
        changes += part.weights @ [
            np.exp(by) * (5 if position else 1) if by else 7.0 for position, by in moved
        ]
    expected = 0.4 * (np.exp(3.0) + np.exp(-3.0)) - 0.8 * 7, 1.7 * (5 * np.exp(1.5) - 7)
    assert changes == pytest.approx(expected)
