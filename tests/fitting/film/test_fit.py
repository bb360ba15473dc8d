"""Simulated and fitted again: the truth comes back within its errors, for scenes of every kind."""

import math
from dataclasses import replace

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion import Constant
from pellicle.effects.film_plan import exact
from pellicle.effects.removal import FilmRemoval
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film import fit as fitting
from pellicle.scene.free import free_leaves
from pellicle.simulation.spectra import simulate_signal

N, K = pl.Free(1.3, 1.9), pl.Free(0.0, 0.5)


def agrees(fit, truth, sigmas=4.0):
    """Every free parameter within so many of its own errors, and these are not useless."""
    assert fit.status == "converged", fit.verdict
    for name, value in truth.items():
        estimate = fit[name]
        assert abs(estimate.value - value) <= sigmas * estimate.stderr, (name, estimate)
        assert estimate.stderr < 0.1 * (estimate.upper - estimate.lower), (name, estimate)


THREE = {"n": 1.72, "k": 0.03, "thickness": 480.0}
WINDOW = pl.Instrument(bandwidth=pl.Free(0.0, 40.0))
CASES = {
    "R": ({"material": Constant(N, K), "substrate": Constant(1.5)}, THREE, {}),
    "T": (
        {"material": Constant(N, K), "substrate": Constant(1.5), "light": pl.Light(signal="T")},
        THREE,
        {"transmission"},
    ),
    "bandwidth": ({"instrument": WINDOW}, {"thickness": 900.0, "instrument.bandwidth": 25.0}, {"coherence"}),
    "no thickness": ({"thickness": 480.0, "material": Constant(N, K)}, {"n": 1.6, "k": 0.02}, {}),
}


@pytest.mark.slow  # compiles for 5 s each; test_search.py recovers thickness and n
@pytest.mark.parametrize("name", CASES)
def test_the_truth_comes_back(film, measured, name):
    described, truth, effects = CASES[name]
    scene = film(**described)
    fit = pl.fit(measured(scene, *truth.values(), noise=0.002), scene)
    agrees(fit, truth)
    assert fit.rms == pytest.approx(0.002, rel=0.2)
    assert fit["thickness"].unit == "nm"
    assert {effect for effect in ("transmission", "coherence") if fit.plan.on(effect)} == set(effects)
    assert (fit.profile is None) == (not fit["thickness"].free) == ("thickness" not in truth)


@pytest.mark.slow  # compiles a scene of its own
def test_a_plate_with_its_back_face(film, measured):
    plate = pl.Substrate(Constant(1.5), "air", 1.0)
    scene = film(material=2.1, substrate=plate, light=pl.Light(signal="T"))
    fit = pl.fit(measured(scene, 480.0, noise=0.002), scene)
    agrees(fit, {"thickness": 480.0})
    assert "The back face matters: rms 0.00" in fit.verdict
    dark = film(substrate=pl.Substrate(Constant(3.9, 0.02), "air", 1.0))
    opaque = pl.fit(measured(dark, 480.0), dark)
    assert "The back face makes no difference here" in opaque.verdict


@pytest.mark.slow
def test_a_prior_pulls_and_sharpens(film, measured):
    """As another measurement would: on a parameter that the data leave open, the prior is the answer."""
    data = measured(film(12.0, 1.46), noise=0.003, sigma=True)

    def fit(prior):
        index = Constant(pl.Free(1.2, 1.9, prior=prior))
        return pl.fit(data, film(pl.Free(1, 60), index))

    free, held = fit(None), fit(pl.priors.Normal(1.46, 0.01))
    assert free["n"].stderr > 0.03
    assert held["n"].stderr == pytest.approx(0.01, rel=0.1)
    assert abs(held["n"].value - 1.46) < 0.01
    # of the thickness alone the interval by profile is no wider than what effects add beside a known index
    assert (free.status, held.status) == (pl.Status.AMBIGUOUS, pl.Status.CONVERGED)
    assert all(row.explains > -1e-9 for fit in (free, held) for row in fit.budget)
    pulled = fit(pl.priors.Normal(1.6, 0.01))
    assert abs(pulled["n"].value - 1.6) < 0.02


def test_float32_and_the_callers_setting(film, measured):
    """Whatever the caller has, the fit is in float64 and leaves the setting as it was."""
    data = measured(film(), 480.0)
    wide = pl.fit(data, film())
    with jax.enable_x64(False):
        narrow = pl.fit(data, film())
        assert jax.numpy.zeros(1).dtype == np.float32
    assert narrow["thickness"].value == wide["thickness"].value
    assert narrow.curve.model.dtype == np.float64
    assert jax.numpy.zeros(1).dtype == np.float64
    single = pl.Spectrum(data.wavelength.astype(np.float32), data.values.astype(np.float32), "R")
    assert pl.fit(single, film())["thickness"].value == pytest.approx(480, abs=0.5)


def test_nothing_to_fit(film, measured, refuses):
    refuses(UsageError, "nothing is free", pl.fit, measured(film(), 480.0), film(480.0))
    with pytest.raises(DataError, match=r"spot\.csv: holds one point of R"):
        pl.fit(pl.Spectrum(np.array([550.0]), np.array([0.2]), "R", path="spot.csv"), film())


@pytest.mark.slow  # compiles a fit of its own
def test_an_uncalibrated_intensity_needs_a_scale(film, measured, refuses):
    data = measured(film(), 480.0)
    counts = pl.Spectrum(data.wavelength, 900 * data.values, "R", calibrated=False, path="lamp.csv")
    refuses(UsageError, r'lamp\.csv: .*`scale="slow"`', pl.fit, counts, film())
    fit = pl.fit(counts, film(instrument=pl.Instrument("free", "free")))
    agrees(fit, {"thickness": 480.0})
    assert fit["instrument.scale"].value == pytest.approx(900, rel=0.02)


@pytest.mark.slow  # compiles a fit of its own
def test_an_index_near_a_table_over_its_whole_range():
    """An oxide whose index is 0.05 above SOPRA's table, from its first to its last wavelength."""
    oxide, nm = pl.material("HfO2"), np.linspace(250, 900, 131)

    def film(change, thickness):
        return pl.Scene(pl.Layer(pl.dispersion.Shifted(oxide, change), thickness), "SiO2")

    data = pl.simulate(film(0.05, 150.0), nm, noise=0.001, seed=2)
    fit = pl.fit(data, film(pl.Free(-0.3, 0.3), pl.Free(20, 500)))
    agrees(fit, {"n": 0.05, "thickness": 150.0})
    total = np.interp(575.0, nm, np.real(oxide(nm))) + fit["n"].value
    assert f"n is added to the index of HfO2; the sum is {total:.4g} at 575 nm" in fit.warnings


def test_the_record(film, measured):
    """What a fit returns beside the parameters."""
    scene = film(material=Constant(N))
    data = measured(scene, 1.5, 480.0, sigma=True)
    fit = pl.fit(data, scene)
    assert fit.free[0].name == "thickness"
    assert len(free_leaves(scene)) == len(fit.free)
    assert fit.curve.wavelength.shape == fit.curve.model.shape == (128,)
    np.testing.assert_array_equal(fit.curve.data, data.values)
    np.testing.assert_allclose(fit.curve.sigma, 0.003)
    np.testing.assert_allclose(fit.curve.residual, data.values - fit.curve.model)
    assert fit.rms == pytest.approx(np.sqrt(np.mean(fit.curve.residual**2)))
    chi2 = np.sum((fit.curve.residual / 0.003) ** 2) / (128 - 2)
    assert fit.chi2_reduced == pytest.approx(chi2)
    assert [r.delta_chi2 for r in fit.rivals] == sorted(r.delta_chi2 for r in fit.rivals)
    best = fit.profile.delta_chi2.argmin()
    assert abs(fit.profile.thickness[best] - 480) < 40
    assert fit.spectrum is data
    assert fit.seconds > 0


@pytest.mark.slow
def test_rivals_cost_what_a_fit_there_costs(film, measured):
    """Δχ² of a rival against a fit that is allowed nothing else; curves against the closed formula."""
    scene = film()
    data = measured(scene, 480.0, sigma=True)
    fit = pl.fit(data, scene)
    rival = fit.rivals[0]
    at = rival.parameters["thickness"]
    there = pl.fit(data, film(pl.Free(at - 20, at + 20)))
    expected = (there.chi2_reduced - fit.chi2_reduced) * (128 - 1)
    share = fit.effective_points / 128
    assert rival.delta_chi2 == pytest.approx(expected * share, rel=1e-3)
    assert len(fit.rivals) > 1
    for rival in fit.rivals:
        [curve] = rival.curves
        exact = pl.reflectance(data.wavelength, rival.parameters["thickness"], 1.46, 3.9 + 0.02j)
        np.testing.assert_allclose(curve.model, exact, atol=1e-9)
        np.testing.assert_array_equal(curve.data, data.values)


@pytest.mark.slow  # compiles a scene of its own
def test_a_shift_of_the_wavelengths(film):
    """The instrument tells 3 nm too little: the film is seen at λ + 3, its tabled substrate too."""
    nm = np.linspace(400.0, 900.0, 128)
    seen = simulate_signal(film(480.0, substrate="Si"), nm + 3.0, 0.002, 1).values
    shift = pl.Instrument(wavelength_shift=pl.Free(-10.0, 10.0))
    fit = pl.fit(pl.Spectrum(nm, seen, "R"), film(substrate="Si", instrument=shift))
    agrees(fit, {"thickness": 480.0, "instrument.wavelength_shift": 3.0})
    assert fit["instrument.wavelength_shift"].unit == "nm"
    assert abs(pl.fit(pl.Spectrum(nm, seen, "R"), film(substrate="Si"))["thickness"].value - 480) > 1


SAMPLED = np.linspace(400.0, 900.0, 192)
STACK_NOISE = 0.003


def stack(oxide, nitride, **options) -> pl.Scene:
    layers = [pl.Layer("SiO2", oxide, "oxide"), pl.Layer("Si3N4/Vogt-2.09", nitride, "nitride")]
    return pl.Scene(layers, "Si", **options)


@pytest.mark.slow  # fits of two layers; test_compiled_operations.py has their programs
def test_both_thicknesses_come_out():
    """Through a spectrometer's window, which a stack takes by quadrature."""
    instrument = pl.Instrument(bandwidth=4.0)
    truth = {"oxide.thickness": 350.0, "nitride.thickness": 120.0}
    values = simulate_signal(stack(350.0, 120.0, instrument=instrument), SAMPLED, STACK_NOISE, 1).values
    spectrum = pl.Spectrum(SAMPLED, values, "R", sigma=np.full(SAMPLED.size, STACK_NOISE))
    free = stack(pl.Free(150, 550), pl.Free(30, 230), instrument=instrument)
    found = pl.fit(spectrum, free)
    assert found.status == "converged"
    for name, value in truth.items():
        assert abs(found[name].value - value) < 4 * found[name].stderr_noise < 1.0
    assert found.plan.on("stack")


@pytest.mark.slow
def test_quadrature_equals_the_series_for_a_layer_split_in_two():
    """Two halves of one layer are a stack; the whole of it is a series. The window must be the same."""
    instrument = pl.Instrument(bandwidth=5.0)
    whole = pl.Scene(pl.Layer("SiO2", 1500.0), "Si", instrument=instrument)
    halves = pl.Scene([pl.Layer("SiO2", 700.0), pl.Layer("SiO2", 800.0)], "Si", instrument=instrument)
    a, b = simulate_signal(whole, SAMPLED).clean, simulate_signal(halves, SAMPLED).clean
    none = simulate_signal(pl.Scene(pl.Layer("SiO2", 1500.0), "Si"), SAMPLED).clean
    # the series takes the amplitudes at the centre of the window, the quadrature across it
    assert np.max(np.abs(a - b)) < 1e-3 < 0.01 < np.max(np.abs(none - b))


NM = np.linspace(450.0, 850.0, 41)
SMALL = 1e-3


def absorbing(extinction):
    layer = pl.Layer(1.46 + 1j * extinction, pl.Free(150, 350, start=237.0))
    return pl.Scene(layer, 3.9 + 0.02j)


def spectrum(thing):
    values = simulate_signal(thing, NM, SMALL, seed=1).values
    return pl.Spectrum(NM, values, "R", np.full(NM.shape, SMALL))


@pytest.mark.slow  # two fits of a cone of light
def test_a_fit_leaves_out_what_the_tolerance_allows():
    thing = absorbing(1e-6)
    data = spectrum(thing)
    whole, cheap = (pl.fit(data, thing, tolerance=t) for t in (0.0, 1e-3))
    assert not cheap.plan.on("absorption")
    assert cheap.plan.on("precision")
    assert cheap.plan.error_bound <= 1e-3
    (exactly,), (nearly,) = whole.free, cheap.free
    assert abs(exactly.value - nearly.value) < 0.1 * exactly.stderr
    assert cheap.warnings == whole.warnings


@pytest.mark.slow  # two fits of different plans
def test_a_fit_beyond_its_tolerance_is_done_again(monkeypatch):
    """As where the design of the plan missed the place that the best fit is at."""
    thing = absorbing(0.05)
    data = spectrum(thing)

    def careless(absorbing, tolerance, keep):
        return replace(exact(absorbing), left_out=(FilmRemoval("absorption"),), tolerance=tolerance)

    monkeypatch.setattr(
        "pellicle.fitting.film.problem.plan", lambda s, t, k: careless(s, t, k) if t else exact(s)
    )
    found = fitting.fit(data, thing, tolerance=1e-3)
    assert found.plan.on("absorption")
    assert "fitted again with every effect" in found.warnings[0]
    (thickness,) = found.free
    assert thickness.value == pytest.approx(237.0, abs=4 * thickness.stderr)


@pytest.mark.parametrize(
    ("stated", "words"),
    [(0.03, "times the σ that is given: that is too large"), (0.0004, "too small")],
)
def test_a_sigma_that_the_residuals_contradict_is_said(film, measured, stated, words):
    noisy = measured(film(), 430.0, noise=0.003)
    fit = pl.fit(pl.Spectrum(noisy.wavelength, noisy.values, "R", np.full(len(noisy), stated)), film())
    [sentence] = [w for w in fit.warnings if "white noise" in w]
    assert words in sentence


@pytest.mark.parametrize(("index", "needed"), [(1.5, False), (1.62, True)])
def test_a_layer_with_the_index_of_its_substrate_is_no_film(film, measured, index, needed):
    """Whatever thickness and index fit the noise of a bare substrate best."""
    scene = film(pl.Free(10, 1000), Constant(pl.Free(1.3, 2.0)), substrate=Constant(1.5))
    fit = pl.fit(measured(scene, index, 300.0, noise=0.0005), scene)
    assert (fit.status is pl.Status.CONVERGED) is needed
    assert ("No film is needed" in fit.verdict) is not needed
    assert needed or math.isinf(fit["thickness"].stderr)


def test_values_that_are_rounded_have_its_noise(film, measured):
    """A σ of 0.0005 beside steps of 0.01."""
    exact = measured(film(), 430.0, noise=0.0005)
    rounded = pl.Spectrum(exact.wavelength, np.round(exact.values, 2), "R", np.full(len(exact), 0.0005))
    fit = pl.fit(rounded, film())
    assert 0.5 < fit.chi2_reduced < 2
    assert any("rounded to 0.01, and 0.0029 of the noise is that" in w for w in fit.warnings)
    assert not any("rounded" in w for w in pl.fit(exact, film()).warnings)


def test_a_thickness_of_zero_is_no_film_but_has_an_upper_limit(film, measured):
    scene = film(pl.Free(0, 1000))
    fit = pl.fit(measured(scene, 0.0, noise=0.002), scene)
    assert fit.status is pl.Status.NOT_IDENTIFIABLE
    assert 0 < fit["thickness"].upper_limit < 60
    assert fit.verdict.startswith("No film is needed: thickness is at most ")
    assert pl.fit(measured(scene, 100.0, noise=0.002), scene).status is pl.Status.CONVERGED


def test_a_few_points_that_carry_the_residuals_are_said(film, measured):
    clean = measured(film(), 430.0, noise=0.002)
    values = clean.values.copy()
    values[[10, 60, 61]] += 0.2
    fit = pl.fit(pl.Spectrum(clean.wavelength, values, "R"), film())
    assert fit.warnings[0].startswith("3 of 128 points carry 9")
    robust = pl.fit(pl.Spectrum(clean.wavelength, values, "R"), film(), loss="student-t")
    assert f"gives thickness {robust['thickness'].value:.1f}" in fit.warnings[0]
    assert not any("carry" in w for w in (*robust.warnings, *pl.fit(clean, film()).warnings))
