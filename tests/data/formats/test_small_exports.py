"""StellarNet SpectraWiz, Bruker dpt, and exports that are plain tables, such as Hitachi's and Thermo's."""

from __future__ import annotations

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum

SPECTRAWIZ = """\
"File: C:\\\\spectra\\\\film 3.TRM   "
"Wave   2048 pixels   Ver 5.33"
  400.00   25.5
  400.50   26.5
  401.00   27.5
"""
DPT = "3999.5,0.25\n2000.0,0.5\n1000.0,0.75\n"
HITACHI = """\
Sample:\tfilm 7
File name:\ta.UDS
Run Date:\t10:00:00, 03/05/2024
Model:\tUH4150 Spectrophotometer
Data Mode:\t%R
Starting Wavelength:\t800.00 nm
Data Points
nm\t%R
800.00\t12.5
799.00\t25.0
"""


def test_spectrawiz(write, refused):
    refused(SPECTRAWIZ, "states no quantity", '`signal="R"`')
    spectrum = read_spectrum(write(SPECTRAWIZ), signal="R")
    np.testing.assert_allclose(spectrum.values, [0.255, 0.265, 0.275])
    assert dict(spectrum.declared)["sample"] == "film 3"
    absorbance = read_spectrum(write(SPECTRAWIZ.replace("TRM", "ABS")))
    np.testing.assert_allclose(absorbance.values, 10.0 ** -np.array([25.5, 26.5, 27.5]))
    refused(SPECTRAWIZ.replace("TRM", "SSM"), "'scope'", "neither a reflectance", signal="T")
    refused(SPECTRAWIZ.replace("TRM", "IRR"), "'irradiance'", signal="T")
    refused(SPECTRAWIZ.partition("  400.00")[0], "no rows", signal="R")
    refused(SPECTRAWIZ.replace("   26.5", ""), "line 4", "is empty", signal="R")


def test_encodings_of_spectrawiz(same_in_every_encoding):
    same_in_every_encoding(SPECTRAWIZ, signal="R")


def test_a_dpt_states_nothing(write):
    path = write(DPT, "film.dpt")
    for asked in ({}, {"signal": "R"}, {"signal": "R", "wavelength_unit": "cm-1"}):
        with pytest.raises(ValueError, match="state"):
            read_spectrum(path, **asked)
    spectrum = read_spectrum(path, signal="R", wavelength_unit="cm-1", signal_unit="fraction")
    np.testing.assert_allclose(spectrum.wavelength, 1e7 / np.array([3999.5, 2000, 1000]))
    np.testing.assert_array_equal(spectrum.values, [0.25, 0.5, 0.75])


def test_a_dpt_in_nm(write):
    path = write(DPT.replace("3999.5", "900").replace("2000.0", "800").replace("1000.0", "700"), "film.DPT")
    asked = {"signal": "T", "wavelength_unit": "nm", "signal_unit": "absorbance"}
    np.testing.assert_allclose(read_spectrum(path, **asked).values, 10.0 ** -np.array([0.75, 0.5, 0.25]))


def test_hitachi(write):
    spectrum = read_spectrum(write(HITACHI))
    np.testing.assert_array_equal(spectrum.values, [0.25, 0.125])
    facts = dict(spectrum.declared)
    assert (spectrum.signal, facts["sample"]) == ("R", "film 7")
    assert facts["instrument"] == "UH4150 Spectrophotometer"


@pytest.mark.parametrize(
    ("text", "signal", "values"),
    [
        ('"Wavelength(nm)","%T"\n800,50\n799,25\n', "T", [0.25, 0.5]),
        ("nm, A\n800.000000,1.0\n799.000000,2.0\n", "T", [0.01, 0.1]),
        ("Wavelength(nm);Reflectance(%)\n800,5;12,5\n799;25,0\n", "R", [0.25, 0.125]),
        ('"Wavelength (nm)"\t"Reflectance"\n800\t0,5\n799,5\t0,25\n', "R", [0.25, 0.5]),
    ],
)
def test_thermo_uv_winlab_and_filmetrics(write, text, signal, values):
    spectrum = read_spectrum(write(text))
    assert spectrum.signal == signal
    np.testing.assert_allclose(spectrum.values, values)
