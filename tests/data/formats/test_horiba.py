"""Text files of Horiba's DeltaPsi2."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum

SPE = """\
# SAMPLE:
oxide, centre

# DATE:
2021-03-04 12:00:00

# INCIDENCE ANGLE:
70.00°

# COMMENT:

# DATA:
nm eV Psi Delta Is Ic
400.5 3.0957 20.5 170.25 0.111 -0.646
410.5 3.0203 21.5 169.5 0.124 -0.670
"""


@pytest.mark.parametrize("text", [SPE, SPE.replace("# COMMENT:\n", "").replace("\n\n", "\n")])
def test_psi_and_delta(write, text):
    spectrum = read_spectrum(write(text))
    np.testing.assert_array_equal(spectrum.wavelength, [400.5, 410.5])
    np.testing.assert_array_equal(spectrum.angle, [70, 70])
    np.testing.assert_array_equal(spectrum.values, [20.5, 21.5])
    np.testing.assert_array_equal(spectrum.delta, [170.25, 169.5])
    assert dict(spectrum.declared)["sample"] == "oxide, centre"
    assert "columns ignored: eV, Is, Ic" in spectrum.notes


def test_energies(write):
    text = SPE.replace("nm eV", "eV").replace("400.5 ", "").replace("410.5 ", "")
    np.testing.assert_allclose(read_spectrum(write(text)).wavelength, [400.5, 410.5], rtol=1e-4)


def test_refused(refused):
    refused(SPE.replace("Psi Delta Is Ic", "Is Ic a b"), "line 13 names nm, eV, Is, Ic", "export these")
    refused(SPE.replace("nm eV", "steps eV"), "its angle below INCIDENCE ANGLE")
    refused(SPE.replace("70.00°", "seventy"), "its angle below INCIDENCE ANGLE")
    refused(SPE[:-8], "line 15 has other values than the 6 columns")
    refused(SPE.partition("400.5")[0], "no rows below the 6 columns")
    refused(SPE.replace("20.5", "95.5"), "line 14", "0 to 90")


def test_encodings(same_in_every_encoding):
    same_in_every_encoding(SPE)


def test_decimal_commas(write):
    spectrum = read_spectrum(write(SPE.replace(".", ",")))
    np.testing.assert_array_equal(spectrum.delta, [170.25, 169.5])
    np.testing.assert_array_equal(spectrum.angle, [70, 70])
