"""Simulated and fitted again: the truth comes back within its errors, for every kind of scene."""

import time

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion import Constant
from pellicle.errors import DataError, UsageError
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


@pytest.mark.slow  # compiles for 5 s each; test_search.py recovers thickness and n
@pytest.mark.parametrize("signal", ["R", "T"])
def test_thickness_n_and_k(film, measured, signal):
    scene = film(material=Constant(N, K), substrate=Constant(1.5), light=pl.Light(signal=signal))
    fit = pl.fit(measured(scene, 1.72, 0.03, 480.0, noise=0.002), scene)
    agrees(fit, {"n": 1.72, "k": 0.03, "thickness": 480.0})
    assert fit.rms == pytest.approx(0.002, rel=0.2)
    assert fit["thickness"].unit == "nm"
    assert fit.plan.on("transmission") == (signal == "T")


@pytest.mark.slow  # compiles a fit of its own
def test_angles_of_the_spectrum_go_before_those_of_the_scene(film, measured):
    data = measured(film(light=pl.Light(angle=60.0, polarisation="s")), 480.0)
    angle = np.full(len(data), 60.0)
    stated = pl.Spectrum(data.wavelength, data.values, "R", polarisation="s", angle=angle)
    agrees(pl.fit(stated, film()), {"thickness": 480.0})


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


@pytest.mark.slow  # compiles a scene of its own
def test_a_free_bandwidth(film, measured):
    scene = film(instrument=pl.Instrument(bandwidth=pl.Free(0.0, 40.0)))
    fit = pl.fit(measured(scene, 900.0, 25.0), scene)
    agrees(fit, {"thickness": 900.0, "instrument.bandwidth": 25.0})
    assert fit.plan.on("coherence")


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
    assert held["thickness"].stderr < free["thickness"].stderr
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


def test_nothing_free(film, measured):
    with pytest.raises(UsageError, match="nothing is free"):
        pl.fit(measured(film(), 480.0), film(480.0))


def test_one_point_is_no_spectrum(film):
    with pytest.raises(DataError, match=r"spot\.csv: holds one point of R"):
        pl.fit(pl.Spectrum(np.array([550.0]), np.array([0.2]), "R", path="spot.csv"), film())


@pytest.mark.slow  # compiles a fit of its own
def test_an_uncalibrated_intensity_needs_a_scale(film, measured):
    data = measured(film(), 480.0)
    counts = pl.Spectrum(data.wavelength, 900 * data.values, "R", calibrated=False, path="lamp.csv")
    with pytest.raises(UsageError, match=r'lamp\.csv: .*`scale="slow"`'):
        pl.fit(counts, film())
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


@pytest.mark.slow  # compiles a fit of its own
def test_a_scene_without_a_free_thickness(film, measured):
    scene = film(480.0, Constant(N, K))
    fit = pl.fit(measured(scene, 1.6, 0.02), scene)
    agrees(fit, {"n": 1.6, "k": 0.02})
    assert fit.profile is None
    assert not fit["thickness"].free
    assert fit["thickness"].value == 480


def test_the_record(film, measured):
    """What a fit returns beside the parameters."""
    scene = film(material=Constant(N))
    data = measured(scene, 1.5, 480.0, sigma=True)
    began = time.perf_counter()
    fit = pl.fit(data, scene)
    elapsed = time.perf_counter() - began
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
    assert 0 < fit.seconds <= elapsed


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
