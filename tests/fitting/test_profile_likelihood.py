"""Limits by profile likelihood against SciPy's minima of Airy's formula written out here."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import pellicle as pl
from pellicle.fitting.conclusion import neighbourhood
from pellicle.fitting.film.fit import fitted
from pellicle.fitting.profile_likelihood import interval
from pellicle.fitting.progress import quiet
from pellicle.fitting.reweighting import linearised

from ..airy import airy

SUBSTRATE = 3.9 + 0.02j


def chi2(data, d, n):
    return float(np.sum(((data.values - airy(data.wavelength, d, n, SUBSTRATE)) / data.sigma) ** 2))


def least(data, at, near, width):
    """The least χ² over one parameter, near a value."""
    grid = np.linspace(near - width, near + width, 81)
    best = grid[np.argmin([at(x) for x in grid])]
    return minimize_scalar(at, bounds=(best - width / 40, best + width / 40), method="bounded").fun


def without_effects(scene):
    """The scene with errors of noise alone, which limits by χ² are."""
    return replace(scene, uncertainty=pl.Uncertainty.none())


@pytest.mark.slow  # compiles for 3 s
def test_an_extinction_beside_zero(film, measured):
    """k is 0; its upper limit is where χ², the thickness fitted again, is 2.71 above the best."""
    scene = without_effects(film(material=pl.dispersion.Constant(1.46, pl.Free(0.0, 1.0))))
    for seed in (1, 2):
        data = measured(scene, 0.0, 430.0, seed=seed, sigma=True)

        def profile(k, data=data):
            return least(data, lambda d: chi2(data, d, 1.46 + 1j * k), 430.0, 5.0)

        fit = pl.fit(data, scene)
        best = profile(fit["k"].value)
        truth = brentq(lambda k, best=best: profile(k) - best - 2.71, fit["k"].value, 0.01)
        assert fit["k"].upper_limit == pytest.approx(truth, rel=0.01)
        assert fit["k"].lower_limit is None
        assert np.isfinite(fit["k"].stderr)


def test_an_index_with_one_open_side(film, measured):
    """A film of 25 nm: any large index will do with another thickness, a small one will not."""
    scene = without_effects(film(pl.Free(1, 100), pl.dispersion.Constant(pl.Free(1.3, 1.9))))
    data = measured(scene, 1.6, 25.0, noise=0.001, sigma=True)

    def profile(n):
        return least(data, lambda d: chi2(data, d, n), 28.0, 10.0)

    fit = pl.fit(data, scene)
    best = chi2(data, fit["thickness"].value, fit["n"].value)
    truth = brentq(lambda n: profile(n) - best - 2.71, 1.35, 1.5)
    assert profile(1.9) - best < 6
    assert fit["n"].lower_limit == pytest.approx(truth, abs=1e-3)
    assert fit["n"].upper_limit is None
    assert fit["n"].stderr == float("inf")
    assert f"n is at least {fit['n'].lower_limit:.2g} (95 %)" in fit.warnings


@pytest.mark.slow  # compiles for 6 s
def test_an_interval_by_profile_is_that_of_a_scan(film, measured):
    """Both ends of the thickness, its index fitted again by SciPy, where χ² is 3.84 above the best; and the
    misfit beside the best."""
    scene = film(material=pl.dispersion.Constant(pl.Free(1.3, 1.7), 0.0))
    data = measured(scene, 1.46, 430.0, sigma=True)
    fit, ranked = fitted(data, scene, 0.0, quiet)
    _, errors = linearised(ranked)
    around = neighbourhood(ranked, errors.covariance, np.zeros((0, 2)))
    low, high = interval(around, fit.correlation_names.index("thickness"))

    def profile(d):
        return least(data, lambda n: chi2(data, d, n), 1.46, 0.03) * ranked.fits[0].variance ** -1

    best = profile(fit["thickness"].value)
    for end in (low, high):
        assert profile(end) - best == pytest.approx(3.84, abs=0.1)
    assert low < fit["thickness"].value < high

    values = around.best + np.array([[0.0, 0.0], [0.05, -0.01]]) * (around.upper - around.lower)
    named = [dict(zip(fit.correlation_names, row, strict=True)) for row in values]
    expected = [chi2(data, own["thickness"], own["n"]) / ranked.fits[0].variance for own in named]
    assert np.diff(around.misfit(np.zeros(1, int), values[None])[0]) == pytest.approx(
        np.diff(expected), rel=1e-9
    )


@pytest.mark.slow  # compiles a scene of its own
@pytest.mark.parametrize(("rise", "status"), [(7.5, "not-identifiable"), (40.0, "converged")])
def test_a_plateau_within_reach_of_noise_is_open(film, rise, status):
    """An absorbing film of 250 nm, of which any thicker one differs by `rise` in χ²: among so many
    thicknesses noise favours one by 7.5 too easily."""
    nm, n = np.linspace(400.0, 900.0, 128), 2.0 + 1.0j
    values, thick = (airy(nm, d, n, SUBSTRATE) for d in (250.0, 1e5))
    values = values + 1e-9 * (-1.0) ** np.arange(128)  # rounding alone may be correlated
    sigma = np.sqrt(np.sum((values - thick) ** 2) / rise)
    data = pl.Spectrum(nm, values, "R", sigma=np.full(128, sigma))
    fit = pl.fit(data, film(pl.Free(10, 3000), pl.dispersion.Constant(n.real, n.imag)))
    assert fit.status == status
    assert fit["thickness"].lower_limit is None or fit["thickness"].lower_limit < 250.0
