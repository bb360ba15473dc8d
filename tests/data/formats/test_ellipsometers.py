"""Text files of ellipsometers: Horiba, Sentech, Regress Pro and ADAP, Film Sense.

Expected Ψ and Δ of Film Sense are those of N, C and S by hand: N = cos 2Ψ, tan Δ = S/C.
"""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum
from tests.data.tables import assert_read, sample

HORIBA = sample("horiba/psi_delta.txt")


@pytest.mark.parametrize("text", [HORIBA, HORIBA.replace("# COMMENT:\n", "").replace("\n\n", "\n")])
def test_psi_and_delta(write, text):
    spectrum = read_spectrum(write(text))
    assert_read(spectrum, wavelength=[400.5, 410.5], angle=[70] * 2, delta=[170.25, 169.5])
    assert dict(spectrum.declared)["sample"] == "oxide, centre"
    assert "columns ignored: eV, Is, Ic" in spectrum.notes


def test_horiba_refused(refused):
    refused(HORIBA.replace("Psi Delta Is Ic", "Is Ic a b"), "line 13 names nm, eV, Is, Ic", "export these")
    refused(HORIBA.replace("nm eV", "steps eV"), "its angle below INCIDENCE ANGLE")
    refused(HORIBA.replace("70.00°", "seventy"), "its angle below INCIDENCE ANGLE")
    refused(HORIBA[:-8], "line 15 has other values than the 6 columns")
    refused(HORIBA.partition("400.5")[0], "no rows below the 6 columns")
    refused(HORIBA.replace("20.5", "95.5"), "line 14", "0 to 90")


SPECTRARAY = sample("spectraray/two_angles.txt")


def test_spectraray(write):
    spectrum = read_spectrum(write(SPECTRARAY))
    wavelength = np.repeat([400.5, 401.5, 402.5], 2)
    assert_read(spectrum, wavelength=wavelength, angle=[50.2, 70.1] * 3, lines=[2, 2, 3, 3, 4, 4], sigma=None)
    assert_read(spectrum, values=[40.1, 30.1, 40.2, 30.2, 40.3, 30.3])
    assert_read(spectrum, delta=[170.5, 120.5, 180.5, 121.5, 190.5, 122.5])
    assert spectrum.notes[1] == "measured at 50.20000, 70.10000 degrees"


def test_spectraray_of_one_angle_with_decimal_commas(write):
    text = "; WAVELENGTH 70.06 70.06\n319.8 1.75 20.5\n320.2 2.25 352.0\n"
    spectrum = read_spectrum(write(text.replace(".", ",")))
    assert_read(spectrum, wavelength=[319.8, 320.2], angle=[70.06] * 2, delta=[20.5, 352])


def test_spectraray_in_energies(write):
    spectrum = read_spectrum(write("; ENERGY 70 70\n2.0 20 170\n2.5 21 171\n"))
    np.testing.assert_allclose(spectrum.wavelength, 1239.8419843320026 / np.array([2.5, 2.0]))


def test_spectraray_files_that_are_refused(refused):
    refused(SPECTRARAY.replace("70.10000 70.10000", "70.1 70.2"), "line 1", "each angle", "twice")
    refused(SPECTRARAY.replace(" 70.10000 70.10000", " 70.10000"), "line 1", "each angle", "twice")
    apart = SPECTRARAY.replace("50.20000 70.10000", "70.10000 50.20000", 1)
    refused(apart, "line 1", "50.20000 70.10000 50.20000 70.10000")
    refused(SPECTRARAY.replace("70.10000", "50.20000"), "line 1", "each angle", "twice")
    refused(SPECTRARAY.replace(" 121.5", ""), "line 3 has 4 values", "make 5")
    refused("; WAVELENGTH 70 70\n", "no rows")
    refused(SPECTRARAY.replace("30.2", "nan"), "line 3, column 'psi_deg': nan")


def test_a_heading_without_its_mark(write):
    text = SPECTRARAY.removeprefix("; ").replace("WAVELENGTH", "Wavelength")
    np.testing.assert_array_equal(read_spectrum(write(text)).angle, [50.2, 70.1] * 3)


def test_a_mueller_matrix(write, refused):
    """Sixteen columns for each angle, row by row of the matrix."""
    numbers = (100, *range(12, 15), *range(21, 25), *range(31, 35), *range(41, 45))
    matrix = " ".join(f"{x / 100:.2f}" for x in numbers)
    heading = f"; WAVELENGTH{' 70.20000' * 16}{' 60.2' * 16}\n"
    rows = "".join(f"{nm} {matrix} {matrix.replace('0.12', f'0.{nm}')}\n" for nm in (190, 191, 192))
    spectrum = read_spectrum(write(heading + rows))
    assert spectrum.signal == "mueller"
    assert spectrum.elements[0] == "m12"
    assert len(spectrum.elements) == 15
    np.testing.assert_array_equal(spectrum.angle, [60.2, 70.2] * 3)
    np.testing.assert_allclose(spectrum.values[:, 0], [0.190, 0.12, 0.191, 0.12, 0.192, 0.12])
    np.testing.assert_allclose(spectrum.values[0, 1:], [0.13, 0.14, *np.r_[21:25, 31:35, 41:45] / 100])
    refused(f"{heading}190.5{' 0.5' * 31}\n", "line 2 has 32 values", "make 33")
    refused(heading.replace(" 60.2", "", 1), "line 1", "16 times, for a Mueller matrix")


# tan²Ψ = 1/3 and 1, cos Δ = 1/2 and -1/2, fixed polariser at 45 and at 30 degrees:
# α = (tan²Ψ - tan²A)/(tan²Ψ + tan²A), β = 2 tan Ψ cos Δ tan A/(tan²Ψ + tan²A)
AT_45, AT_MINUS_30, TAN_COS = (
    sample(f"regress_pro/{name}.txt") for name in ("at_45", "at_minus_30", "tan_cos")
)


@pytest.mark.parametrize("text", [AT_45, AT_MINUS_30, TAN_COS])
def test_three_codings_of_one_measurement(write, text):
    spectrum = read_spectrum(write(text))
    assert_read(spectrum, signal="psi-delta", folded=True)
    assert_read(spectrum, wavelength=[240.5, 241.5], angle=[71.5] * 2, values=[30, 45], delta=[60, 120])


def test_angles_that_the_file_does_not_give(write, refused):
    bare = "".join(line for line in AT_45.splitlines(keepends=True) if not line.startswith("A"))
    refused(bare, "need the analyser's angle", "`analyser=45`")
    assert_read(read_spectrum(write(bare), analyser=45), angle=None, values=[30.0, 45.0])
    refused(AT_45, "leave `analyser` out", analyser=45)


def test_regress_pro_refused(refused):
    refused(AT_45.replace("A\t45", "A\tx"), "line 3 is not SE, a wavelength and two values")
    refused(AT_45.replace("\t-0.5\n", "\n"), "line 5 is not SE")
    refused(AT_45[:-6], "line 5 is not SE")
    refused("".join(AT_45.splitlines(keepends=True)[:3]), "no rows")
    refused(AT_45.replace("-0.5\t0.43", "-0.9\t0.83"), "line 4", "contrast")
    refused(AT_45.replace("-0.5\t", "x\t"), "line 4", "'x'")
    refused(TAN_COS.replace("-0.5", "120.5"), "line 4", "120.5 is no cos(delta)", "psi_deg")


def test_a_text_that_only_begins_so_is_another_format(write):
    assert read_spectra(write("SE ALPHA\nwavelength_nm,R\n500,0.2\n600,0.3\n"))[0].signal == "R"


FILM_SENSE, TIMES = sample("film_sense/static.txt"), sample("film_sense/dynamic.txt")


def test_static(write):
    spectrum = read_spectrum(write(FILM_SENSE))
    assert_read(spectrum, signal="psi-delta", wavelength=[450.25, 525.5], angle=[65.012, 65.012])
    np.testing.assert_allclose(spectrum.values, [30.0, 45.0], atol=1e-3)
    np.testing.assert_allclose(spectrum.delta, [150.0, 270.0], atol=1e-3)
    assert_read(spectrum, depolarisation=[1 - 0.99845**2, 1 - 1.0002**2], lines=[5, 6], folded=False)
    assert dict(spectrum.declared) == {"format": "Film Sense text", "date": "2024-07-19 16:35"}


def test_dynamic(write, refused):
    refused(TIMES, "has 3 spectra: '4.953 s', '14.858 s', '24.766 s'; choose one", '`spectrum="4.953 s"`')
    second = read_spectrum(write(TIMES), spectrum="14.858 s")
    np.testing.assert_allclose(second.values, [30.0, 45.0], atol=1e-3)
    np.testing.assert_allclose(second.delta, [30.0, 180.0], atol=1e-3)
    assert second.name == "14.858 s"
    assert "measured at 14.858 s" in second.notes
    np.testing.assert_array_equal(second.lines, [6 + 1, 6 + 1])
    third = read_spectra(write(TIMES), spectrum="all")[2]
    np.testing.assert_allclose(third.delta, [330.0, 0.0], atol=1e-3)


def test_film_sense_refused(refused):
    lines = FILM_SENSE.splitlines(keepends=True)
    refused("".join(lines[:5]), "has 1 lines of N, C, S for 2 LEDs", "cut short")
    refused("".join(lines[:4]), "has 0 lines of N, C, S")
    refused(lines[0], "line 2")
    refused(FILM_SENSE.replace("Sense_Data", "Sense_Map_Data"), "the kind Film_Sense_Map_Data", "not read")
    refused(FILM_SENSE.replace("2\t1\t", "x\t1\t"), "line 2", "numbers of LEDs")
    refused(FILM_SENSE.replace("2\t1\t", "2\t4\t"), "has 4 measurements by its line 2")
    refused(FILM_SENSE.replace("0.99845\t16.5071", ""), "line 5 is not N, C, S")
    refused(FILM_SENSE.replace("0.50000\t", "1.50000\t"), "line 5", "degree of polarisation")
    refused(FILM_SENSE.replace("450.25", "blue"), "line 5", "'blue'")
    refused(TIMES.replace("Blue_N", "Blue_X"), "should name Time and N, C, S and P of each of its 2 LEDs")
    refused(TIMES.partition("Thick")[0], "no measurement")
    refused(TIMES.replace("\t0.0019\t3.25\n24", "\n24"), "line 7 has 13 values where the heading names 15")
