"""Fits of normalised Mueller elements, against data by the package tmm."""

import re
from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError
from pellicle.fitting.comparison import compare
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.fit_tables import fit_csv
from pellicle.reporting.fit_text import report
from pellicle.reporting.json_record import to_json

from ...by_tmm import ncs

NM = np.linspace(400.0, 800.0, 128)
ANGLE, THICKNESS, INDEX, SUBSTRATE = 70.0, 180.0, 1.46, 3.9 + 0.02j
ELEMENTS = ("m12", "m22", "m33", "m34", "m43")
NOISE = np.array([0.001, 0.002, 0.004, 0.002, 0.008])


def measured(thickness: float = THICKNESS, seed: int = 3) -> pl.Spectrum:
    """Data without σ, whose elements have a noise of their own."""
    n, c, s = ncs(NM, [1, INDEX, SUBSTRATE], [thickness], ANGLE).T
    values = np.stack([-n, np.ones(len(NM)), c, s, -s], axis=1)
    values += NOISE * np.random.default_rng(seed).normal(size=values.shape)
    return pl.Spectrum(NM, values, "mueller", elements=ELEMENTS)


def scene(index: complex = INDEX) -> pl.Scene:
    light = pl.Light(angle=ANGLE, signal="mueller")
    layer, none = pl.Layer(index, pl.Free(10, 500)), pl.Uncertainty.none()
    return pl.Scene(layer, SUBSTRATE, light=light, uncertainty=none)


@pytest.fixture(scope="module")
def fit() -> pl.Fit:
    return pl.fit(measured(), scene())


@pytest.mark.slow  # fits of Mueller elements compile for 5 s
def test_the_thickness_is_found_and_each_element_has_its_own_noise(fit):
    thickness, [part] = fit["thickness"], fit.parts
    assert fit.status == "converged"
    assert abs(thickness.value - THICKNESS) < 4 * thickness.stderr
    assert thickness.stderr < 0.02
    np.testing.assert_allclose(part.curve.sigma[0], NOISE, rtol=0.2)  # 1/√256 = 0.06
    assert part.curve.data.shape == part.curve.model.shape == (128, 5)
    # of all values; that of the noisiest counts most
    assert fit.rms == pytest.approx(np.sqrt(np.mean(NOISE**2)), rel=0.15)


@pytest.mark.slow  # the same fit
def test_records(fit, write):
    record = to_json(fit)["data"]
    assert (record["signal"], record["points"]) == ("mueller", 128)
    assert "mueller (m12, m22, m33, m34, m43), 128 points from 400 to 800 nm" in report(fit)
    path = write(fit_csv(fit), "fit.csv")
    back = read_spectrum(path)
    assert back.elements == ELEMENTS
    np.testing.assert_allclose(back.values, fit.parts[0].data.values, rtol=1e-9)
    np.testing.assert_allclose(back.sigma, fit.parts[0].curve.sigma, rtol=1e-9)


@pytest.mark.slow  # the same fit
def test_the_figure_has_a_panel_for_each_element(fit):
    panels = draw(fit).axes[:16]
    assert [i for i, panel in enumerate(panels) if len(panel.lines)] == [1, 5, 10, 11, 14]
    np.testing.assert_allclose(panels[1].lines[0].get_ydata(), fit.parts[0].data.values[:, 0])


@pytest.mark.slow  # the same fit
def test_a_wrong_index_is_a_misfit_and_compare_says_so(fit):
    wrong = pl.fit(measured(), scene(1.8))
    assert wrong.status == "misfit"
    assert compare({"right": fit, "wrong": wrong}).best.name == "right"


@pytest.mark.slow  # the same fit
def test_the_other_sign_of_the_fourth_stokes_parameter_is_named():
    data = measured()
    signs = np.array([1, 1, 1, -1, -1])
    found = pl.fit(replace(data, values=data.values * signs), scene())
    assert found.status == "misfit"
    words = r"with the opposite signs of m34, m43 it would fit, with thickness ([\d.]+) "
    [thickness] = [match[1] for warning in found.warnings if (match := re.match(words, warning))]
    assert float(thickness) == pytest.approx(THICKNESS, abs=0.05)


@pytest.mark.slow  # compiles a program for five wavelengths
def test_residuals_of_a_few_wavelengths_that_are_no_noise():
    """Of five wavelengths with the other sign, which have no structure: it was 118 nm, converged."""
    nm = np.linspace(400, 900, 5)
    silicon = np.array([5.57 + 0.387j, 4.25 + 0.056j, 3.91 + 0.022j, 3.75 + 0.010j, 3.65 + 0.004j])
    n, c, s = ncs(nm, [1, 1.46, silicon], [240.0], 65.0).T
    values, elements = np.stack([-n, c, -s, s], axis=1), ("m12", "m33", "m34", "m43")
    data = pl.Spectrum(nm, values, "mueller", angle=np.full(5, 65.0), elements=elements)
    found = pl.fit(data, pl.Scene(pl.Layer(1.46, pl.Free(1, 600)), "Si"))
    assert found.status == "misfit"
    assert any(x.startswith("with the opposite signs of m34, m43") for x in found.warnings)


@pytest.mark.slow  # the same fit
def test_a_given_sigma_for_each_element_is_absolute(fit):
    given = pl.fit(replace(measured(), sigma=np.tile(NOISE, (128, 1))), scene())
    assert given.parts[0].sigma_from == "given"
    assert given.chi2_reduced == pytest.approx(1.0, abs=0.2)  # √(2/640) = 0.06
    assert given["thickness"].stderr == pytest.approx(fit["thickness"].stderr, rel=0.3)


def test_simulation_of_chosen_elements():
    exact = replace(scene(), layers=(pl.Layer(INDEX, THICKNESS),))
    spectrum = pl.simulate(exact, NM, elements=["m34", "m12"])
    assert spectrum.elements == ("m34", "m12")
    np.testing.assert_allclose(spectrum.values[:, 1], measured().values[:, 0], atol=6 * NOISE[0])
    assert pl.simulate(exact, NM).values.shape == (128, 15)
    with pytest.raises(UsageError, match="`elements` go with"):
        pl.simulate(replace(exact, light=pl.Light()), NM, elements=["m12"])
