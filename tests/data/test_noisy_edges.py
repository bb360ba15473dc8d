"""Edges of a spectrum without light are left out, fringes are not; spectra of two detectors are joined."""

import numpy as np
import pytest
from tmm import coh_tmm

from pellicle.data.noisy_edges import noisy_edges
from pellicle.data.read_spectrum import read_spectrum
from pellicle.reporting.data_panels import measured
from pellicle.reporting.measured_text import to_json
from pellicle.signals.local_scatter import local_scatter

NM = np.arange(200.0, 1100.0, 0.5)
LAMP = 5e4 * np.exp(-(((NM - 600) / 130) ** 2))


def film(nm, thickness, index=1.5, substrate=3.9):
    stack = [1.0, index, substrate], [np.inf, thickness, np.inf]
    return np.array([coh_tmm("s", *stack, 0.0, x)["R"] for x in nm])


def counts(reflectance, seed=0, smooth=1):
    """Counts of a sample, of a reference and of the dark, with noise of 20 counts."""
    rng = np.random.default_rng(seed)
    every = [light + rng.normal(0, 20, NM.size) for light in (reflectance * LAMP, LAMP, 0.0)]
    return [np.convolve(x, np.ones(smooth) / smooth, "same") for x in every]


def test_the_scatter_of_white_noise_on_a_curve():
    noise = np.random.default_rng(1).normal(0, 0.01, NM.size)
    assert np.median(local_scatter(np.sin(NM / 40) + noise)) == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("smooth", [1, 3, 5])
def test_noisy_edges_are_left_out_said_and_recorded(write_columns, smooth):
    """Where the lamp fades, a quotient of counts goes beyond any limit."""
    sample, reference, dark = counts(film(NM, 800.0), smooth=smooth)
    quotient = (sample - dark) / (reference - dark)
    assert np.max(np.abs(quotient)) > 3
    path = write_columns("wavelength_nm,R (-)", NM, quotient)
    spectrum = read_spectrum(path)
    # the true standard deviation; second differences of a mean of n have 2/n of it in place of √6
    share = film(NM, 800.0)
    true = 20 * np.sqrt(1 + share**2 + (1 - share) ** 2) / LAMP
    true *= 1 if smooth == 1 else 2 / np.sqrt(6) / smooth
    expected = NM[true < 8 * max(np.quantile(true, 0.25), 5e-4)][[0, -1]]
    np.testing.assert_allclose(spectrum.wavelength[[0, -1]], expected, atol=40)
    left_out = spectrum.left_out
    assert len(spectrum) + len(left_out.wavelength) == NM.size
    assert any("beyond, noise of an edge; `range=(200, 1099.5)` keeps all" in x for x in spectrum.notes)
    assert to_json(spectrum)["left_out"] == {"points": NM.size - len(spectrum), "reason": "noise of an edge"}
    [panel] = measured(spectrum).panels
    [grey] = [line for line in panel.lines if line.name == "noise of an edge"]
    assert 0 < len(grey.x) < NM.size - len(spectrum)
    with_range = read_spectrum(path, range=(450, 700))
    assert with_range.left_out is None
    assert with_range.wavelength[[0, -1]].tolist() == [450, 700]


def test_the_light_of_the_reference_is_the_cause(write_columns):
    """Where a program writes 0 without light, nothing scatters."""
    sample, reference, dark = counts(film(NM, 800.0), seed=2)
    share = np.where(reference - dark > 200, (sample - dark) / (reference - dark), 0.0)
    lit = NM[reference - dark > 200]
    path = write_columns("wavelength_nm,R (-),sample,dark,reference", NM, share, sample, dark, reference)
    spectrum = read_spectrum(path)
    assert spectrum.left_out.reason == "the reference has no light there"
    low, high = spectrum.wavelength[[0, -1]]
    assert lit[0] < low < 420
    assert 780 < high < lit[-1]
    assert spectrum.values.min() > 0


@pytest.mark.parametrize("step", [0.5, 1.0, 2.0])
def test_fringes_are_no_noise(step):
    """Fringes of a thick film bend more in the blue than noise does: 96 films keep all their points."""
    nm = np.arange(250.0, 1100.0, step)
    for thickness in np.geomspace(50, 60000, 16):
        for noise in (0.0, 3e-3):
            k = 2 * np.pi / nm  # Airy's formula: tmm takes ten seconds for these
            front, back = -0.2, -0.444
            phase = np.exp(2j * k * 1.5 * thickness)
            clean = np.abs((front + back * phase) / (1 + front * back * phase)) ** 2
            values = clean + np.random.default_rng(3).normal(0, noise, nm.size)
            assert noisy_edges(nm, values) is None, thickness


def test_a_level_that_is_wrong_is_no_edge(write_columns, refused):
    """A smooth rise above 1.5 is refused, with the range that can be read."""
    values = np.where(NM < 300, 0.3 + (300 - NM) / 60, 0.3)
    path = write_columns("wavelength_nm,R", NM, values)
    refused(path, "is above 1.5", "`range=(228, 1099)`")
    assert read_spectrum(path, range=(228, 1099)).values.max() <= 1.5


def test_negative_noise_of_an_edge(write_columns):
    """Noise of 0.025 goes below -0.05, as it may; an offset without noise may not (test_bad_spectra)."""
    noise = np.random.default_rng(4).normal(0, 0.025, NM.size)
    values = 0.4 * np.clip((NM - 260) / 300, 0, 1) + noise * np.where(NM < 260, 1, 0.4)
    assert values.min() < -0.05
    assert len(read_spectrum(write_columns("wavelength_nm,T", NM, values))) == NM.size


@pytest.mark.parametrize("layout", ["rising", "falling", "sorted"])
def test_two_detectors_that_overlap(write_columns, layout):
    """The one of longer wavelengths reads 3 % more."""
    low, high = np.arange(400.0, 881.0, 2.0), np.arange(800.0, 1400.0, 2.0)
    truth = film(np.arange(400.0, 1400.0, 2.0), 500.0)
    nm = np.concatenate([low, high])
    values = np.concatenate([truth[: low.size], 1.03 * truth[-high.size :]])
    order = {"rising": np.arange(nm.size), "falling": np.arange(nm.size)[::-1]}
    rows = order.get(layout, np.argsort(nm, kind="stable"))
    spectrum = read_spectrum(write_columns("wavelength_nm,R", nm[rows], values[rows]))
    np.testing.assert_allclose(spectrum.wavelength, np.arange(400.0, 1400.0, 2.0))
    np.testing.assert_allclose(spectrum.values / truth, 1.015, rtol=1e-3)
    assert any("overlap from 800 to 880 nm" in x and "reads +3 %" in x for x in spectrum.notes)


def test_parts_that_are_no_detectors_of_one_sample(write_columns, refused):
    nm = np.concatenate([np.arange(400.0, 881.0, 2.0), np.arange(800.0, 1400.0, 2.0)])
    path = write_columns("wavelength_nm,R", nm, np.where(np.arange(nm.size) < 241, 0.2, 0.4))
    refused(path, "two parts that overlap from 800 to 880 nm", "2 times")
