"""Every status by a real fit, the order of statuses, and the wording of verdicts."""

import math

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting import minima
from pellicle.fitting.film.parameters import parameters
from pellicle.fitting.result import Estimate, Rival, Status
from pellicle.fitting.status import ORDER, describe, distinct_rivals, expanded, judged, verdict

GOLD = {"thickness": pl.Free(1, 1000), "material": "Au"}
THICK = GOLD | {"thickness": pl.Free(1000, 4000)}
OPAQUE = "opaque: thickness is at least"
# what is measured, its thickness, what is fitted, whether the solver settles: status, words of the verdict
REAL = {
    "converged": ({}, 430.0, {}, True, Status.CONVERGED, "The data determine thickness: 430"),
    "bound": ({}, 430.0, {"thickness": pl.Free(10, 429)}, True, Status.AT_BOUND, "thickness (429 nm)"),
    "bound of n": (
        *({}, 430.0, {"material": pl.dispersion.Constant(pl.Free(1.47, 1.6))}, True),
        *(Status.AT_BOUND, "n (1.47)"),
    ),
    "wrong index": ({}, 430.0, {"material": 1.6}, True, Status.MISFIT, "on average"),
    "opaque": (GOLD, 500.0, GOLD, True, Status.NOT_IDENTIFIABLE, OPAQUE),
    # not even the thinnest that the bounds allow lets light through
    "nothing seen": (GOLD, 500.0, THICK, True, Status.NOT_IDENTIFIABLE, "anything between 1000 and 4000 nm"),
    # a plateau has no point to settle at
    "opaque, unsettled": (GOLD, 500.0, GOLD, False, Status.NOT_IDENTIFIABLE, OPAQUE),
    "unsettled": ({}, 430.0, {}, False, Status.NOT_CONVERGED, "should not be used"),
}


OWN = pytest.mark.slow(reason="compiles a scene of its own")
# a misfit fits other scenes, too: 17 s of processor time; two tests below are of cheaper misfits
SLOW = ("bound of n", "nothing seen", "wrong index")


@pytest.mark.parametrize("name", [pytest.param(x, marks=OWN) if x in SLOW else x for x in REAL])
def test_a_real_fit_of_each_status(film, measured, monkeypatch, name):
    seen, thickness, fitted, settles, status, words = REAL[name]
    polish = minima.polish

    def unsettled(*arguments):
        polished = polish(*arguments)
        return polished._replace(converged=np.zeros_like(np.asarray(polished.converged)))

    if not settles:
        monkeypatch.setattr(minima, "polish", unsettled)
    fit = pl.fit(measured(film(**seen), thickness, sigma=True), film(**fitted))
    assert fit.status is status
    assert words in fit.verdict
    assert fit.chi2_reduced > 4 or status is not Status.MISFIT


def test_a_bound_above_zero_is_not_natural(film):
    """k ≥ 0.02 is no law of physics."""
    for lower in (0.0, 0.02):
        scene = film(material=pl.dispersion.Constant(1.46, pl.Free(lower, 1.0)))
        assert next(p for p in parameters(scene) if p.name == "k").natural == (lower == 0, False)


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


def test_ambiguous_n_and_its_mirror(film, measured):
    """At normal incidence on a substrate s, n d at index n and at s/n reflect alike."""
    scene = film(material=pl.dispersion.Constant(pl.Free(1.3, 2.8)))
    fit = pl.fit(measured(scene, 1.6, 430.0), scene)
    assert fit.status is pl.Status.AMBIGUOUS
    both = sorted([fit["n"].value, fit.rivals[0].parameters["n"]])
    assert both == pytest.approx([1.6, 3.9 / 1.6], abs=0.02)
    assert fit.rivals[0].delta_chi2 < 6
    assert f"but {fit.rivals[0].parameters['thickness']:.4g} nm (probability " in fit.verdict
    assert fit.probability + fit.rivals[0].probability == pytest.approx(1.0)


@pytest.mark.slow
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


def estimate(name="thickness", value=300.0, stderr=1.0, at_bound=False, **more):
    return Estimate(name, value, stderr, "nm", 0.0, 1000.0, True, at_bound, **more)


def judge(parameters, rivals, natural, **holds):
    """The status of one fit with these estimates."""
    free = list(parameters.values())
    numbers = np.array([(p.value, p.stderr, p.at_bound and p.name not in natural) for p in free]).T
    about = [p.name for p in free], [p.default_bounds for p in free], *numbers[:2], numbers[2].astype(bool)
    return ORDER[judged(*about, ambiguous=bool(distinct_rivals(parameters, rivals)), **holds).position]


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


UNSEEN_N, SEEN_K = estimate("n", 1.5, math.inf), estimate("k", 0.1, 0.01)
RESTING_B, RESTING_K = (estimate(name, 0.0, 0.1, True) for name in "Bk")
DEFAULT_B = estimate("B", 0.0, 9.0, True, default_bounds=True)
OTHER = [estimate("a.thickness", stderr=31.0), estimate("b.thickness")]


@pytest.mark.parametrize(
    ("parameters", "more", "status"),
    [
        # a rival within the errors is none
        ([estimate(stderr=10.0)], {"rivals": (Rival({"thickness": 325.0}, 1.0),)}, Status.CONVERGED),
        ([estimate(stderr=10.0)], {"rivals": (Rival({"thickness": 335.0}, 1.0),)}, Status.AMBIGUOUS),
        # natural bounds do not count, and default bounds not beside a thickness that is known
        ([RESTING_K, estimate()], {}, Status.AT_BOUND),
        ([RESTING_K, estimate()], {"natural": frozenset({"k"})}, Status.CONVERGED),
        ([estimate(), DEFAULT_B], {}, Status.CONVERGED),
        ([estimate(), RESTING_B], {}, Status.AT_BOUND),
        ([estimate(stderr=31.0), DEFAULT_B], {}, Status.AT_BOUND),
        ([estimate(at_bound=True, default_bounds=True)], {}, Status.AT_BOUND),
        # the thickness of its own layer counts, and without a free thickness the leading number
        ([*OTHER, estimate("b.A", 1.5, 0.1, True, default_bounds=True)], {}, Status.CONVERGED),
        ([estimate("n", 1.5, 0.1), estimate("k", 1.0, 0.1, True, default_bounds=True)], {}, Status.CONVERGED),
        ([estimate("n", 1.5, 0.1, True, default_bounds=True), estimate("k", 1.0, 0.1)], {}, Status.AT_BOUND),
        # without a thickness every free parameter must be unseen
        ([UNSEEN_N, SEEN_K], {}, Status.CONVERGED),
        ([UNSEEN_N, estimate("k", 0.1, math.inf)], {}, Status.NOT_IDENTIFIABLE),
    ],
)
def test_status_of_a_fit_that_has_converged_and_is_no_misfit(parameters, more, status):
    given = {"rivals": (), "natural": frozenset()} | more
    named = {p.name: p for p in parameters}
    assert judge(parameters=named, converged=True, misfit=False, **given) is status


LEAD = estimate(value=300.0, stderr=1.0)
RIVALS = (Rival({"thickness": 500.0}, 1.0), Rival({"thickness": 700.0}, 2.0))
RESTING_N = {"n": estimate("n", 1.5, 0.1, True, binding=True)}
DEFAULT_N = {"n": estimate("n", 1.5, 0.1, True, default_bounds=True, binding=True)}
NO_K = {"k": estimate("k", 0.0, 0.1, True)} | DEFAULT_N
OTHER_N = {"rivals": (Rival({"thickness": 300.1, "n": 2.5}, 1.0),)}
TRADING = {"trading": ["n and thickness are correlated", "another"]}
EXPANDED = "300.0 ± 2.0 nm (95 %)"
TWO = {"b.thickness": estimate("b.thickness", 70.0, 5.0)}
UNSEEN_B = {"b.thickness": estimate("b.thickness", 70.0, math.inf)}
OTHER_B = {"rivals": (Rival({"thickness": 300.1, "b.thickness": 90.0}, 1.0),)}


def unseen(**limits):
    return {"thickness": estimate(stderr=math.inf, **limits)}


@pytest.mark.parametrize(
    ("status", "parameters", "options", "words"),
    [
        (Status.CONVERGED, {}, {}, f"The data determine thickness: {EXPANDED}."),
        (Status.CONVERGED, {}, TRADING, f"{EXPANDED}. But n and thickness are correlated."),
        (Status.AT_BOUND, RESTING_N, {}, "lies on a bound that was set: n (1.5 nm). Widen the bound"),
        (Status.AT_BOUND, DEFAULT_N, {}, "lies on a default bound: n (1.5 nm). Give it bounds."),
        (Status.AT_BOUND, NO_K, {}, "lies on a default bound: n (1.5 nm). Give it bounds."),
        (Status.AT_BOUND, RESTING_N, {"found": "n and k"}, "The best fit, n and k, lies on a bound"),
        (Status.MISFIT, {}, {"found": "n and k"}, "Its n and k should not be used."),
        (Status.AMBIGUOUS, {}, {"rivals": RIVALS}, "but 500 nm fits nearly as well."),
        (Status.AMBIGUOUS, {"n": estimate("n", 1.5, 0.01)}, OTHER_N, "but n 2.5 nm fits nearly as well."),
        (Status.NOT_IDENTIFIABLE, unseen(), {}, "it may be anything between 0 and 1000 nm."),
        (Status.NOT_IDENTIFIABLE, unseen(lower_limit=145.37), {}, "it is at least 145.4 nm (95 %)."),
        (
            *(Status.NOT_IDENTIFIABLE, unseen(lower_limit=145.37), {"opaque": {"thickness"}}),
            "The layer is opaque: thickness is at least 145.4 nm (95 %).",
        ),
        (Status.NOT_IDENTIFIABLE, unseen(upper_limit=161.6), {}, "it is at most 161.6 nm (95 %)."),
        (
            *(Status.MISFIT, {}, {"where": "690-710 nm", "missed": "film.csv"}),
            "does not explain film.csv: even the best fit misses by 0.012 on average, more than noise and the"
            " usual errors of instruments and samples would, most of all 690-710 nm. Its thickness 300 nm",
        ),
        (Status.CONVERGED, TWO, {}, f"determine thickness: {EXPANDED} and b.thickness: 70.0 ± 9.8 nm (95 %"),
        (Status.MISFIT, TWO, {}, "Its thickness 300 nm and b.thickness 70 nm should not be used."),
        (Status.NOT_IDENTIFIABLE, TWO | UNSEEN_B, {}, "do not determine b.thickness: it may be anything"),
        (Status.AMBIGUOUS, TWO, OTHER_B, "determine b.thickness: 70.0 ± 9.8 nm (95 %) fits best, but 90 nm"),
        (Status.MISFIT, {}, {"unit": " degrees"}, "misses by 0.012 degrees on average, more"),
        (Status.NOT_CONVERGED, {}, {}, "its best point so far, thickness 300 nm, should not be used."),
    ],
)
def test_wording_of_verdicts(status, parameters, options, words):
    given = {"rivals": (), "rms": 0.012} | options
    assert words in verdict(status, {"thickness": LEAD} | parameters, **given)


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
