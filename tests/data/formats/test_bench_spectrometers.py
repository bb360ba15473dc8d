"""Text files of PerkinElmer, JASCO and Bruker, and exports that are plain tables, as Hitachi's."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError
from tests.data.tables import assert_read, sample

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


def test_absorbance(write):
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


def test_a_dpt_states_nothing(write):
    path = write(DPT, "film.dpt")
    for asked in ({}, {"signal": "R"}, {"signal": "R", "wavelength_unit": "cm-1"}):
        with pytest.raises(ValueError, match="state"):
            read_spectrum(path, **asked)
    spectrum = read_spectrum(path, signal="R", wavelength_unit="cm-1", signal_unit="fraction")
    assert_read(spectrum, wavelength=1e7 / np.array([3999.5, 2000, 1000]), values=[0.25, 0.5, 0.75])
