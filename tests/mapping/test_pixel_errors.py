"""Errors and status of pixels beside `pellicle.fit` of each, from the same minima."""

from typing import Any, NamedTuple

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.data.cube import Cube
from pellicle.fitting.film.extended_scene import Number, Program
from pellicle.fitting.film.fit import fitted, measurements
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.search import search
from pellicle.fitting.film.systematic_effects import SimulatedEffect
from pellicle.fitting.progress import quiet
from pellicle.fitting.result import Fit
from pellicle.mapping.pixels.data import ORDERS, PixelData, PixelMinima
from pellicle.mapping.pixels.effects import _simulation
from pellicle.mapping.pixels.fit import PixelModel, prepare, spectrum
from pellicle.mapping.pixels.results import STATUSES

NM, SIGMA = np.linspace(400, 900, 100), 0.003
OXIDE = pl.Scene(pl.Layer(1.46, pl.Free(0, 1600)), "Si")


class Searched(NamedTuple):
    """Data and minima of pixels by the search of `pellicle.fit`, and its fits of them."""

    data: PixelData
    minima: PixelMinima
    fits: list[Fit]


def searched(model: PixelModel, cube: Cube) -> Searched:
    """Each pixel of a cube alone; points may be missing here and there."""
    block = cube.pixels(tuple(slice(None) for _ in cube.shape))
    pixels = [{name: values[i] for name, values in block.items()} for i in range(len(block["values"]))]
    with jax.enable_x64(True):
        rows = [_one(model, cube, pixel) for pixel in pixels]
    minima = {name: np.array([row[0][name] for row in rows]) for name in PixelMinima._fields}
    minima["thickness"] = minima["thickness"][0]
    data = {name: [row[1][name] for row in rows] for name in PixelData._fields}
    arrays: Any = {name: None if column[0] is None else np.array(column) for name, column in data.items()}
    return Searched(PixelData(**arrays), PixelMinima(**minima), [row[2] for row in rows])


def _one(model, cube, pixel):
    own = spectrum(cube, pixel)
    fit, _ = fitted(own, model.scene, 0.0, quiet)
    problem = make(*measurements(own, model.scene))
    found, [view], [whole] = search(problem, quiet), problem.views, model.problem.views
    known, channels, fraction = np.isfinite(pixel["values"]), view.channels, view.independent_fraction

    def points(column):
        out = np.zeros((whole.rows, channels))
        out[known] = np.asarray(column)[: view.points].reshape(-1, channels)
        return out.ravel()

    frame = None
    if view.data.frame is not None:
        frame = np.zeros((whole.rows, channels, channels))
        frame[known] = view.data.frame[: view.rows]
    assert found.scan is not None
    count = min(ORDERS, len(found.units))
    values = np.asarray(problem.values(found.units))[:count]
    local = [view.local(each) for each in values]

    def orders(column, fill):
        rest = np.full((ORDERS - count, *np.shape(column)[1:]), fill)
        return np.concatenate([np.asarray(column)[:count], rest])

    minima = {
        "values": orders(values, np.nan),
        "units": orders(found.units, np.nan),
        "deviance": orders(found.deviance, np.inf),
        "misfit": orders([fraction * np.sum(view.residuals(at) ** 2) for at in local], np.inf),
        "converged": orders(found.converged, False),
        "model": points(local[0].model),
        "profile": found.scan.deviance.sum(-1).min(axis=0),
        "thickness": found.scan.thickness,
        "signal": points(local[0].signal),
        "gain": points(local[0].gain),
        "offset": points(local[0].offset),
        "slope": np.stack([points(column) for column in local[0].slope.T], axis=-1),
    }
    data = {
        "values": points(view.data.values),
        "weight": points(view.data.weight),
        "level": float(view.data.level),
        "frame": frame,
    }
    return minima, data, fit


def reflectance(thickness, n: Any = 1.46, **layer):
    return pl.simulate(pl.Scene(pl.Layer(n, thickness, **layer), "Si"), wavelength=NM).values


def check(cube, scene, whole=None):
    """Compare every pixel with its own fit; `whole` is a cube without missing points."""
    model = prepare(whole or cube, scene)
    data, minima, fits = searched(model, cube)
    found = model.errors.fits(data, minima)
    words = [STATUSES[code] for code in found.status]
    assert words == [str(fit.status) for fit in fits]
    for j, p in enumerate(model.parameters):
        own = [fit[p.name] for fit in fits]
        # effects are interpolated between thicknesses 1/48 of a fringe apart; a map's errors hold within 10 %
        assert found.stderr[:, j] == pytest.approx([each.stderr for each in own], rel=0.1)
        assert found.stderr_noise[:, j] == pytest.approx([each.stderr_noise for each in own], rel=0.01)
    assert found.chi2_reduced == pytest.approx([fit.chi2_reduced for fit in fits], rel=1e-6)
    assert found.rms == pytest.approx([fit.rms for fit in fits], rel=1e-6)
    for i, fit in enumerate(fits):
        near = [rival.delta_chi2 for rival in fit.rivals[:3] if rival.delta_chi2 < 100]
        assert found.delta_chi2[i, 1 : len(near) + 1] == pytest.approx(near, rel=0.02)
    return words


def noisy(rows, rng, size=SIGMA):
    return np.clip(rows + size * rng.normal(size=np.shape(rows)), 0, None)


@pytest.mark.slow
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
    drift = pl.Instrument(scale="slow", offset="slow")
    scene = pl.Scene(pl.Layer(1.46, pl.Free(0, 1600)), "Si", instrument=drift)
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
@pytest.mark.parametrize("given", [True, pytest.param(False, marks=pytest.mark.slow)])
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
