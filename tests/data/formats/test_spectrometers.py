"""Text files of Avantes, Ocean Optics, StellarNet, PerkinElmer, JASCO and Bruker."""

import numpy as np
import pytest

from pellicle.data.read_counts import read_counts, read_counts_beside
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError
from tests.data.tables import assert_read, sample

AVASOFT_7, AVASOFT_6 = sample("avantes/avasoft_7.txt"), sample("avantes/avasoft_6.txt")
COUNTS = AVASOFT_7.replace(";Reflectance", "").replace(" ;[%]", "")


for column in (";50.00000", ";25.00000", ";12.50000"):
    COUNTS = COUNTS.replace(column, "")


@pytest.mark.parametrize(("text", "signal"), [(AVASOFT_7, "R"), (AVASOFT_6, "T")])
def test_the_computed_column(write, text, signal):
    spectrum = read_spectrum(write(text))
    assert_read(spectrum, signal=signal, wavelength=[400.78, 401.38, 401.98], values=[0.5, 0.25, 0.125])
    assert any("ignored" in note and "'dark counts'" in note for note in spectrum.notes)


def test_avantes_facts(write):
    facts = dict(read_spectrum(write(AVASOFT_7)).declared)
    assert (facts["instrument"], facts["integration_time"]) == ("1501000U1", "84.900 ms")
    facts = dict(read_spectrum(write(AVASOFT_6)).declared)
    assert (facts["sample"], facts["integration_time"]) == ("film 3", "175 ms")


def test_avantes_absorbance(write):
    text = AVASOFT_7.replace("Reflectance", "Absorbance").replace("[%]", "[A.U.]")
    text = text.replace("50.0", "0.5").replace("25.0", "1.0").replace("12.5", "2.0")
    values = read_spectrum(write(text)).values
    np.testing.assert_allclose(values, [10**-0.5, 0.1, 0.01])


@pytest.mark.parametrize("names", ["Welle;Probe;Dunkel;Referenz;Reflexion", "Wave;Éch;Noir;Réf;Réflexion"])
def test_names_of_other_languages(write, names):
    text = AVASOFT_7.replace("Wave   ;Sample   ;Dark     ;Reference;Reflectance", names)
    assert_read(read_spectrum(write(text)), signal="R", values=[0.5, 0.25, 0.125])


def test_counts_alone(write, refused):
    refused(COUNTS, "counts of a sample and a reference", '`reference_material="Si"`')
    refused(COUNTS, '`reference_material="Si"`', signal="R")
    spectrum = read_spectrum(write(COUNTS), signal="T")
    np.testing.assert_allclose(spectrum.values, [0.5, 0.25, 0.125], rtol=1e-15)
    assert read_counts(write(COUNTS)).values[0] == 110
    beside = [read_counts_beside(write(COUNTS), f"{part} counts") for part in ("reference", "dark")]
    assert [counts.values[2] for counts in beside] == [100, 20]


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


def test_avantes_what_cannot_be_read(refused):
    refused(AVASOFT_7.partition(" 400.78")[0], "no rows below the units on line 6")
    refused(AVASOFT_7.replace("60.000;   10.000;  210.000;25.00000", "60.000"), "line 9", "is empty")
    refused(AVASOFT_7.replace("[nm]", "[px]").replace("[%]", "[xy]"))
    refused(AVASOFT_7, "contradicts", signal="T", error=UsageError)
    refused(AVASOFT_7, "contradicts", signal_unit="fraction", error=UsageError)
    refused(AVASOFT_7, "contradicts", wavelength_unit="um", error=UsageError)


OCEANVIEW, SPECTRASUITE, JAZ = (
    sample(f"ocean_optics/{name}.txt") for name in ("oceanview", "spectrasuite", "jaz")
)
R = {"signal": "R", "signal_unit": "percent"}


@pytest.mark.parametrize("text", [OCEANVIEW, SPECTRASUITE, JAZ])
def test_the_processed_value(write, text):
    spectrum = read_spectrum(write(text), **R)
    assert_read(spectrum, signal="R", wavelength=[400.1, 400.5, 400.9], values=[0.125, 0.25, 0.5])
    assert dict(spectrum.declared)["date"] == "Tue Mar 05 10:11:12 CET 2024"


def test_ocean_facts(write):
    oceanview = dict(read_spectrum(write(OCEANVIEW), **R).declared)
    assert (oceanview["instrument"], oceanview["integration_time"]) == ("FLMS00001", "3.000000E-1 sec")
    spectrasuite = dict(read_spectrum(write(SPECTRASUITE), **R).declared)
    assert (spectrasuite["instrument"], spectrasuite["integration_time"]) == ("QEA0001", "140000 usec")


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
    refused(text, "line 10", "inf is above 1.5", "`range=(403, 407)`", signal="T")
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
def test_ocean_what_cannot_be_read(refused, old, new, said):
    refused(OCEANVIEW.replace(old, new), *said, **R)


def test_an_absolute_irradiance_is_refused_by_name(refused):
    text = OCEANVIEW.replace("Data from film_Reflection_00001.txt Node", "Jaz Absolute Irradiance File")
    refused(text, "'irradiance'", "neither a reflectance", **R)


def test_no_rows(refused):
    refused(OCEANVIEW.partition("400.1")[0], "no rows", **R)
    refused(JAZ.partition("400.1")[0], "no rows", **R)


SPECTRAWIZ = sample("stellarnet/spectrawiz.txt")


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


PEDS = sample("perkin_elmer/peds.txt")


def test_transmittance_in_percent(write):
    spectrum = read_spectrum(write(PEDS))
    assert_read(spectrum, signal="T", wavelength=[780, 790, 800], lines=[33, 32, 31])
    assert_read(spectrum, values=[0.855, 0.845, 0.835])
    facts = {"date": "24/03/05", "sample": "film 7", "instrument": "Lambda 1050"}
    assert dict(spectrum.declared) == {"format": "PerkinElmer PEDS text"} | facts


@pytest.mark.parametrize(("old", "new"), [("1.0\n0.0", "0.01\n0.0"), ("1.0\n0.0", "1.0\n2.5")])
def test_a_scaled_ordinate(refused, old, new):
    refused(PEDS.replace(old, new), "scales the ordinate", "export it again")


@pytest.mark.parametrize(
    ("ordinate", "signal", "first"),
    [("A", "T", 10**-0.855), ("%R", "R", 0.00855), ("R", "R", 0.855), ("T", "T", 0.855)],
)
def test_other_ordinates(write, ordinate, signal, first):
    text = PEDS.replace("%T", ordinate)
    for whole in ("83", "84", "85"):
        text = text.replace(f"\t{whole}.5", f"\t0.{whole}5")
    spectrum = read_spectrum(write(text))
    assert spectrum.signal == signal
    np.testing.assert_allclose(spectrum.values[0], first, rtol=1e-14)


def test_wavenumbers(write):
    text = PEDS.replace("#GR\nnm", "#GR\ncm-1").replace("PE UV", "PE IR")
    np.testing.assert_allclose(read_spectrum(write(text)).wavelength, 1e7 / np.array([800, 790, 780]))


def test_peds_what_cannot_be_read(refused):
    refused(PEDS.replace("#GR\nnm", "#GR\npx"), "line 20", "'px'")
    refused(PEDS.replace("%T", "KM"), "KM", "neither a reflectance")
    refused(PEDS.partition("800.000000\t")[0], "no rows below #DATA")
    refused(PEDS.partition("#DATA")[0], "lacks the block")
    refused(PEDS.replace("\t84.5", ""), "line 32", "is empty")
    refused(PEDS, "contradicts", signal="R", error=UsageError)
    refused(PEDS, "contradicts", signal_unit="fraction", error=UsageError)


def test_fewer_points_than_stated(write):
    spectrum = read_spectrum(write(PEDS.partition("780.000000\t")[0]))
    assert "states 3 points but has 2: it may have been cut off" in spectrum.notes


JASCO = sample("jasco/absorbance.txt")


def test_jasco_absorbance(write):
    spectrum = read_spectrum(write(JASCO))
    assert_read(spectrum, signal="T", wavelength=[798, 799, 800], values=10.0 ** -np.array([0.25, 0.5, 1.0]))
    facts = dict(spectrum.declared)
    assert (facts["sample"], facts["date"], facts["instrument"]) == ("film 7", "24/03/05", "V-770")


@pytest.mark.parametrize(("units", "signal"), [("%T", "T"), ("%R", "R"), ("Reflectance [%]", "R")])
def test_percent(write, units, signal):
    spectrum = read_spectrum(write(JASCO.replace("ABSORBANCE", units)))
    assert_read(spectrum, signal=signal, values=[0.0025, 0.005, 0.01])


def test_an_undeclared_unit_is_asked_for(write, refused):
    text = JASCO.replace("ABSORBANCE", "TRANSMITTANCE")
    refused(text, "states no unit", '`signal_unit="percent"`')
    assert read_spectrum(write(text), signal_unit="percent").values[0] == 0.0025


def test_sections_without_a_blank_line(write):
    text = JASCO.replace("\n##### Extended Information\n", "").replace("NPOINTS\t3", "NPOINTS\t9")
    spectrum = read_spectrum(write(text))
    assert len(spectrum) == 3
    assert "states 9 points but has 3: it may have been cut off" in spectrum.notes


def test_a_section_without_a_title(write):
    text = JASCO.partition("##### Ext")[0] + "Light source\tautomatic\nScans\t3\n5.0\t6.0\n"
    assert len(read_spectrum(write(text))) == 3


def test_jasco_what_cannot_be_read(refused):
    refused(JASCO.replace("ABSORBANCE", "CD[mdeg]"), "'CD[mdeg]'", "neither a reflectance", signal="T")
    refused(JASCO.replace("NANOMETERS", "PIXELS"), "'PIXELS'")
    refused(JASCO.partition("800\t1.0")[0], "no rows below XYDATA on line 15")
    refused(JASCO.replace("799\t0.5", "799"), "line 17", "is empty")
    refused(JASCO.replace("XYDATA", "XYDATA1\t25\t30"), "several temperatures")


DPT = sample("bruker_dpt/energies.dpt")


def test_a_dpt_states_nothing(write, refuses):
    path = write(DPT, "film.dpt")
    for asked in ({}, {"signal": "R"}, {"signal": "R", "wavelength_unit": "cm-1"}):
        refuses(ValueError, "state", read_spectrum, path, **asked)
    spectrum = read_spectrum(path, signal="R", wavelength_unit="cm-1", signal_unit="fraction")
    assert_read(spectrum, wavelength=1e7 / np.array([3999.5, 2000, 1000]), values=[0.25, 0.5, 0.75])
