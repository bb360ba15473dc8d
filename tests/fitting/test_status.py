"""Every status by a real fit, the order of statuses, and the wording of verdicts."""

import math

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting import minima
from pellicle.fitting.result import Estimate, Rival, Status
from pellicle.fitting.status import describe, expanded, judge, verdict


def test_converged(film, measured):
    scene = film()
    fit = pl.fit(measured(scene, 430.0), scene)
    assert fit.status is pl.Status.CONVERGED
    assert fit.verdict == f"The data determine thickness: {expanded(fit['thickness'])}."


def test_at_a_bound_that_the_user_set(film, measured):
    data = measured(film(), 430.0)
    fit = pl.fit(data, film(pl.Free(10, 429)))
    assert fit.status is pl.Status.AT_BOUND
    assert fit["thickness"].value == 429
    assert "thickness (429 nm)" in fit.verdict
    index = pl.fit(data, film(material=pl.dispersion.Constant(pl.Free(1.47, 1.6))))
    assert index.status is pl.Status.AT_BOUND
    assert "n (1.47)" in index.verdict


@pytest.mark.slow  # compiles a scene of its own
def test_a_natural_bound_gives_an_upper_limit_and_stays_converged(film, measured):
    scene = film(material=pl.dispersion.Constant(1.46, pl.Free(0.0, 1.0)))
    for seed in range(1, 9):
        fit = pl.fit(measured(scene, 0.0, 430.0, seed=seed), scene)
        assert fit.status is pl.Status.CONVERGED
        if fit["k"].value == 0:
            break
    else:
        pytest.fail("k never came to rest on zero in eight noises")
    assert 0 < fit["k"].upper_limit < 0.01
    assert fit["k"].lower_limit is None
    # resting on the bound against a slope it is known better than a parabola from 0 would have it
    assert 0.2 < fit["k"].upper_limit / fit["k"].stderr <= 2.71**0.5
    assert sum(w.startswith("k is compatible with 0") for w in fit.warnings) == 1


@pytest.mark.slow  # compiles a fit of its own
def test_a_bound_above_zero_is_not_natural(film, measured):
    """k ≥ 0.02 is no law of physics."""
    scene = film(material=pl.dispersion.Constant(1.46, pl.Free(0.02, 1.0)))
    fit = pl.fit(measured(film(), 430.0), scene)
    assert fit.status in (pl.Status.AT_BOUND, pl.Status.MISFIT)
    assert fit["k"].value == 0.02
    assert fit["k"].upper_limit is None


def test_ambiguous_n_and_its_mirror(film, measured):
    """At normal incidence on a substrate s, n d at index n and at s/n reflect alike."""
    scene = film(material=pl.dispersion.Constant(pl.Free(1.3, 2.8)))
    fit = pl.fit(measured(scene, 1.6, 430.0), scene)
    assert fit.status is pl.Status.AMBIGUOUS
    both = sorted([fit["n"].value, fit.rivals[0].parameters["n"]])
    assert both == pytest.approx([1.6, 3.9 / 1.6], abs=0.02)
    assert fit.rivals[0].delta_chi2 < 6
    assert f"but {fit.rivals[0].parameters['thickness']:.4g} nm fits nearly as well" in fit.verdict


def test_misfit_where_sigma_is_known(film, measured):
    data = measured(film(), 430.0, sigma=True)
    fit = pl.fit(data, film(material=1.6))
    assert fit.chi2_reduced > 4
    assert fit.status is pl.Status.MISFIT
    assert f"misses by {fit.rms:.2g} on average" in fit.verdict


def test_misfit_where_sigma_is_not_known(film, measured):
    """Large residuals with a structure: a slope that no film has."""
    nm = np.linspace(400.0, 900.0, 128)
    thin = measured(film(), 60.0, noise=0.001)
    tilted = pl.Spectrum(nm, thin.values + 0.15 * np.sin((nm - 400) / 150), "R")
    fit = pl.fit(tilted, film(pl.Free(10, 100)))
    assert fit.effective_points < 0.1 * 128
    assert fit.rms > 0.02
    assert fit.status is pl.Status.MISFIT


def test_misfit_where_the_residuals_are_noise_a_hundred_times_as_large_as_sigma_says(film, measured):
    """Random numbers have no structure that a film misses, and are no film."""
    nm = np.linspace(400.0, 900.0, 128)
    random = np.random.default_rng(1).uniform(0.0, 1.0, nm.size)
    assert pl.fit(pl.Spectrum(nm, random, "R", np.full(128, 0.003)), film()).status is pl.Status.MISFIT
    # a σ that is too small by five is everyday
    noisy = measured(film(), 430.0, noise=0.025)
    fit = pl.fit(pl.Spectrum(nm, noisy.values, "R", np.full(128, 0.005)), film())
    assert fit.status is pl.Status.CONVERGED


def test_not_identifiable(film, measured):
    scene = film(pl.Free(1, 1000), "Au")
    fit = pl.fit(measured(scene, 500.0), scene)
    assert fit.status is pl.Status.NOT_IDENTIFIABLE
    assert f"opaque: thickness is at least {fit['thickness'].lower_limit:.4g} nm (95 %)." in fit.verdict


def test_an_opaque_film_is_not_identifiable_where_the_solver_does_not_settle(film, measured, monkeypatch):
    """A plateau has no point to settle at."""
    stop_everywhere(monkeypatch)
    scene = film(pl.Free(1, 1000), "Au")
    fit = pl.fit(measured(scene, 500.0), scene)
    assert fit.status is pl.Status.NOT_IDENTIFIABLE
    assert fit["thickness"].lower_limit > 50


def stop_everywhere(monkeypatch):
    """Have a solver that reports no convergence anywhere."""
    real = minima.polish

    def stopped(*arguments):
        polished = real(*arguments)
        return polished._replace(converged=np.zeros_like(np.asarray(polished.converged)))

    monkeypatch.setattr(minima, "polish", stopped)


def test_not_converged(film, measured, monkeypatch):
    stop_everywhere(monkeypatch)
    scene = film()
    fit = pl.fit(measured(scene, 430.0), scene)
    assert fit.status is pl.Status.NOT_CONVERGED
    assert "should not be used" in fit.verdict


def estimate(name="thickness", value=300.0, stderr=1.0, at_bound=False, **more):
    return Estimate(name, value, stderr, "nm", 0.0, 1000.0, True, at_bound, **more)


EVERYTHING_WRONG = {
    "converged": False,
    "misfit": True,
    "parameters": {"thickness": estimate(stderr=math.inf, at_bound=True), "n": estimate("n", 1.5, 0.1)},
    "rivals": (Rival({"thickness": 500.0, "n": 2.5}, 1.0),),
    "natural": frozenset(),
}


def test_the_first_status_that_holds_is_given():
    """Everything is wrong; then one thing after the other is put right, in the order of the contract."""
    wrong = dict(EVERYTHING_WRONG)
    assert judge(**wrong) is Status.NOT_CONVERGED
    wrong["converged"] = True
    assert judge(**wrong) is Status.MISFIT
    wrong["misfit"] = False
    assert judge(**wrong) is Status.NOT_IDENTIFIABLE
    wrong["parameters"] = {"thickness": estimate(at_bound=True), "n": estimate("n", 1.5, 0.1)}
    assert judge(**wrong) is Status.AMBIGUOUS
    wrong["rivals"] = (Rival({"thickness": 500.0, "n": 2.5}, 6.1),)
    assert judge(**wrong) is Status.AT_BOUND
    wrong["parameters"] = {"thickness": estimate(), "n": estimate("n", 1.5, 0.1)}
    assert judge(**wrong) is Status.CONVERGED


def judged(*parameters, rivals=(), natural=frozenset()):
    """The status of a fit that has converged and is no misfit."""
    return judge(
        parameters={p.name: p for p in parameters},
        converged=True,
        misfit=False,
        rivals=rivals,
        natural=natural,
    )


def test_a_rival_within_the_errors_is_no_rival():
    near, far = ((Rival({"thickness": nm}, 1.0),) for nm in (325.0, 335.0))
    assert judged(estimate(stderr=10.0), rivals=near) is Status.CONVERGED
    assert judged(estimate(stderr=10.0), rivals=far) is Status.AMBIGUOUS


def test_natural_bounds_do_not_count():
    k = estimate("k", 0.0, 0.1, True)
    assert judged(k, estimate()) is Status.AT_BOUND
    assert judged(k, estimate(), natural=frozenset({"k"})) is Status.CONVERGED


@pytest.mark.parametrize(
    ("parameters", "status"),
    [
        ([estimate(), estimate("B", 0.0, 9.0, True, default_bounds=True)], Status.CONVERGED),
        ([estimate(), estimate("B", 0.0, 9.0, True)], Status.AT_BOUND),
        ([estimate(stderr=31.0), estimate("B", 0.0, 9.0, True, default_bounds=True)], Status.AT_BOUND),
        ([estimate(at_bound=True, default_bounds=True)], Status.AT_BOUND),
        # the thickness of its own layer counts, and without a free thickness the leading number
        (
            [
                estimate("a.thickness", stderr=31.0),
                estimate("b.thickness"),
                estimate("b.A", 1.5, 0.1, True, default_bounds=True),
            ],
            Status.CONVERGED,
        ),
        ([estimate("n", 1.5, 0.1), estimate("k", 1.0, 0.1, True, default_bounds=True)], Status.CONVERGED),
        ([estimate("n", 1.5, 0.1, True, default_bounds=True), estimate("k", 1.0, 0.1)], Status.AT_BOUND),
    ],
)
def test_a_default_bound_is_a_remark_beside_a_thickness_that_is_known(parameters, status):
    assert judged(*parameters) is status


def test_without_a_thickness_every_free_parameter_must_be_unseen():
    n = estimate("n", 1.5, math.inf)
    assert judged(n, estimate("k", 0.1, 0.01)) is Status.CONVERGED
    assert judged(n, estimate("k", 0.1, math.inf)) is Status.NOT_IDENTIFIABLE


LEAD = estimate(value=300.0, stderr=1.0)
RIVALS = (Rival({"thickness": 500.0}, 1.0), Rival({"thickness": 700.0}, 2.0))
UNSEEN = {"thickness": estimate(stderr=math.inf)}


@pytest.mark.parametrize(
    ("status", "parameters", "options", "text"),
    [
        (Status.CONVERGED, {}, {}, "The data determine thickness: 300.0 ± 2.0 nm (95 %)."),
        (
            Status.CONVERGED,
            {},
            {"trading": ["n and thickness are correlated", "another"]},
            "The data determine thickness: 300.0 ± 2.0 nm (95 %). But n and thickness are correlated.",
        ),
        (
            Status.AT_BOUND,
            {"n": estimate("n", 1.5, 0.1, True)},
            {},
            "The best fit, thickness 300.0 ± 2.0 nm (95 %), lies on a bound that was set: n (1.5 nm)."
            " Widen the bound; if the best value moves with it, the scene may be wrong.",
        ),
        (
            Status.AT_BOUND,
            {"thickness": estimate(stderr=60.0), "n": estimate("n", 1.5, 0.1, True, default_bounds=True)},
            {},
            "The best fit, thickness 300 ± 118 nm (95 %), lies on a default bound: n (1.5 nm). Give it"
            " bounds.",
        ),
        (
            Status.AMBIGUOUS,
            {},
            {"rivals": RIVALS},
            "The data do not determine thickness: 300.0 ± 2.0 nm (95 %) fits best, but 500 nm fits nearly as"
            " well.",
        ),
        (
            Status.AMBIGUOUS,
            {"n": estimate("n", 1.5, 0.01)},
            {"rivals": (Rival({"thickness": 300.1, "n": 2.5}, 1.0),)},
            "The data do not determine thickness: 300.0 ± 2.0 nm (95 %) fits best, but n 2.5 nm fits nearly"
            " as well.",
        ),
        (
            Status.NOT_IDENTIFIABLE,
            UNSEEN,
            {},
            "The data do not determine thickness: it may be anything between 0 and 1000 nm.",
        ),
        (
            Status.NOT_IDENTIFIABLE,
            {"thickness": estimate(stderr=math.inf, lower_limit=145.37)},
            {},
            "The data do not determine thickness: it is at least 145.4 nm (95 %).",
        ),
        (
            Status.NOT_IDENTIFIABLE,
            {"thickness": estimate(stderr=math.inf, lower_limit=145.37)},
            {"opaque": {"thickness"}},
            "The layer is opaque: thickness is at least 145.4 nm (95 %).",
        ),
        (
            Status.NOT_IDENTIFIABLE,
            {"thickness": estimate(stderr=math.inf, upper_limit=161.6)},
            {},
            "The data do not determine thickness: it is at most 161.6 nm (95 %).",
        ),
        (
            Status.MISFIT,
            {},
            {"where": "690-710 nm", "missed": "film.csv"},
            "The scene does not explain film.csv: even the best fit misses by 0.012 on average, more than"
            " noise and the usual errors of instruments and samples would, most of all 690-710 nm. Its"
            " thickness 300 nm should not be used.",
        ),
        (
            Status.MISFIT,
            {},
            {"unit": " degrees"},
            "The scene does not explain the data: even the best fit misses by 0.012 degrees on average, more"
            " than noise and the usual errors of instruments and samples would. Its thickness 300 nm should"
            " not be used.",
        ),
        (
            Status.NOT_CONVERGED,
            {},
            {},
            "The fit did not converge: its best point so far, thickness 300 nm, should not be used.",
        ),
    ],
)
def test_wording_of_verdicts(status, parameters, options, text):
    given = {"rivals": (), "rms": 0.012} | options
    assert verdict(status, {"thickness": LEAD} | parameters, **given) == text


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    [
        (751.6647, 0.2149, "thickness 751.66 ± 0.21 nm"),
        (3026.8, 216.7, "thickness 3027 ± 217 nm"),
        (300.0, 0.0, "thickness 300.00 ± 0.00 nm"),
        (300.0, math.inf, "thickness 300 nm"),
    ],
)
def test_values_with_two_digits_of_their_errors(value, stderr, text):
    assert describe(estimate(value=value, stderr=stderr)) == text


@pytest.mark.parametrize(
    ("noise", "freedom", "text"),
    [
        (1.0, math.inf, "300.0 ± 2.0 nm (95 %)"),
        (0.2, math.inf, "300.0 ± 2.0 nm (95 %; ± 0.39 nm by noise alone)"),
        # Student's t of 4 degrees of freedom is 2.776 (GUM 2008, table G.2)
        (1.0, 4.0, "300.0 ± 2.8 nm (95 %)"),
    ],
)
def test_an_expanded_uncertainty_says_its_level(noise, freedom, text):
    assert expanded(estimate(stderr_noise=noise, degrees_of_freedom=freedom)) == text


def test_degrees_of_freedom_by_welch_and_satterthwaite():
    """A quarter of the variance from four degrees of freedom: 4 / (1/4)² = 64 (GUM 2008, eq. G.2b)."""
    p = estimate(stderr=2.0, stderr_noise=1.0, degrees_of_freedom=4.0)
    assert p.effective_degrees_of_freedom == pytest.approx(64)
    assert p.coverage_factor == pytest.approx(1.998, abs=1e-3)  # t of 64 degrees of freedom
    assert estimate().coverage_factor == pytest.approx(1.960, abs=1e-3)
    assert math.isinf(estimate(stderr=math.inf).expanded)
