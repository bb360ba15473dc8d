"""Measured depolarisation in a fit, against averages of films by the package tmm."""

from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.repeated_sweeps import mean_spectrum
from pellicle.errors import UsageError
from pellicle.fitting.comparison import compare
from pellicle.fitting.film.fit import fitted, measurements
from pellicle.fitting.film.systematic_effects import systematic_effects
from pellicle.fitting.linear_system import HALF_NORMAL
from pellicle.fitting.progress import quiet
from pellicle.fitting.reweighting import RankedMinima
from pellicle.sampling.result import predictions

from ...by_tmm import psi_delta, stokes

WAVELENGTH = np.linspace(400.0, 900.0, 64)
SILICON = np.asarray(pl.refractive_index(WAVELENGTH, "Si"))
THICKNESS, SPREAD = 1000.0, 8.0
SPREADS = "instrument.thickness_spread"
PSI, DELTA, SHARE = 0.05, 0.1, 0.003
"""Noise of Ψ and Δ in degrees, and of the depolarisation."""


def averaged(thickness: float, spread: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ψ, Δ and depolarisation at 70° of a film of index 1.46 on silicon, of normal thicknesses: Stokes sums
    of tmm, averaged with Gauss and Hermite's nodes."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    each = [stokes(WAVELENGTH, [1, 1.46, SILICON], [thickness + node * spread], 70.0) for node in nodes]
    sums = np.average(each, axis=0, weights=weights)
    ncs = sums[:, :3] / sums[:, 3:]
    return *psi_delta(*ncs.T), 1 - np.sum(ncs**2, axis=1)


@pytest.fixture(scope="module")
def measured() -> pl.Spectrum:
    rng = np.random.default_rng(1)
    psi, delta, share = averaged(THICKNESS, SPREAD)
    assert 0.03 < share.mean() < 0.08
    return pl.Spectrum(
        WAVELENGTH,
        psi + rng.normal(0, PSI, 64),
        "psi-delta",
        sigma=np.full(64, PSI),
        angle=np.full(64, 70.0),
        path="film.csv",
        delta=(delta + rng.normal(0, DELTA, 64)) % 360,
        delta_sigma=np.full(64, DELTA),
        depolarisation=share + rng.normal(0, SHARE, 64),
        depolarisation_sigma=np.full(64, SHARE),
    )


def scene(spread: pl.Free | None) -> pl.Scene:
    layer = pl.Layer(1.46, pl.Free(800, 1200))
    return pl.Scene(layer, "Si", instrument=pl.Instrument(thickness_spread=spread))


WIDTH = pl.Free(0, 30)


@pytest.fixture(scope="module")
def ranked(measured) -> tuple[pl.Fit, RankedMinima]:
    return fitted(measured, scene(WIDTH), 0.0, quiet)


@pytest.fixture(scope="module")
def together(ranked) -> pl.Fit:
    return ranked[0]


def bounds() -> list[np.ndarray]:
    """Least standard errors of thickness and spread (Cramér and Rao) from Ψ and Δ, and from all three."""
    step, noises = 0.02, (PSI, DELTA, SHARE)
    slopes = []
    for change in ((step, 0.0), (0.0, step)):
        above, below = (averaged(THICKNESS + way * change[0], SPREAD + way * change[1]) for way in (1, -1))
        pairs = zip(above, below, noises, strict=True)
        slopes.append([((a - b + 180) % 360 - 180) / (2 * step * noise) for a, b, noise in pairs])
    columns = np.array(slopes)
    information = [np.einsum("ikp,jkp->ij", columns[:, :n], columns[:, :n]) for n in (2, 3)]
    return [np.sqrt(np.diag(np.linalg.inv(own))) for own in information]


@pytest.mark.slow
def test_the_spread_is_better_determined(together, measured):
    """By as much as the bound of Cramér and Rao says."""
    psi_and_delta, all_three = bounds()
    assert together.status == "converged"
    assert 0.7 < together.chi2_reduced < 1.4
    for name, truth, least in zip(("thickness", SPREADS), (THICKNESS, SPREAD), all_three, strict=True):
        assert together[name].stderr_noise == pytest.approx(least, rel=0.05)
        assert abs(together[name].value - truth) < 4 * least
    assert together[SPREADS].stderr_noise < 0.75 * psi_and_delta[1]
    np.testing.assert_array_equal(together.curve.depolarisation_data, measured.depolarisation)
    assert np.std(together.curve.depolarisation_residual) == pytest.approx(SHARE, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("unknown", [("sigma", "delta_sigma"), ("depolarisation_sigma",)])
def test_a_noise_that_is_not_given_is_that_of_its_own_residuals(measured, together, unknown):
    fit = pl.fit(replace(measured, **dict.fromkeys(unknown)), scene(WIDTH))
    assert fit.status == "converged"
    assert abs(fit[SPREADS].value - SPREAD) < 4 * together[SPREADS].stderr_noise
    # residuals that set the noise also count as correlated, here by chance
    assert 0.8 < fit[SPREADS].stderr_noise / together[SPREADS].stderr_noise < 1.5
    assert np.std(fit.curve.depolarisation_residual) == pytest.approx(SHARE, rel=0.2)


@pytest.mark.slow
def test_a_folded_delta(measured, together):
    delta = np.minimum(measured.delta, 360 - measured.delta)
    fit = pl.fit(replace(measured, delta=delta, folded=True), scene(WIDTH))
    assert fit.status == "converged"
    assert abs(fit[SPREADS].value - SPREAD) < 4 * fit[SPREADS].stderr_noise
    assert fit[SPREADS].stderr_noise < 1.5 * together[SPREADS].stderr_noise


@pytest.mark.slow  # compiles a fit for 4 s
def test_a_scene_without_depolarisation(measured, together):
    """Its fit is that of Ψ and Δ, and says what it leaves out; a comparison counts it."""
    bare = scene(None)
    fit = pl.fit(measured, bare)
    same = pl.fit(replace(measured, depolarisation=None, depolarisation_sigma=None), bare)
    assert fit["thickness"] == same["thickness"]
    assert fit.status == same.status
    [said] = set(fit.warnings) - set(same.warnings)
    assert "the measured depolarisation (rms 0.0" in said
    for cause in ("`thickness_spread`", "`bandwidth`", "`angle_spread`", '`back="air"`'):
        assert cause in said
    assert not fit.curve.depolarisation_model.any()


@pytest.mark.slow
def test_a_comparison_counts_the_depolarisation(measured):
    """Ψ and Δ of next to no weight, of which even and uneven films are alike."""
    vague = replace(measured, sigma=np.full(64, 20.0), delta_sigma=np.full(64, 20.0))
    fits = {"even": pl.fit(vague, scene(None)), "uneven": pl.fit(vague, scene(WIDTH))}
    compared = compare(fits)
    assert compared.best.name == "uneven"
    even, uneven = (candidate.deviance for candidate in compared.candidates)
    assert even - uneven > 100


@pytest.mark.slow  # compiles a fit of its own
def test_noise_alone_is_no_depolarisation(measured):
    share = np.random.default_rng(2).normal(0, 0.02, 64)
    fit = pl.fit(replace(measured, depolarisation=share, depolarisation_sigma=np.full(64, 0.02)), scene(None))
    assert not any("depolarisation" in warning for warning in fit.warnings)


@pytest.mark.slow
def test_predictions(ranked):
    """Of a posterior at one point: the curves of the fit, and noise of σ."""
    fit, problem = ranked[0], ranked[1].problem
    affine = problem.affine()
    units = np.array([(p.value - p.lower) / (p.upper - p.lower) for p in fit.free])
    psi, delta, share = predictions(affine, fit.parts, np.tile(units, (4, 4, 1)), 0)
    assert [own.name for own in (psi, delta, share)] == ["psi", "delta", "depolarisation"]
    np.testing.assert_allclose(psi.model[0], fit.curve.model, atol=1e-5)
    np.testing.assert_allclose(share.model[0], fit.curve.depolarisation_model, atol=1e-6)
    assert np.std(share.noisy - share.model) == pytest.approx(SHARE, rel=0.05)
    assert np.std(psi.noisy - psi.model) == pytest.approx(PSI, rel=0.1)


@pytest.mark.slow
def test_the_mean_of_sweeps(measured):
    """A drift of the depolarisation between sweeps widens the error of what it determines."""
    sweeps = [
        replace(measured, depolarisation=measured.depolarisation + change) for change in (-0.01, 0.0, 0.01)
    ]
    sweeps = [replace(own, values=own.values + 1e-6 * i) for i, own in enumerate(sweeps)]
    mean = mean_spectrum(sweeps)
    np.testing.assert_allclose(mean.depolarisation, measured.depolarisation, rtol=1e-12)
    np.testing.assert_allclose(mean.depolarisation_sigma, SHARE / np.sqrt(3), rtol=1e-12)
    fit = pl.fit(mean, scene(WIDTH))
    assert any("thickness_spread differs by" in warning for warning in fit.warnings)


def test_noise_of_a_simulated_depolarisation():
    light = pl.Light(signal="psi-delta", angle=70.0)
    instrument = pl.Instrument(thickness_spread=SPREAD)
    film = pl.Scene(pl.Layer(1.46, THICKNESS), "Si", light=light, instrument=instrument)
    _, _, share = averaged(THICKNESS, SPREAD)
    noisy = pl.simulate(film, WAVELENGTH, noise=PSI, depolarisation_noise=SHARE)
    assert np.std(noisy.depolarisation - share) == pytest.approx(SHARE, rel=0.3)
    assert set(noisy.depolarisation_sigma) == {SHARE}
    usual = pl.simulate(film, WAVELENGTH, noise=PSI)
    # N, C, S have twice the noise of Ψ, 1 − N² − C² − S² twice theirs
    np.testing.assert_allclose(usual.depolarisation_sigma, 4 * np.deg2rad(PSI))
    assert np.std(usual.depolarisation - share) == pytest.approx(4 * np.deg2rad(PSI), rel=0.3)
    with pytest.raises(UsageError, match="`depolarisation_noise` goes with"):
        pl.simulate(pl.Scene(pl.Layer(1.46, 100.0), "Si"), depolarisation_noise=0.0)


@pytest.mark.slow  # compiles a fit for 9 s
def test_effects_depolarise(ranked, measured):
    """A bandwidth that the scene leaves out, against a simulation that has it: of its own size, times the
    root mean square of a half-normal prior on the variance."""
    problem = ranked[1].problem
    [view], values = problem.views, np.array([THICKNESS, SPREAD])
    allowed = scene(WIDTH)
    allowed = replace(allowed, uncertainty=replace(pl.Uncertainty.none(), bandwidth=0.5))
    [target] = measurements(measured, allowed)
    [effect] = systematic_effects(view, values, view.local(values), target.scene, values)
    light = pl.Light(signal="psi-delta", angle=70.0)

    def share(**more):
        instrument = pl.Instrument(thickness_spread=SPREAD, **more)
        film = pl.Scene(pl.Layer(1.46, THICKNESS), "Si", light=light, instrument=instrument)
        return pl.simulate(film, WAVELENGTH, depolarisation_noise=0.0).depolarisation

    expected = HALF_NORMAL * (share(bandwidth=0.5) - share())
    # the average of normalised Stokes parameters instead of intensities
    np.testing.assert_allclose(effect.change[:, -1], expected, atol=0.1 * np.abs(expected).max())
