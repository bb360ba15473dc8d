"""Text files of Avantes AvaSoft 6 to 8."""

from __future__ import annotations

import numpy as np
import pytest

from pellicle.data.read_counts import read_counts, read_counts_beside
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError

AVASOFT_7 = """\

Integration time [ms]:  84.900
Averaging Nr. [scans]: 10
Data measured with spectrometer [name]: 1501000U1
Wave   ;Sample   ;Dark     ;Reference;Reflectance
[nm]   ;[counts] ;[counts] ;[counts] ;[%]

 400.78;  110.000;   10.000;  210.000;50.00000
 401.38;   60.000;   10.000;  210.000;25.00000
 401.98;   30.000;   20.000;  100.000;12.50000
"""
AVASOFT_6 = """\
film 3
Integration time: 175 ms
Average: 20 scans
Data measured with spectrometer serial number: 0411000S1
Wave   ;Dark     ;Ref      ;Sample   ;Transmittance
[nm]   ;[counts] ;[counts] ;[counts] ;[% transmittance]
400,78;3,4050;6429,1;124,99;50,0
401,38;-18,870;6876,0;178,64;25,0
401,98;68,625;6304,8;191,64;12,5
"""
COUNTS = AVASOFT_7.replace(";Reflectance", "").replace(" ;[%]", "")
for column in (";50.00000", ";25.00000", ";12.50000"):
    COUNTS = COUNTS.replace(column, "")


@pytest.mark.parametrize(("text", "signal"), [(AVASOFT_7, "R"), (AVASOFT_6, "T")])
def test_the_computed_column(write, text, signal):
    spectrum = read_spectrum(write(text))
    assert spectrum.signal == signal
    np.testing.assert_array_equal(spectrum.wavelength, [400.78, 401.38, 401.98])
    np.testing.assert_array_equal(spectrum.values, [0.5, 0.25, 0.125])
    assert any("ignored" in note and "'dark counts'" in note for note in spectrum.notes)


def test_facts(write):
    facts = dict(read_spectrum(write(AVASOFT_7)).declared)
    assert (facts["instrument"], facts["integration_time"]) == ("1501000U1", "84.900 ms")
    facts = dict(read_spectrum(write(AVASOFT_6)).declared)
    assert (facts["sample"], facts["integration_time"]) == ("film 3", "175 ms")


def test_every_encoding(same_in_every_encoding):
    same_in_every_encoding(AVASOFT_7)
    same_in_every_encoding(AVASOFT_6)


def test_zeros_in_the_text(write):
    content = AVASOFT_7.encode().replace(b"Wave", b"Wave\0").replace(b"1501000U1", b"1501000U1\0\0")
    np.testing.assert_array_equal(read_spectrum(write(content)).values, [0.5, 0.25, 0.125])


def test_absorbance(write):
    text = AVASOFT_7.replace("Reflectance", "Absorbance").replace("[%]", "[A.U.]")
    values = read_spectrum(
        write(text.replace("50.0", "0.5").replace("25.0", "1.0").replace("12.5", "2.0"))
    ).values
    np.testing.assert_allclose(values, [10**-0.5, 0.1, 0.01])


@pytest.mark.parametrize(
    "names", ["Welle;Probe;Dunkel;Referenz;Reflexion", "Wave;Échantillon;Noir;Réf;Réflexion"]
)
def test_names_of_other_languages(write, names):
    text = AVASOFT_7.replace("Wave   ;Sample   ;Dark     ;Reference;Reflectance", names)
    spectrum = read_spectrum(write(text))
    assert spectrum.signal == "R"
    np.testing.assert_array_equal(spectrum.values, [0.5, 0.25, 0.125])


def test_counts_alone(write, refused):
    refused(COUNTS, "counts of a sample and a reference", '`reference_material="Si"`')
    refused(COUNTS, '`reference_material="Si"`', signal="R")
    spectrum = read_spectrum(write(COUNTS), signal="T")
    np.testing.assert_allclose(spectrum.values, [0.5, 0.25, 0.125], rtol=1e-15)
    assert read_counts(write(COUNTS)).values[0] == 110
    assert [
        read_counts_beside(write(COUNTS), f"{part} counts").values[2] for part in ("reference", "dark")
    ] == [100, 20]


def test_a_file_without_counts_of_a_reference(write):
    path = write("wavelength_nm,counts\n400,5\n500,6\n")
    assert read_counts_beside(path, "reference counts") is None


@pytest.mark.parametrize(
    ("name", "unit", "said"),
    [
        ("Irradiance", "[µWatt/cm²]", "'irradiance'"),
        ("Scope", "", "'scope (Scope)'"),
        ("Scope", "[counts]", "'scope (Scope)'"),
    ],
)
def test_other_quantities_are_named(refused, name, unit, said):
    text = AVASOFT_7.replace("Reflectance", name).replace("[%]", unit)
    text = text.replace("Sample   ;", "Xyz;").replace("Reference;", "Xy;")
    refused(text, said, "neither a reflectance")


def test_what_cannot_be_read(refused):
    refused(AVASOFT_7.partition(" 400.78")[0], "no rows below the units on line 6")
    refused(AVASOFT_7.replace("60.000;   10.000;  210.000;25.00000", "60.000"), "line 9", "is empty")
    refused(AVASOFT_7.replace("[nm]", "[px]").replace("[%]", "[xy]"))
    refused(AVASOFT_7, "contradicts", signal="T", error=UsageError)
    refused(AVASOFT_7, "contradicts", signal_unit="fraction", error=UsageError)
    refused(AVASOFT_7, "contradicts", wavelength_unit="um", error=UsageError)
