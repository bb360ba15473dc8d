"""Fit of a graded film: its parameters, profile.csv and the panel of its figure."""

import csv
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.depth_profiles import fitted_profiles
from pellicle.fitting.result import Fit
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.folders import write_fit

NM = np.linspace(400.0, 900.0, 51)
THICKNESS, TOP, BOTTOM, NOISE = 250.0, 0.2, 0.7, 0.05  # nm, fractions, degrees


def scene(thickness, top, bottom):
    material = pl.Graded("SiO2", "Si3N4", pl.profile.Linear(top, bottom))
    light = pl.Light(NM, angle=70.0, signal="psi-delta")
    return pl.Scene(pl.Layer(material, thickness), "Si", light=light)


@pytest.fixture(scope="module")
def fit():
    """Fit of simulated Ψ and Δ with noise."""
    measured = pl.simulate(scene(THICKNESS, TOP, BOTTOM), NM, noise=NOISE, seed=1)
    free = scene(pl.Free(150.0, 350.0), pl.Free(0.0, 1.0), pl.Free(0.0, 1.0))
    return pl.fit(measured, free)


@pytest.mark.slow  # compiles a fit; the other test, tests/hard/test_gradient.py
def test_a_fit_finds_the_profile(fit, tmp_path):
    assert fit.status == "converged"
    truth = {"thickness": THICKNESS, "top": TOP, "bottom": BOTTOM}
    for name, value in truth.items():
        found = fit.parameters[name]
        assert abs(found.value - value) < 3 * found.stderr_noise, name
        assert found.stderr_noise < 0.05 * value, name

    with open(write_fit(tmp_path / "graded", fit) / "profile.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    names = ("depth_nm", "fraction", "fraction_stderr", "n")
    depth, fraction, stderr, n = (np.array([float(row[name]) for row in rows]) for name in names)
    assert {row["layer"] for row in rows} == {"layer"}
    assert depth[[0, -1]] == pytest.approx([0.0, fit.parameters["thickness"].value])
    np.testing.assert_allclose(fraction, TOP + (BOTTOM - TOP) * depth / depth[-1], atol=0.02)
    assert np.all((stderr > 0) & (stderr < 0.05))
    assert stderr[0] == pytest.approx(fit.parameters["top"].stderr, rel=1e-6)
    # n at both faces, of mixtures of the fitted fractions at the middle of the wavelengths
    for i in (0, -1):
        mixed = pl.mixing.Bruggeman(pl.material("SiO2"), pl.material("Si3N4"), fraction[i])
        assert n[i] == pytest.approx(float(np.real(mixed(650.0))), abs=1e-5)

    assert any("depth" in axes.get_xlabel() for axes in draw(fit).axes)


@pytest.mark.slow
def test_errors_of_a_profile_follow_from_those_of_its_numbers():
    top, bottom, correlation = 0.02, 0.05, -0.5
    estimates = {"thickness": (THICKNESS, 1.0), "top": (TOP, top), "bottom": (BOTTOM, bottom)}
    fit = Mock(
        spec=Fit,
        scene=scene(pl.Free(150.0, 350.0), pl.Free(0.0, 1.0), pl.Free(0.0, 1.0)),
        index=SimpleNamespace(wavelength=NM),
        parameters={x: SimpleNamespace(value=y[0], stderr=y[1]) for x, y in estimates.items()},
        correlation_names=("thickness", "top", "bottom"),
        correlation=((1.0, 0.3, 0.2), (0.3, 1.0, correlation), (0.2, correlation, 1.0)),
    )
    (profile,) = fitted_profiles(fit)
    z = profile.depth / THICKNESS
    np.testing.assert_allclose(profile.fraction, TOP + (BOTTOM - TOP) * z, atol=1e-12)
    variance = ((1 - z) * top) ** 2 + (z * bottom) ** 2 + 2 * correlation * z * (1 - z) * top * bottom
    np.testing.assert_allclose(profile.fraction_stderr, np.sqrt(variance), rtol=1e-9)
    assert np.all(np.diff(profile.n) > 0)
    assert not np.any(profile.k)
