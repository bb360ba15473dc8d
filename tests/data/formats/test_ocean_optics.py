"""Text files of OceanView, SpectraSuite, OOIBase32 and Jaz."""

from __future__ import annotations

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum

OCEANVIEW = """\
Data from film_Reflection_00001.txt Node

Date: Tue Mar 05 10:11:12 CET 2024
User: someone
Spectrometer: FLMS00001
Trigger mode: 0
Integration Time (sec): 3.000000E-1
Scans to average: 5
XAxis mode: Wavelengths
Number of Pixels in Spectrum: 3
>>>>>Begin Spectral Data<<<<<
400.1\t12.5
400.5\t25.0
400.9\t50.0
"""
SPECTRASUITE = """\
SpectraSuite Data File
++++++++++++++++++++++++++++++++++++
Date: Tue Mar 05 10:11:12 CET 2024
Dark Spectrum Present: Yes
Spectrometers: QEA0001
Integration Time (usec): 140000 (QEA0001)
Number of Pixels in Processed Spectrum: 3
>>>>>Begin Processed Spectral Data<<<<<
400.1\t12.5
400.5\t25.0
400.9\t50.0
>>>>>End Processed Spectral Data<<<<<
"""
JAZ = """\
Jaz Data File
++++++++++++++++++++++++++++++++++++
Date: Tue Mar 05 10:11:12 CET 2024
User: jaz
Integration Time (usec): 1000
>>>>>Begin Processed Spectral Data<<<<<
W\tD\tS\tR\tP
400.1\t10\t35\t210\t12.5
400.5\t10\t60\t210\t25.0
400.9\t20\t110\t200\t50.0
>>>>>End Processed Spectral Data<<<<<
"""
R = {"signal": "R", "signal_unit": "percent"}


@pytest.mark.parametrize("text", [OCEANVIEW, SPECTRASUITE, JAZ])
def test_the_processed_value(write, text):
    spectrum = read_spectrum(write(text), **R)
    np.testing.assert_array_equal(spectrum.wavelength, [400.1, 400.5, 400.9])
    np.testing.assert_array_equal(spectrum.values, [0.125, 0.25, 0.5])
    assert spectrum.signal == "R"
    assert dict(spectrum.declared)["date"] == "Tue Mar 05 10:11:12 CET 2024"


def test_facts(write):
    oceanview = dict(read_spectrum(write(OCEANVIEW), **R).declared)
    assert (oceanview["instrument"], oceanview["integration_time"]) == ("FLMS00001", "3.000000E-1 sec")
    spectrasuite = dict(read_spectrum(write(SPECTRASUITE), **R).declared)
    assert (spectrasuite["instrument"], spectrasuite["integration_time"]) == ("QEA0001", "140000 usec")


def test_every_encoding(same_in_every_encoding):
    same_in_every_encoding(OCEANVIEW, **R)
    same_in_every_encoding(JAZ, **R)


def test_decimal_commas(write):
    spectrum = read_spectrum(write(OCEANVIEW.replace("400.", "400,").replace("12.5", "12,5")), **R)
    np.testing.assert_array_equal(spectrum.values, [0.125, 0.25, 0.5])


@pytest.mark.parametrize("text", [OCEANVIEW, SPECTRASUITE, JAZ])
def test_quantity_and_unit_are_asked_for(refused, text):
    refused(text, "states no quantity", '`signal="R"`', '`signal_unit="percent"`')
    refused(text, "states no unit", '`signal_unit="absorbance"`', signal="T")


def test_counts_of_a_jaz_that_has_not_divided_them(write, refused):
    text = JAZ.replace("\t12.5", "\t35").replace("\t25.0", "\t60").replace("\t50.0", "\t110")
    refused(text, "counts of a sample and a reference", '`signal="T"`', "`reference_material=", signal="R")
    spectrum = read_spectrum(write(text), signal="T")
    np.testing.assert_allclose(spectrum.values, [25 / 200, 50 / 200, 90 / 180], rtol=1e-15)
    assert any("(sample - dark) / (reference - dark)" in note for note in spectrum.notes)


def test_a_reference_without_counts_is_left_out_by_its_range(write, refused):
    rows = "".join(f"{400 + i}\t10\t35\t{10 if i == 2 else 60}\n" for i in range(8))
    text = JAZ.partition("W\t")[0] + "W\tD\tS\tR\n" + rows
    refused(text, "line 10", "inf is above 1.5", "`range`", signal="T")
    spectrum = read_spectrum(write(text), signal="T", range=(402.5, 410))
    np.testing.assert_allclose(spectrum.values, [0.5] * 5)


def test_the_name_of_a_file_of_ooibase(write):
    text = SPECTRASUITE.replace("SpectraSuite", "OOIBase32 Version 2.0.0.5").replace("12.5", "0.5")
    text = text.replace("25.0", "0.25").replace("50.0", "0.125")
    spectrum = read_spectrum(write(text, "film.Master.Absorbance"))
    np.testing.assert_allclose(spectrum.values, 10.0 ** -np.array([0.5, 0.25, 0.125]))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("XAxis mode: Wavelengths", "XAxis mode: Pixels", ("line 9", "'Pixels'")),
        ("XAxis mode: Wavelengths", "XAxis mode: Raman Shifts", ("line 9", "'Raman Shifts'")),
        ("400.5\t25.0", "400.5\tabc", ("line 13", "'abc'")),
        ("400.1\t12.5", "\t".join("123456789"), ("series of spectra",)),
        ("User: someone", "Y Axis mode: Irradiance", ("irradiance", "neither a reflectance")),
    ],
)
def test_what_cannot_be_read(refused, old, new, said):
    refused(OCEANVIEW.replace(old, new), *said, **R)


def test_an_absolute_irradiance_is_refused_by_name(refused):
    text = OCEANVIEW.replace("Data from film_Reflection_00001.txt Node", "Jaz Absolute Irradiance File")
    refused(text, "'irradiance'", "neither a reflectance", **R)


def test_no_rows(refused):
    refused(OCEANVIEW.partition("400.1")[0], "no rows", **R)
    refused(JAZ.partition("400.1")[0], "no rows", **R)


def test_fewer_pixels_than_stated(write):
    spectrum = read_spectrum(write(OCEANVIEW.partition("400.9")[0]), **R)
    assert "states 3 points but has 2: it may have been cut off" in spectrum.notes
