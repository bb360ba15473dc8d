"""Where a model misses something: bumps whose place is known, and noise that has none."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.residual_structure import windows


@pytest.mark.parametrize(("views", "curves", "points", "most"), [(300, 1, 200, 8), (40, 18, 81, 1)])
def test_noise_has_no_structure(views, curves, points, most):
    """One view of a hundred may be said to have some, however many curves it has."""
    random = np.random.default_rng(11)
    each = [[windows(random.normal(size=points), curves) for _ in range(curves)] for _ in range(views)]
    assert sum(any(view) for view in each) <= most


@pytest.mark.parametrize(("first", "last", "height"), [(40, 59, 2.0), (100, 139, -1.5), (10, 14, 4.0)])
def test_a_step_is_found_where_it_is(first, last, height):
    z = np.random.default_rng(6).normal(size=200)
    z[first : last + 1] += height
    [found] = windows(z)
    assert abs(found.first - first) <= 6
    assert abs(found.last - last) <= 6


def test_an_outlier_is_no_structure():
    z = np.random.default_rng(7).normal(size=200)
    z[77] = 60.0
    assert windows(z) == []


@pytest.mark.parametrize("sigma", [pytest.param(True, marks=pytest.mark.slow), False])
def test_a_fit_says_where(film, measured, sigma):
    scene = film(material=pl.dispersion.Constant(pl.Free(1.3, 1.7)))
    data = measured(scene, 1.46, 430.0, sigma=sigma)
    bump = 0.012 * np.exp(-(((data.wavelength - 500) / 15) ** 2))
    fit = pl.fit(dataclasses.replace(data, values=data.values + bump), scene)
    [told] = [warning for warning in fit.warnings if "misses structure" in warning]
    low, high = (float(x) for x in told.split("at ")[1].split(" nm")[0].split("-"))
    assert 470 <= low <= 500 <= high <= 530
    assert not any("misses structure" in warning for warning in pl.fit(data, scene).warnings)


@pytest.mark.slow
def test_a_band_that_is_no_films_enlarges_the_error(film, measured):
    """It moves the answer by less than the error that it causes; a wrong index is a misfit."""
    data = measured(film(), 430.0, sigma=True)
    band = 0.04 * np.exp(-(((data.wavelength - 700) / 8) ** 2))
    plain, fit = pl.fit(data, film()), pl.fit(dataclasses.replace(data, values=data.values + band), film())
    assert fit.status == "converged"
    thickness = fit["thickness"]
    assert 3 * plain["thickness"].stderr_noise < abs(thickness.value - 430.0) < 2 * thickness.stderr
    wrong = pl.fit(data, film(material=1.6))
    assert wrong.status == "misfit"
    assert "usual errors of instruments and samples would. Its thickness" in wrong.verdict
    assert any("structure over most of the spectrum (by 0.0" in warning for warning in wrong.warnings)


def test_a_noisy_end_counts_for_less_and_is_no_structure(film, measured):
    """The error by noise is that with the true σ of each point; with equal weights it is four times that."""
    clean = measured(film(), 430.0, sigma=False)
    sigma = np.where(clean.wavelength > 600, 0.02, 0.0)
    values = clean.values + sigma * np.random.default_rng(4).normal(size=sigma.size)
    data = dataclasses.replace(clean, values=values)
    fit = pl.fit(data, film())
    [told] = [warning for warning in fit.warnings if "noise differs along the spectrum" in warning]
    assert "these points count for less" in told
    assert not any("misses structure" in warning for warning in fit.warnings)
    known = pl.fit(dataclasses.replace(data, sigma=np.hypot(sigma, 0.003)), film())["thickness"]
    assert fit["thickness"].stderr_noise == pytest.approx(known.stderr_noise, rel=0.6)  # of few points
    assert fit["thickness"].value == pytest.approx(known.value, abs=3 * known.stderr_noise)
