"""Marginal likelihood of minima, against dense normal distributions, and what rests on it."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from scipy.stats import multivariate_normal

import pellicle as pl
from pellicle.fitting.film.fit import fitted
from pellicle.fitting.marginal import left_weights, marginal
from pellicle.fitting.progress import quiet

NM = np.linspace(450, 800, 90)
FILM = pl.Scene(pl.Layer(1.48, pl.Free(100, 4000)), "SiO2")
NOISE = 3e-4


def measured(level: float, sigma: bool = False) -> pl.Spectrum:
    """Weak fringes of 3 µm, with a level that is off."""
    film = pl.Scene(pl.Layer(1.48, 3000.0), "SiO2")
    clean = pl.simulate(film, wavelength=NM, noise=NOISE, seed=1)
    given = np.full(NM.shape, NOISE) if sigma else None
    return pl.Spectrum(NM, clean.values + level, "R", sigma=given)


@pytest.fixture(scope="module")
def known():
    """A fit of a spectrum with a given σ, and its minima."""
    return fitted(measured(0.0, sigma=True), FILM, 0.0, quiet)


def test_deviance_is_that_of_a_normal_distribution_with_the_effects_in_its_covariance(known):
    fit, _ = known
    with jax.enable_x64(True):
        best, [view] = fit.ranking, fit.ranking.evidence()
        allowed = best.discrepancy
        about = left_weights([view], allowed), allowed.total
        found = marginal([view], best.jacobian, best.ranked.minima.units[0], *about)
        spread = 1 / (view.weights * allowed.raised[0]).ravel()
        slope = view.jacobian.reshape(len(NM), -1)
        columns = np.stack([e.change.ravel() for e in view.effects], axis=1)
        covariance = np.diag(spread**2) + columns @ columns.T
        # the best parameter, by generalised least squares
        inverse = np.linalg.inv(covariance)
        step = np.linalg.solve(slope.T @ inverse @ slope, slope.T @ inverse @ view.residual.ravel())
        rest = view.residual.ravel() - slope @ step
        log = multivariate_normal.logpdf(rest, np.zeros(len(rest)), covariance)
        constant = len(rest) * np.log(2 * np.pi) + 2 * np.sum(np.log(spread))
    # effects that cannot be negative are not, which a normal distribution allows them to be
    assert found.deviance == pytest.approx(-2 * log - constant, abs=1.0)
    assert found.stderr[0] > fit["thickness"].stderr_noise


@pytest.mark.slow
def test_weak_fringes_on_a_level_that_is_off_determine_the_film():
    """Residuals are those of the level, which the offset explains: they are no noise of the fringes."""
    fit = pl.fit(measured(0.01), FILM)
    film = fit["thickness"]
    assert fit.status == "converged"
    assert abs(film.value - 3000) < 2 * film.stderr < 60
    assert film.stderr_noise < 1
    assert min(rival.delta_chi2 for rival in fit.rivals) > 100


def test_shares_of_orders_are_those_of_the_posterior():
    """Noise near the size of fringes, no effects: against the likelihood on a fine grid, integrated."""
    noise = 6e-3
    clean = pl.simulate(pl.Scene(pl.Layer(1.48, 3000.0), "SiO2"), wavelength=NM, noise=noise, seed=2)
    data = pl.Spectrum(NM, clean.values, "R", sigma=np.full(NM.shape, noise))
    fit = pl.fit(data, replace(FILM, uncertainty=pl.Uncertainty.none()))
    grid = np.arange(100, 4000, 1.0)
    n = np.asarray(pl.material("SiO2").index(NM))
    below = np.array([airy(1.48, n, NM, d) for d in grid])
    density = np.exp(-0.5 * np.sum(((data.values - below) / noise) ** 2, axis=1) + 30)
    density /= density.sum()
    orders = {fit["thickness"].value: fit.probability}
    orders |= {r.parameters["thickness"]: r.probability or 0.0 for r in fit.rivals}
    likely = {thickness: share for thickness, share in orders.items() if share > 0.05}
    assert len(likely) > 1
    for thickness, share in likely.items():
        assert share == pytest.approx(density[np.abs(grid - thickness) < 100].sum(), abs=0.05)


def test_evidence_is_the_likelihood_averaged_over_the_bounds():
    """One film of known noise, no effects: against the integral over the thickness, by Airy's formula."""
    clean = pl.simulate(pl.Scene(pl.Layer(1.48, 3000.0), "SiO2"), wavelength=NM, noise=NOISE, seed=3)
    data = pl.Spectrum(NM, clean.values, "R", sigma=np.full(NM.shape, NOISE))
    scenes = {
        name: pl.Scene(pl.Layer(1.48, bounds), "SiO2", uncertainty=pl.Uncertainty.none())
        for name, bounds in (("wide", pl.Free(2950, 3050)), ("narrow", pl.Free(2990, 3010)))
    }
    fits = {name: pl.fit(data, scene) for name, scene in scenes.items()}
    n, grid = np.asarray(pl.material("SiO2").index(NM)), np.arange(2990, 3010, 0.01)
    apart = np.array([data.values - airy(1.48, n, NM, d) for d in grid]) / NOISE
    log = -0.5 * np.sum(apart**2, axis=1) - len(NM) * np.log(NOISE * np.sqrt(2 * np.pi))
    integral = np.log(np.sum(np.exp(log - log.max())) * 0.01) + log.max()
    for fit, width in ((fits["wide"], 100.0), (fits["narrow"], 20.0)):
        assert fit.log_evidence == pytest.approx(integral - np.log(width), abs=0.02)
    compared = pl.compare(fits)
    assert compared.best.name == "narrow"
    assert compared.probabilities["narrow"] == pytest.approx(5 / 6, abs=0.01)


def test_effects_are_changes_of_the_data_by_their_sizes(known):
    """The scale multiplies the model; the index of the film is off by half a per cent."""
    fit, _ = known
    (effects,) = fit.effects
    rows = {effect.name: effect for effect in effects}
    model = fit.curve.model
    np.testing.assert_allclose(rows["scale"].change[:, 0], rows["scale"].size * model, rtol=1e-6)
    n, size = np.asarray(pl.material("SiO2").index(NM)), rows["index of the layer"].size
    more, less = (airy(1.48 * (1 + x * size), n, NM, fit["thickness"].value) for x in (0.01, -0.01))
    np.testing.assert_allclose(
        rows["index of the layer"].change[:, 0], 50 * (more - less), atol=1e-3 * np.ptp(model)
    )


def airy(film: float, substrate: np.ndarray, nm: np.ndarray, thickness: float) -> np.ndarray:
    """Reflectance of one layer at normal incidence by the Airy formula."""
    first, second = (1 - film) / (1 + film), (film - substrate) / (film + substrate)
    phase = np.exp(4j * np.pi * film * thickness / nm)
    return np.abs((first + second * phase) / (1 + first * second * phase)) ** 2
