"""Ellipsometry files of Regress Pro and ADAP: alpha and beta, tan(psi) and cos(delta)."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum

# tan²Ψ = 1/3 and 1, cos Δ = 1/2 and -1/2, fixed polariser at 45 and at 30 degrees:
# α = (tan²Ψ - tan²A)/(tan²Ψ + tan²A), β = 2 tan Ψ cos Δ tan A/(tan²Ψ + tan²A)
AT_45 = """\
SE ALPHA BETA\t\t\t
AOI\t71.5\t\t
A\t45\t\t
SE\t240.5\t-0.5\t0.4330127018922193
SE\t241.5\t0.0\t-0.5
"""
AT_MINUS_30 = """\
SE ALPHA BETA
AOI 71.5
A -30
SE 240.5 0 -.5
SE 241.5 +0.5 0.4330127018922193
"""
TAN_COS = """\
SE PSI DELTA
AOI 71.5
SE 240.5 0.5773502691896258 0.5
SE 241.5 1.0 -0.5
"""


@pytest.mark.parametrize("text", [AT_45, AT_MINUS_30, TAN_COS])
def test_three_codings_of_one_measurement(write, text):
    spectrum = read_spectrum(write(text))
    assert spectrum.signal == "psi-delta"
    assert spectrum.folded
    np.testing.assert_array_equal(spectrum.wavelength, [240.5, 241.5])
    np.testing.assert_array_equal(spectrum.angle, [71.5, 71.5])
    np.testing.assert_allclose(spectrum.values, [30.0, 45.0])
    np.testing.assert_allclose(spectrum.delta, [60.0, 120.0])


def test_angles_that_the_file_does_not_give(write, refused):
    bare = "".join(line for line in AT_45.splitlines(keepends=True) if not line.startswith("A"))
    refused(bare, "need the analyser's angle", "`analyser=45`")
    spectrum = read_spectrum(write(bare), analyser=45)
    np.testing.assert_allclose(spectrum.values, [30.0, 45.0])
    assert spectrum.angle is None
    refused(AT_45, "leave `analyser` out", analyser=45)


def test_refused(refused):
    refused(AT_45.replace("A\t45", "A\tx"), "line 3 is not SE, a wavelength and two values")
    refused(AT_45.replace("\t-0.5\n", "\n"), "line 5 is not SE")
    refused(AT_45[:-6], "line 5 is not SE")
    refused("".join(AT_45.splitlines(keepends=True)[:3]), "no rows")
    refused(AT_45.replace("-0.5\t0.43", "-0.9\t0.83"), "line 4", "contrast")
    refused(AT_45.replace("-0.5\t", "x\t"), "line 4", "'x'")
    refused(TAN_COS.replace("-0.5", "120.5"), "line 4", "120.5 is no cos(delta)", "psi_deg")


@pytest.mark.parametrize("text", [AT_45, AT_MINUS_30, TAN_COS])
def test_encodings(same_in_every_encoding, text):
    same_in_every_encoding(text)


def test_a_text_that_only_begins_so_is_another_format(write):
    assert read_spectra(write("SE ALPHA\nwavelength_nm,R\n500,0.2\n600,0.3\n"))[0].signal == "R"
