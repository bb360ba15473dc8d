"""Film Sense's text files, static and dynamic.

Expected Ψ and Δ are those of N, C and S by hand: N = cos 2Ψ, tan Δ = S/C.
"""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum

HEADING = """\
450.25\t16.00\t6.05\t7.27\t1.453\t1.634\t-0.013
525.5\t26.05\t4.72\t2.96\t1.275\t1.154\t-0.107
"""
STATIC = f"""\
Film_Sense_Data
2\t1\t-65.012\t-0.002\t-0.003\t19.0913
{HEADING}0.50000\t-0.75000\t0.43301\t0.99845\t16.5071
0.00000\t0.00000\t-1.00000\t1.00020\t25.2874
3
Fit_Diff\t0.0046
Thick(nm).1\t1.5973
Model: (not saved), Date: 2024-07-19 16:35, Ver: 3.40, Temp: 29.8
"""
NAMES = "Time\t" + "\t".join(f"{led}_{x}" for led in ("Blue", "IR735") for x in "NCSPI")
DYNAMIC = f"""\
Film_Sense_Dyn_Data
2\t3\t-65.012\t2
{HEADING}{NAMES}\tAlignX\tTemp\tFit_Diff\tThick(nm).2
4.953\t0.5\t-0.75\t0.43301\t0.998\t14.2\t0\t0\t-1\t0.999\t21.8\t-0.007\t30.7\t0.0019\t3.25
14.858\t0.5\t0.75\t0.43301\t0.998\t14.2\t0\t-1\t0\t0.999\t21.8\t-0.007\t30.7\t0.0019\t3.25
24.766\t0.5\t0.75\t-0.43301\t0.99\t14.2\t0\t1\t0\t0.999\t21.8\t-0.007\t30.7\t0.0019\t3.25
"""


def test_static(write):
    spectrum = read_spectrum(write(STATIC))
    assert spectrum.signal == "psi-delta"
    np.testing.assert_array_equal(spectrum.wavelength, [450.25, 525.5])
    np.testing.assert_array_equal(spectrum.angle, [65.012, 65.012])
    np.testing.assert_allclose(spectrum.values, [30.0, 45.0], atol=1e-3)
    np.testing.assert_allclose(spectrum.delta, [150.0, 270.0], atol=1e-3)
    np.testing.assert_allclose(spectrum.depolarisation, [1 - 0.99845**2, 1 - 1.0002**2])
    np.testing.assert_array_equal(spectrum.lines, [5, 6])
    assert not spectrum.folded
    assert dict(spectrum.declared) == {"format": "Film Sense text", "date": "2024-07-19 16:35"}


def test_dynamic(write, refused):
    refused(DYNAMIC, "has 3 spectra: '4.953 s', '14.858 s', '24.766 s'; choose one", '`spectrum="4.953 s"`')
    second = read_spectrum(write(DYNAMIC), spectrum="14.858 s")
    np.testing.assert_allclose(second.values, [30.0, 45.0], atol=1e-3)
    np.testing.assert_allclose(second.delta, [30.0, 180.0], atol=1e-3)
    assert second.name == "14.858 s"
    assert "measured at 14.858 s" in second.notes
    np.testing.assert_array_equal(second.lines, [6 + 1, 6 + 1])
    third = read_spectra(write(DYNAMIC), spectrum="all")[2]
    np.testing.assert_allclose(third.delta, [330.0, 0.0], atol=1e-3)


def test_refused(refused):
    lines = STATIC.splitlines(keepends=True)
    refused("".join(lines[:5]), "has 1 lines of N, C, S for 2 LEDs", "cut short")
    refused("".join(lines[:4]), "has 0 lines of N, C, S")
    refused(lines[0], "line 2")
    refused(STATIC.replace("Sense_Data", "Sense_Map_Data"), "the kind Film_Sense_Map_Data", "not read")
    refused(STATIC.replace("2\t1\t", "x\t1\t"), "line 2", "numbers of LEDs")
    refused(STATIC.replace("2\t1\t", "2\t4\t"), "has 4 measurements by its line 2")
    refused(STATIC.replace("0.99845\t16.5071", ""), "line 5 is not N, C, S")
    refused(STATIC.replace("0.50000\t", "1.50000\t"), "line 5", "degree of polarisation")
    refused(STATIC.replace("450.25", "blue"), "line 5", "'blue'")
    refused(DYNAMIC.replace("Blue_N", "Blue_X"), "should name Time and N, C, S and P of each of its 2 LEDs")
    refused(DYNAMIC.partition("Thick")[0], "no measurement")
    refused(DYNAMIC.replace("\t0.0019\t3.25\n24", "\n24"), "line 7 has 13 values where the heading names 15")


@pytest.mark.parametrize("text", [STATIC, DYNAMIC])
def test_encodings(same_in_every_encoding, text):
    same_in_every_encoding(text)
