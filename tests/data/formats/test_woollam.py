"""Woollam's text files: static, dynamic, with depolarisation, reflectance and transmittance."""

import re

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum
from tests.data.tables import assert_read, sample

NAMES = ("wvase", "complete_ease", "in_situ", "dynamic", "joint", "reflectance", "trigonometric")
WVASE, COMPLETE_EASE, IN_SITU, DYNAMIC, JOINT, REFLECTANCE, TRIGONOMETRIC = (
    sample(f"woollam/{name}.txt") for name in NAMES
)
HEADING = "".join(WVASE.splitlines(keepends=True)[:4])


def test_static(write):
    spectrum = read_spectrum(write(WVASE))
    points = {"wavelength": [400, 400, 410], "angle": [65, 75, 65], "lines": [5, 7, 6]}
    assert_read(spectrum, **points, values=[20.5, 12.5, 21.5], delta=[170.25, 120.25, 349.5])
    assert_read(spectrum, sigma=[0.05, 0.07, 0.06], delta_sigma=[0.4, 0.6, 0.5])
    assert spectrum.notes[0] == "read as a Woollam (WVASE, CompleteEASE) text file"
    facts = {"date": "Mon Jul 10 14:15:02 2023", "sample": "oxide on silicon, 3 zones"}
    assert_read(spectrum, declared={"format": "Woollam text", "software": "WVASE=3.688"} | facts)


def test_rows_without_errors(write):
    spectrum = read_spectrum(write(re.sub(r"(?m)^(4.*)\t[\d.]+\t[\d.]+$", r"\1", WVASE)))
    assert_read(spectrum, sigma=None, delta_sigma=None, values=[20.5, 12.5, 21.5])


@pytest.mark.parametrize(
    ("unit", "first", "second"),
    [("Angstroms", "4000", "4100"), ("1/cm", "25000", "24390.243902439026"), ("um", "0.4", "0.41")],
)
def test_units_of_the_axis(write, unit, first, second):
    text = WVASE.replace("400.000000", first).replace("410.000000", second).replace("\nnm", f"\n{unit}")
    np.testing.assert_allclose(read_spectrum(write(text)).wavelength, [400, 400, 410])


def test_a_file_for_wvase_whose_angle_has_no_name(write):
    rows = "658.0\t55.0\t27.7\t170.2\n658.0\t60.0\t23.25\t166.5\n"
    spectrum = read_spectrum(write(f"brush\nnm\t\tPsi\tDelta\n{rows}"))
    assert_read(spectrum, angle=[55, 60], delta=[170.2, 166.5])


def test_an_axis_in_energies_and_depolarisation_in_percent(write):
    spectrum = read_spectrum(write(COMPLETE_EASE))
    assert_read(spectrum, wavelength=1239.8419843320026 / np.r_[3, 2], delta=[170.25, 265.5], lines=[5, 6])
    assert_read(spectrum, depolarisation=[0.015, -0.0025], depolarisation_sigma=[0.001, 0.002])


def test_depolarisation_of_some_points_only_is_left_out(write):
    lines = COMPLETE_EASE.splitlines(keepends=True)
    some = read_spectrum(write("".join(lines[:-1])))
    assert some.depolarisation is None
    assert "dpolE ignored: 1 of 2 points have none" in some.notes
    more = read_spectrum(write(COMPLETE_EASE + "dpolE\t1.0\t65.0\t0.2\t0.2\n"))
    np.testing.assert_allclose(more.depolarisation, [0.015, -0.0025])
    assert "1 rows of dpolE without psi and delta ignored" in more.notes
    angle = read_spectrum(write(COMPLETE_EASE.replace("dpolE\t3.0\t65.0", "dpolE\t3.0\t75.0")))
    assert angle.depolarisation is None
    wide = read_spectrum(write(re.sub(r"(?m)^(dpolE.*)$", r"\1\t0\t0", COMPLETE_EASE)))
    assert any(note.startswith("dpolE ignored: its rows") for note in wide.notes)


def test_in_situ_rows_whose_angle_is_zero_beside_the_depolarisation(write):
    """CompleteEASE writes the intensity as `uR` with an error of 1: it is no reflectance."""
    [spectrum] = read_spectra(write(IN_SITU))
    assert_read(spectrum, depolarisation_sigma=None, angle=[70, 70], depolarisation=[-0.0525, -0.045])
    assert "errors of dPolE that are all 1 ignored" in spectrum.notes
    assert "rows of other quantities ignored: intensities, with errors of 1 (uR)" in spectrum.notes


def test_dynamic_data_are_a_spectrum_for_each_time(write, refused):
    refused(DYNAMIC, "has 2 spectra: '0.0232 min', '0.1071 min'; choose one", '`spectrum="0.0232 min"`')
    spectrum = read_spectrum(write(DYNAMIC), spectrum="0.1071 min")
    assert_read(spectrum, values=[30.25, 29.25], sigma=[0.07, 0.08], lines=[7, 8])
    assert [one.name for one in read_spectra(write(DYNAMIC), spectrum="all")] == ["0.0232 min", "0.1071 min"]
    refused(DYNAMIC.replace("\t\t0.1071", "", 1), "line 7 of dynamic data", "6 values")


def test_dynamic_reflectances_are_named_by_time_and_quantity(write):
    rows = "".join(f"{p}R\t{w}\t20\t0.25\t0.01\t\t0.0232\n" for p in "ps" for w in (400.5, 402.5))
    text = "".join(DYNAMIC.splitlines(keepends=True)[:6]) + rows
    found = read_spectra(write(text), spectrum="all")
    assert [one.name for one in found] == ["0.0232 min", "0.0232 min Rp", "0.0232 min Rs"]
    assert [one.signal for one in found] == ["psi-delta", "R", "R"]
    assert len(read_spectra(write(text))) == 3  # of one time: one measurement


def test_reflectances_beside_psi_and_delta(write):
    spectra = read_spectra(write(JOINT))
    expected = [("psi-delta", "psi-delta", "unpolarised"), ("Rp", "R", "p"), ("Rs", "R", "s")]
    expected.append(("T", "T", "unpolarised"))
    assert [(one.name, one.signal, one.polarisation) for one in spectra] == expected
    psi, p, s, t = spectra
    assert_read(p, angle=[25, 25], values=[0.45, 0.44])
    assert (psi.angle.tolist(), s.sigma.tolist(), t.angle.tolist()) == ([65, 65], [0.004, 0.005], [0])


@pytest.mark.parametrize(
    ("words", "signal", "polarisation", "first"),
    [
        ({"signal": "psi-delta"}, "psi-delta", "unpolarised", 20.5),
        ({"signal": "R", "polarisation": "s"}, "R", "s", 0.55),
        ({"signal": "T"}, "T", "unpolarised", 0.12),
        ({"spectrum": "Rp"}, "R", "p", 0.45),
    ],
)
def test_choice_of_one_of_several_quantities(write, words, signal, polarisation, first):
    [spectrum] = read_spectra(write(JOINT), **words)
    assert (spectrum.signal, spectrum.polarisation, spectrum.values[0]) == (signal, polarisation, first)


def test_a_quantity_that_the_file_does_not_have(refused):
    refused(WVASE, "which contradicts `signal", signal="T")
    refused(JOINT.replace("uT", "uRb"), "contradicts", signal="T")


def test_reflectances_alone(write):
    [spectrum] = read_spectra(write(REFLECTANCE))
    assert_read(spectrum, signal="R", polarisation="unpolarised", angle=[0, 0], sigma=[0.01, 0.02])
    assert_read(spectrum, wavelength=[418.2788, 421.5761], values=[0.443593, 0.439625])
    zero = read_spectrum(write(REFLECTANCE.replace("0.010000", "0").replace("0.020000", "0.0")))
    assert zero.sigma is None


def test_refused_reflectances(refused):
    refused(re.sub(r"0\.0[12]0000", "1.000000", REFLECTANCE), "intensities, with errors of 1 (uR)")
    refused(REFLECTANCE.replace("  0.020000", ""), "line 4 is not uR, wavelength, angle, a value")
    refused(REFLECTANCE.replace("0.443593", "44.3593"), "line 3", "44.3593", "`signal_unit")
    refused(REFLECTANCE.replace("0.443593", "x"), "line 3", "'x'")


def test_trigonometric_tables_leave_the_sign_of_delta_open(write, refused):
    spectrum = read_spectrum(write(TRIGONOMETRIC))
    assert_read(spectrum, signal="psi-delta", folded=True)
    assert_read(spectrum, values=[45.0, np.rad2deg(np.arctan(0.5))], delta=[60.0, 120.0], angle=[70, 70])
    refused(TRIGONOMETRIC.replace("-.5", "-1.2"), "line 3, column 'cos_delta': -1.2 is no cos(delta)")
    refused(TRIGONOMETRIC.replace(".5 ", "-.5 "), "line 3, column 'tan_psi': -0.5 is no tan(psi)")
    refused(TRIGONOMETRIC.replace("-.5", ""), "line 3 has 3 values")
    refused(WVASE.replace("nm\n", "nm  TRIG\n"), "line 5", "170.25 is no cos(delta)")


ELEMENTS = """mm11	400	65	1	0.001
mm11	410	65	1	0.001
mm12	400	65	-.2	0.002
mm12	410	65	-.25	0.003
mm33	400	65	.5	0.004
mm33	410	65	.55	0.005
"""


def test_rows_of_mueller_elements(write, refused):
    spectrum = read_spectrum(write(HEADING + ELEMENTS))
    assert_read(spectrum, elements=("m12", "m33"), wavelength=[400, 410], angle=[65, 65])
    assert_read(spectrum, values=[[-0.2, 0.5], [-0.25, 0.55]], sigma=[[0.002, 0.004], [0.003, 0.005]])
    fewer = read_spectrum(write(HEADING + ELEMENTS.replace("mm33	410	65	.55	0.005\n", "")))
    np.testing.assert_array_equal(fewer.values, [[-0.2, 0.5]])
    assert "1 points that its Mueller elements have in common" in fewer.notes
    without = re.sub(r"\t0.00\d", "\t0", ELEMENTS)
    assert read_spectrum(write(HEADING + without)).sigma is None
    wide = ELEMENTS.replace("\t.55\t", "\t.55\t0\t")
    refused(HEADING + wide, "line 10 is not mm33, wavelength, angle")
    refused(HEADING + ELEMENTS.replace("mm33	4", "mm33	5"), "no point in common")


def test_mueller_elements_beside_psi_and_delta(write):
    path = write(COMPLETE_EASE + ELEMENTS.replace("\t400\t", "\t3.1\t").replace("\t410\t", "\t3\t"))  # eV
    spectrum = read_spectrum(path)
    assert spectrum.signal == "psi-delta"
    assert any('`signal="mueller"` reads mm11, mm12, mm33' in note for note in spectrum.notes)
    assert read_spectrum(path, signal="mueller").elements == ("m12", "m33")
    assert read_spectrum(path, elements=["m33"]).elements == ("m33",)


GENERALISED = """AnE\t500\t65\t20\t100\t0.1\t0.2
AnE\t600\t65\t21\t110\t0.1\t0.3
Aps\t500\t65\t2\t-10\t0.05\t0.5
Aps\t600\t65\t3\t20\t0.06\t0.6
Asp\t600\t65\t1\t200\t0.07\t0.7
"""


def test_generalised_rows(write, refused):
    heading = "film\nVASEmethod[EllipsometerType=10]\nOriginal[film.dat]\nnm\n"
    some = read_spectrum(write(heading + GENERALISED.rpartition("Asp")[0]))
    assert_read(some, signal="generalised-psi-delta", ratios=("ane", "aps"), values=[[20, 2], [21, 3]])
    assert_read(some, delta=[[100, 350], [110, 20]], sigma=[[0.1, 0.05], [0.1, 0.06]])
    np.testing.assert_array_equal(some.delta_sigma, [[0.2, 0.5], [0.3, 0.6]])
    every = read_spectrum(write(heading + GENERALISED))
    assert_read(every, ratios=("ane", "aps", "asp"), wavelength=[600.0])
    assert "1 points that AnE, Aps, Asp have in common" in every.notes
    without = re.sub(r"(?m)^(Aps.*)\t[\d.]+\t[\d.]+$", r"\1", GENERALISED)
    assert read_spectrum(write(heading + without)).sigma is None
    refused(heading + GENERALISED.replace("Aps\t500\t65\t2", "Aps\t500\t65"), "Aps psi, delta and")
    apart = GENERALISED.splitlines(keepends=True)
    refused(heading + apart[0] + apart[4], "AnE, Asp have no point in common")


def test_generalised_rows_beside_psi_and_delta(write):
    path = write(COMPLETE_EASE + GENERALISED.replace("\t500\t", "\t2.4\t").replace("\t600\t", "\t2\t"))  # eV
    assert read_spectrum(path).signal == "psi-delta"
    said = '`signal="generalised-psi-delta"` reads AnE, Aps, Asp'
    assert any(said in note for note in read_spectrum(path).notes)
    assert read_spectrum(path, signal="generalised-psi-delta").ratios == ("ane", "aps", "asp")
    back = JOINT.replace("pR", "uRb").replace("sR", "uRb").replace("E\t", "Aps\t")
    turned = JOINT.replace("WVASE=3.688", "WVASE=3.688, TransmissionMeas=1").replace("E\t", "Aps\t")
    assert "generalised-psi-delta" in [one.signal for one in read_spectra(write(back))]
    assert {one.signal for one in read_spectra(write(turned), spectrum="all")} <= {"R", "T"}


def test_ellipsometry_in_transmission(write):
    text = JOINT.replace("WVASE=3.688", "WVASE=3.688, TransmissionMeas=1")
    first, *others = read_spectra(write(text), spectrum="all")
    assert_read(first, signal="psi-delta", transmission=True)
    assert [one.name for one in others] == ["Rp", "Rs", "T"]


def test_columns_behind_the_errors_and_points_without_a_value(write, refused):
    text = "VASEmethod[M2000]\nnm\nE 400 65 20 170 .1 .2 1.0 1.0\nE 410 65 21 169 .1 .2 1.0 1.0\n"
    spectrum = read_spectrum(write(text))
    np.testing.assert_array_equal(spectrum.delta_sigma, [0.2, 0.2])
    assert "2 columns behind the errors ignored" in spectrum.notes
    spectrum = read_spectrum(write(text.replace("21 169", "NaN nan")))
    assert "1 of 2 points, written NaN, left out" in spectrum.notes
    refused(text.replace("21 169", "NaN nan").replace("20 170", "NaN nan"), "no point with psi and delta")


def test_errors_that_are_all_zero_are_none(write):
    spectrum = read_spectrum(write(re.sub(r"\t[\d.]+\t[\d.]+$", "\t0\t0.0000", WVASE, flags=re.MULTILINE)))
    assert spectrum.sigma is None
    assert "errors that are all zero ignored" in spectrum.notes


def test_rows_with_a_label_need_no_method_above_them(write):
    assert len(read_spectrum(write("\n".join(["title", *COMPLETE_EASE.splitlines()[3:]])))) == 2


def test_a_lone_unit_alone_makes_no_woollam_file(write):
    assert read_spectrum(write("nm\n400 0.1 0.01\n500 0.2 0.01\n"), signal="R").signal == "R"


def test_refused(refused):
    refused(WVASE + "420\t65\t20\n", "looks like a Woollam file, but line 8 is not")
    refused(WVASE.replace("21.5", "91.5"), "line 6, column 'psi_deg': 91.5", "0 to 90")
    refused(WVASE.replace("21.5", "x"), "line 6, column 'psi_deg': expected a number", "'x'")
    refused(WVASE.replace("410.", "400."), "line 6", "400 repeats 400 of line 5")
    refused(WVASE.replace("\nnm\n", "\nfurlongs\n"))
    refused(HEADING)
    refused(WVASE[:-20], "line 7 is not")
