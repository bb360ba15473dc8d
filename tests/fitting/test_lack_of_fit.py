"""Lack of fit of repeated sweeps, against a published example and against sums written out."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.repeated_sweeps import mean_spectrum
from pellicle.fitting.curves import Curve
from pellicle.fitting.lack_of_fit import LackOfFit, lack_of_fit
from pellicle.fitting.result import Part

NM = np.linspace(400.0, 800.0, 128)


def part(model, sweeps) -> Part:
    spectra = [pl.Spectrum(NM, values, "R") for values in sweeps]
    mean = mean_spectrum(spectra) if len(spectra) > 1 else spectra[0]
    curve = Curve(NM, mean.values, NM, model, NM, NM, NM, NM)
    rms = float(np.sqrt(np.mean((mean.values - model) ** 2)))
    plan = pl.plan(pl.Scene(pl.Layer(1.46, 100.0), 3.9))
    return Part("", mean, curve, plan, rms, 1.0, 128.0)


def test_sums_of_squares_of_all_sweeps():
    """The sum of squares of all sweeps about a model is that within sweeps and that of their mean: F compares
    the two, each over its degrees of freedom."""
    model, rng = 0.3 + 0.1 * np.cos(NM / 30), np.random.default_rng(0)
    sweeps = model + rng.normal(0, 0.002, (3, 128)) + 0.001 * np.sin(NM / 50)
    found = lack_of_fit(part(model, sweeps), 2)
    about_model, within = np.sum((sweeps - model) ** 2), np.sum((sweeps - sweeps.mean(axis=0)) ** 2)
    expected = ((about_model - within) / 126) / (within / 256)
    assert found.freedom == (126, 256)
    assert found.ratio == pytest.approx(expected)
    assert found.repeatability == pytest.approx(np.sqrt(within / 256))
    assert lack_of_fit(part(model, sweeps[:1]), 2) is None


def test_probability_from_a_table():
    """The 5 % and 1 % points of F on 5 and 10 degrees of freedom are 3.326 and 5.636 (NIST e-Handbook of
    statistical methods, 1.3.6.7.3)."""
    for ratio, probability in ((3.326, 0.05), (5.636, 0.01)):
        assert LackOfFit(2, 0.1, ratio, (5, 10)).probability == pytest.approx(probability, rel=1e-3)


@pytest.mark.parametrize(
    ("error", "drift", "words"),
    [
        (0.0, 0.0, "the scene explains the data"),
        (0.01, 0.0, "the scene misses something"),
        (0.0, 0.01, "the sweeps drift as a whole"),
    ],
)
def test_verdicts(error, drift, words):
    model, rng = 0.3 + 0.1 * np.cos(NM / 30), np.random.default_rng(3)
    noise = rng.normal(0, 0.002, (3, 128))
    shifts = drift * np.array([-1.0, 0.0, 1.0])[:, None]
    found = lack_of_fit(part(model + error * np.sin(NM / 50), model + noise + shifts), 1)
    assert words in found.verdict


@pytest.mark.slow  # compiles a fit of its own
def test_a_fit_reports_it():
    """A fit of sweeps is the fit of their mean, and says how they scatter."""
    scene, truth = (pl.Scene(pl.Layer(1.46, d), "Si") for d in (pl.Free(250, 350), 300.0))
    sweeps = [pl.simulate(truth, NM, noise=0.002, seed=seed) for seed in range(3)]
    fit = pl.fit(mean_spectrum(sweeps), scene)
    assert fit.chi2_reduced == pytest.approx(1.0, abs=0.4)  # 127 degrees of freedom: 0.13
    assert abs(fit["thickness"].value - 300) < 4 * fit["thickness"].stderr
    # 256 degrees of freedom: 4.4 %
    found = lack_of_fit(fit.parts[0], 1)
    assert found.repeatability == pytest.approx(0.002, rel=0.2)
    expected = f"sweeps 3, of which a point scatters by {found.repeatability:.2g}; {found.verdict}"
    assert expected in " ".join(fit.report().split())
