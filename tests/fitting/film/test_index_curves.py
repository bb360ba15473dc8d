"""An absorbing index that is free: n and k at wavelengths, and what other curves change of them."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.spline import Spline
from pellicle.fitting.conclusion import Conclusion
from pellicle.fitting.film.index_curves import IndexCurves, apart
from pellicle.fitting.result import Estimate, Status
from pellicle.reporting.fit_text import report
from pellicle.reporting.json_record import to_json

from ...by_tmm import films

NM = np.linspace(400.0, 780.0, 64)
KNOTS = (400.0, 520.0, 640.0, 780.0)
SIGMA = 0.004


def curves(above, thickness, curves, depth="thickness", left=1.0):
    arrays = np.array(above), np.array(thickness), np.array(curves)
    return IndexCurves(*arrays, NM, depth, frozenset({"k1", "k2"}), left)


def test_a_curve_that_fits_as_well_counts_in_full_and_one_that_fits_worse_by_its_parabola():
    made = curves([0.0, 4.0, 0.5], [100.0, 110.0, 103.0], np.zeros((3, 2, 64)))
    assert made.spread(made.thickness) == pytest.approx(5.0)
    made = curves([0.0, 5.0, 0.5], [100.0, 101.0, 108.0], np.zeros((3, 2, 64)))
    assert made.spread(made.thickness) == pytest.approx(8.0)


RESTING = {"at_bound": True, "binding": True}
SET, DEFAULT = (
    Estimate("k1", 2.0, 0.1, "", 0.0, 2.0, True, default_bounds=x, **RESTING) for x in (False, True)
)


@pytest.mark.parametrize(
    ("before", "resting", "other", "left", "after"),
    [
        (Status.CONVERGED, (), 104.0, 1.0, Status.CONVERGED),
        (Status.CONVERGED, (), 140.0, 1.0, Status.AMBIGUOUS),
        # a curve of n and k that leaves the noise alone: it was the formula
        (Status.MISFIT, (), 104.0, 1.2, Status.CONVERGED),
        (Status.MISFIT, (), 140.0, 1.2, Status.AMBIGUOUS),
        (Status.MISFIT, (), 104.0, 3.0, Status.MISFIT),
        # a default bound of the formula is no cause where the thickness is open
        (Status.AT_BOUND, (DEFAULT,), 140.0, 1.0, Status.AMBIGUOUS),
        (Status.AT_BOUND, (DEFAULT,), 104.0, 1.0, Status.AT_BOUND),
        (Status.AT_BOUND, (SET,), 140.0, 1.0, Status.AT_BOUND),
    ],
)
def test_the_status_is_that_of_the_thickness(before, resting, other, left, after):
    numbers = [Estimate("thickness", 100.0, 1.0, "nm", 10.0, 1000.0, True), *resting]
    conclusion = Conclusion(before, {p.name: p for p in numbers}, (), None, [])
    made = curves([0.0, 0.5], [100.0, other], np.zeros((2, 2, 64)), left=left)
    assert made.conclusion(conclusion, []).status is after


def test_each_thickness_is_followed_once_and_every_curve_of_a_given_one():
    above, thickness = np.array([3.0, 1.0, 2.0, 9.0]), np.array([100.0, 103.0, 200.0, 50.0])
    assert apart(above, thickness).tolist() == [1, 2, 3]
    assert apart(above, np.full(4, np.nan)).tolist() == [1, 2, 0, 3]


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


@pytest.mark.slow
def test_the_band_contains_the_index_that_the_formula_cannot_follow(fit):
    """Within three standard errors: errors along a curve are one draw, and the best curve of these data is
    better than the true one by Δχ² = 4. By the formula's own errors n is off by seven."""
    true = np.asarray(pl.refractive_index(NM, "Fe2O3"))
    found = fit.index
    for value, truth, stderr in ((found.n, true.real, found.n_stderr), (found.k, true.imag, found.k_stderr)):
        assert np.all(np.abs(value - truth) <= 3 * stderr)


@pytest.mark.slow
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
