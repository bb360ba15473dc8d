"""An absorbing index that is free: n and k at wavelengths, and what other curves change of them."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.spline import Spline
from pellicle.fitting.film.index_curves import IndexCurves
from pellicle.fitting.result import Status
from pellicle.reporting.fit_text import report
from pellicle.reporting.json_record import to_json

from ...by_tmm import films

NM = np.linspace(400.0, 780.0, 64)
KNOTS = (400.0, 520.0, 640.0, 780.0)
SIGMA = 0.004


def curves(above, thickness, curves, depth="thickness"):
    return IndexCurves(
        np.array(above), np.array(thickness), np.array(curves), NM, depth, frozenset({"k1", "k2"})
    )


def test_a_curve_that_fits_as_well_counts_in_full_and_one_that_fits_worse_by_its_parabola():
    made = curves([0.0, 4.0, 0.5], [100.0, 110.0, 103.0], np.zeros((3, 2, 64)))
    assert made.spread(made.thickness) == pytest.approx(5.0)
    made = curves([0.0, 5.0, 0.5], [100.0, 101.0, 108.0], np.zeros((3, 2, 64)))
    assert made.spread(made.thickness) == pytest.approx(8.0)


@pytest.fixture(scope="module")
def fit():
    """64 points of R of 60 nm of hematite on glass, the thickness given; few knots."""
    index, glass = (np.asarray(pl.refractive_index(NM, name)) for name in ("Fe2O3", "BK7"))
    clean = films("s", NM, [1.0, index, glass], [60.0])
    noisy = clean + SIGMA * np.random.default_rng(5).standard_normal(NM.size)
    data = pl.Spectrum(NM, noisy, "R", sigma=np.full(NM.size, SIGMA))
    n, k = ((pl.Free(low, high, start=0.1 * high),) * len(KNOTS) for low, high in ((0.3, 8.0), (0.0, 2.0)))
    scene = pl.Scene(pl.Layer(Spline(KNOTS, n, k), 60.0), "BK7")
    return pl.fit(data, scene)


def test_the_band_contains_the_index_that_the_formula_cannot_follow(fit):
    true = np.asarray(pl.refractive_index(NM, "Fe2O3"))
    found = fit.index
    for value, truth, stderr in ((found.n, true.real, found.n_stderr), (found.k, true.imag, found.k_stderr)):
        assert np.mean(np.abs(value - truth) <= 1.96 * stderr) > 0.9


def test_results_are_n_and_k_at_the_knots(fit):
    short = fit.index_in_short
    np.testing.assert_allclose(short.wavelength, KNOTS, atol=4)
    rows = to_json(fit)["index"]
    assert [row["n"] for row in rows] == pytest.approx(short.n.tolist())
    assert rows[0]["k_expanded"] == pytest.approx(1.96 * short.k_stderr[0], rel=1e-3)
    assert "n and k of the layer" in report(fit)
    # no sentence on coefficients, and nothing firm where the error of n + ik is a fifth of it
    error = np.hypot(fit.index.n_stderr, fit.index.k_stderr) / np.hypot(fit.index.n, fit.index.k)
    assert fit.status is (Status.AMBIGUOUS if np.median(error) > 0.1 else Status.CONVERGED)
    assert " n " in fit.verdict
    assert "k1" not in fit.verdict
