"""Text files of JASCO's Spectra Manager."""

from __future__ import annotations

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum

JASCO = """\
TITLE\tfilm 7
DATA TYPE\tULTRAVIOLET SPECTRUM
ORIGIN\tJASCO
OWNER\t
DATE\t24/03/05
TIME\t10:00:00
SPECTROMETER/DATA SYSTEM\tV-770
RESOLUTION\t
DELTAX\t-1
XUNITS\tNANOMETERS
YUNITS\tABSORBANCE
FIRSTX\t800
LASTX\t798
NPOINTS\t3
XYDATA
800\t1.0
799\t0.5
798\t0.25

##### Extended Information
[Comments]
Sample name\tfilm 7
[Measurement Information]
Bandwidth 5.0 nm
"""


def test_absorbance(write):
    spectrum = read_spectrum(write(JASCO))
    assert spectrum.signal == "T"
    np.testing.assert_array_equal(spectrum.wavelength, [798, 799, 800])
    np.testing.assert_allclose(spectrum.values, 10.0 ** -np.array([0.25, 0.5, 1.0]))
    facts = dict(spectrum.declared)
    assert (facts["sample"], facts["date"], facts["instrument"]) == ("film 7", "24/03/05", "V-770")


@pytest.mark.parametrize(("units", "signal"), [("%T", "T"), ("%R", "R"), ("Reflectance [%]", "R")])
def test_percent(write, units, signal):
    spectrum = read_spectrum(write(JASCO.replace("ABSORBANCE", units)))
    assert spectrum.signal == signal
    np.testing.assert_allclose(spectrum.values, [0.0025, 0.005, 0.01])


def test_an_undeclared_unit_is_asked_for(write, refused):
    text = JASCO.replace("ABSORBANCE", "TRANSMITTANCE")
    refused(text, "states no unit", '`signal_unit="percent"`')
    assert read_spectrum(write(text), signal_unit="percent").values[0] == 0.0025


def test_wavenumbers_and_commas(write):
    spectrum = read_spectrum(write(JASCO.replace("NANOMETERS", "1/CM").replace("\t", ",")))
    np.testing.assert_allclose(spectrum.wavelength, 1e7 / np.array([800, 799, 798]))


def test_every_encoding(same_in_every_encoding):
    same_in_every_encoding(JASCO)


def test_decimal_commas(write):
    text = JASCO.replace("0.5\n", "0,5\n").replace("1.0", "1,0").replace("0.25", "0,25")
    np.testing.assert_allclose(read_spectrum(write(text)).values[1], 10**-0.5)


def test_sections_without_a_blank_line(write):
    text = JASCO.replace("\n##### Extended Information\n", "").replace("NPOINTS\t3", "NPOINTS\t9")
    spectrum = read_spectrum(write(text))
    assert len(spectrum) == 3
    assert "states 9 points but has 3: it may have been cut off" in spectrum.notes


def test_a_section_without_a_title(write):
    text = JASCO.partition("##### Ext")[0] + "Light source\tautomatic\nScans\t3\n5.0\t6.0\n"
    assert len(read_spectrum(write(text))) == 3


def test_what_cannot_be_read(refused):
    refused(JASCO.replace("ABSORBANCE", "CD[mdeg]"), "'CD[mdeg]'", "neither a reflectance", signal="T")
    refused(JASCO.replace("NANOMETERS", "PIXELS"), "'PIXELS'")
    refused(JASCO.partition("800\t1.0")[0], "no rows below XYDATA on line 15")
    refused(JASCO.replace("799\t0.5", "799"), "line 17", "is empty")
    refused(JASCO.replace("XYDATA", "XYDATA1\t25\t30"), "several temperatures")
