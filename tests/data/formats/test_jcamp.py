"""JCAMP-DX: the ASCII forms of its tables, units, blocks, decimal commas, and contradictions."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum
from tests.data.tables import assert_read

# the ordinates of every form below, and their even axis
VALUES = [100, 101, 104, 104, 104, 104, 99, 45, 5, -3, 12, 500]
AXIS = np.arange(400.0, 512.0, 10.0)


def jcamp(table, form="(X++(Y..Y))", kind="XYDATA", ending="##END=\n", **records):
    """A file of one block; records override those below, None leaves one out."""
    stated = {"TITLE": "oxide on silicon", "JCAMP-DX": "4.24", "DATA TYPE": "UV/VIS SPECTRUM"}
    stated |= {"ORIGIN": "laboratory 3", "LONGDATE": "2024/05/06 10:00:00", "XUNITS": "NANOMETERS"}
    stated |= {"YUNITS": "REFLECTANCE", "XFACTOR": "1", "YFACTOR": "0.001", "FIRSTX": "400", "LASTX": "510"}
    stated |= {"NPOINTS": "12"} | {key.replace("_", " "): value for key, value in records.items()}
    lines = [f"##{key}= {value}" for key, value in stated.items() if value is not None]
    return "\n".join([*lines, f"##{kind}= {form}", table]) + f"\n{ending}"


AFFN = "400 100 101 104 104 104\n450 104 99 45 5 -3\n500 12 500"
FORMS = {
    "AFFN": AFFN,
    "exponents": "400 1.00E2 101 104 104 104.0\n450 104 99 0.45E+02 5 -3\n500 12 5e+2",
    "PAC": "400+100+101+104+104+104\n450+104+99+45+5-3\n500+12+500",
    "SQZ": "400A00A01A04A04A04\n450A04I9D5Ec\n500A2E00",
    "SQZ and DUP": "400A00A01A04V\n460I9D5Ec\n500A2E00",
    "DIF": "400A00JL%%%\n450A04nn4m0q\n490cJ5M88",
    "DIF and DUP": "400A00JL%U\n450A04nn4m0q\n490cJ5M88",
    "comments and blanks": "$$ first line\n400 100 101 104 104 104 $$ five\n\n450 104 99 45 5 -3\n500 12 500",
}
SAMPLES = {form: jcamp(table) for form, table in FORMS.items()}  # for `make fuzz`


@pytest.mark.parametrize("form", FORMS)
def test_the_forms_of_a_table_are_decoded(form, write):
    found = read_spectrum(write(jcamp(FORMS[form])), calibrated=False)
    assert_read(found, signal="R", wavelength=AXIS, values=np.array(VALUES) / 1000)


def test_the_example_of_the_standard(write):
    """McDonald and Wilks, table VII: one sequence of ordinates in four forms."""
    forms = ("1 1 2 3 3 2 1 0 -1 -2 -3", "1+1+2+3+3+2+1+0-1-2-3", "1ABCCBA@abc", "1AJJ%jjjjjj", "1AJJ%jX")
    for form in forms:
        text = jcamp(form, FIRSTX="300", LASTX="309", NPOINTS="10", XFACTOR="300", YFACTOR="0.01")
        values = read_spectrum(write(text), calibrated=False).values
        np.testing.assert_allclose(values, np.array([1, 2, 3, 3, 2, 1, 0, -1, -2, -3]) / 100)


def test_facts_are_kept(write):
    declared = dict(read_spectrum(write(jcamp(AFFN)), calibrated=False).declared)
    assert declared["format"] == "JCAMP-DX"
    assert declared["instrument"] == "laboratory 3"
    assert declared["date"] == "2024/05/06 10:00:00"
    assert declared["sample"] == "oxide on silicon"


UNITS = [
    ("NANOMETERS", "REFLECTANCE", "R", AXIS, 0.001),
    ("MICROMETERS", "TRANSMITTANCE", "T", AXIS * 1e3, 0.001),
    ("1/CM", "% REFLECTANCE", "R", 1e7 / AXIS[::-1], 1e-5),
    ("nm", "PERCENT TRANSMITTANCE", "T", AXIS, 1e-5),
    ("Wavelength (nm)", "Transmission (%)", "T", AXIS, 1e-5),
]


@pytest.mark.parametrize(("axis", "quantity", "signal", "wavelength", "factor"), UNITS)
def test_units(axis, quantity, signal, wavelength, factor, write):
    found = read_spectrum(write(jcamp(AFFN, XUNITS=axis, YUNITS=quantity)), calibrated=False)
    assert_read(found, signal=signal, wavelength=wavelength)
    values = np.array(VALUES[::-1] if axis == "1/CM" else VALUES) * factor
    np.testing.assert_allclose(found.values, values)


def test_absorbance_becomes_transmittance(write):
    found = read_spectrum(write(jcamp(AFFN, YUNITS="ABSORBANCE")))
    assert_read(found, signal="T", values=10.0 ** -(np.array(VALUES) / 1000))


@pytest.mark.parametrize("quantity", ["COUNTS", "KUBELKA-MUNK", "INTENSITY (COUNTS)", "RAMAN INTENSITY"])
def test_other_quantities_are_named(quantity, refused):
    refused(jcamp(AFFN, YUNITS=quantity), quantity, "neither a reflectance nor a transmittance")


@pytest.mark.parametrize("axis", ["HZ", "PPM", "SECONDS", "M/Z"])
def test_other_axes_are_named(axis, refused):
    refused(jcamp(AFFN, XUNITS=axis), repr(axis), "no wavelength, energy or wavenumber")


def test_units_that_are_missing_are_asked_for(refused, write):
    refused(jcamp(AFFN, XUNITS=None), "unknown unit 'not stated'", "`wavelength_unit`")
    refused(jcamp(AFFN, YUNITS=None), 'signal="R"')
    found = read_spectrum(write(jcamp(AFFN, XUNITS=None)), wavelength_unit="um", calibrated=False)
    np.testing.assert_allclose(found.wavelength, AXIS * 1e3)


def test_a_percentage_without_percent_asks_for_the_unit(refused, write):
    text = jcamp(AFFN, YUNITS="TRANSMITTANCE", YFACTOR="0.1").replace("-3", "3")
    refused(text, "line ", 'signal_unit="percent"')
    assert read_spectrum(write(text), signal_unit="percent").values.max() == pytest.approx(0.5)


PAIRS = "##TITLE= {}\n##JCAMP-DX= 5\n##XUNITS= NANOMETERS\n##YUNITS= {}\n{}##XYPOINTS= (XY..XY)\n{}\n##END=\n"
LIMITS = "##FIRSTX= 400,36\n##LASTX= 401,02\n##NPOINTS= 3\n"


def link(*blocks):
    return "##TITLE= EXPORTED SPECTRUM\n##DATA TYPE= LINK\n##BLOCKS= 3\n" + "".join(blocks) + "##END=\n"


ROWS = "400,36, 32,795\n400,69, 33,5\n401,02, 34,25"
PROCESSED = PAIRS.format("PROCESSED", "Transmission (%)", LIMITS, ROWS)
DARK = PAIRS.format("DARK", "INTENSITY (COUNTS)", LIMITS, "400,36, 1032,7\n400,69, 1033,5\n401,02, 1034,2")


def test_decimal_commas_and_a_dark_spectrum(write):
    """The structure of exports of SpectraSuite: a LINK block of processed, dark and reference spectra."""
    found = read_spectrum(write(link(PROCESSED, DARK, DARK.replace("DARK", "REFERENCE"))))
    assert_read(found, wavelength=[400.36, 400.69, 401.02], values=[0.32795, 0.335, 0.3425])
    assert any("INTENSITY (COUNTS)" in note for note in found.notes)


def test_decimal_points_between_commas(write):
    text = link(PROCESSED).replace(", ", ";").replace(",", ".").replace(";", ", ")
    np.testing.assert_allclose(read_spectrum(write(text)).values, [0.32795, 0.335, 0.3425])


def test_several_spectra_are_chosen_by_title(write, refused):
    text = link(PROCESSED, PROCESSED.replace("PROCESSED", "SECOND").replace("32,795", "12,5"))
    refused(text, "'PROCESSED'", "'SECOND'", "spectrum=")
    assert read_spectrum(write(text), spectrum="SECOND").values[0] == pytest.approx(0.125)
    assert [one.name for one in read_spectra(write(text), spectrum="all")] == ["PROCESSED", "SECOND"]


def test_pages_of_ntuples(write):
    head = jcamp("", ending="").partition("##XUNITS")[0]
    text = (
        head + "##NTUPLES= SPECTRA\n##VAR_NAME= WAVELENGTH, REFLECTANCE, TIME\n##SYMBOL= X, R, N\n"
        "##VAR_TYPE= INDEPENDENT, DEPENDENT, PAGE\n##VAR_DIM= 4, 4, 2\n"
        "##UNITS= NANOMETERS, REFLECTANCE, SECONDS\n"
        "##FIRST= 400, 0.1, 1\n##LAST= 430, 0.4, 2\n##FACTOR= 1, 0.1, 1\n"
        "##PAGE= N=1\n##DATA TABLE= (X++(R..R)), XYDATA\n400 1 2 3 4\n"
        "##PAGE= N=2\n##DATA TABLE= (X++(R..R)), XYDATA\n400 4 3 2 1\n##END NTUPLES=\n##END=\n"
    )
    first, second = read_spectra(write(text), spectrum="all")
    assert_read(first, wavelength=[400, 410, 420, 430], values=[0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(second.values, [0.4, 0.3, 0.2, 0.1])


def test_points_of_unknown_value_are_left_out(write):
    found = read_spectrum(write(jcamp(AFFN.replace(" 45 ", " ? "))), calibrated=False)
    assert found.wavelength.size == 11
    assert 470.0 not in found.wavelength


CONTRADICTIONS = {
    "cut short": (AFFN.rpartition("\n")[0], {}, "10 points where NPOINTS states 12"),
    "line missing": (AFFN.replace("450 104 99 45 5 -3\n", ""), {"NPOINTS": "7"}, "begins at 500"),
    "too many": (AFFN + " 7", {}, "beyond the 12 points"),
    "another axis": (AFFN, {"FIRSTX": "4000"}, "begins at 400, where"),
    "another step": (AFFN, {"DELTAX": "1"}, "DELTAX is 1"),
    "check of DIF": ("400A00JL%%%\n450A05n\n460I9D5Ec\n500A2E00", {}, "line 15 begins with 105, not"),
    "text": (AFFN.replace("104", "1*4", 1), {}, "line 14: '400 100 101 1*4"),
    "no points": ("", {}, "only comments"),
    "no axis": (AFFN, {"FIRSTX": None, "LASTX": None}, "needs FIRSTX and LASTX"),
    "no number": (AFFN, {"NPOINTS": "twelve"}, "NPOINTS is 'twelve'"),
    "huge": (AFFN, {"NPOINTS": "1000000000"}, "no number of points"),
    "zero factor": (AFFN, {"YFACTOR": "0"}, "YFACTOR is 0"),
    "huge DUP": ("400A00S999999999", {}, "no JCAMP-DX ordinate here"),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_contradictions_are_refused(name, refused):
    table, records, words = CONTRADICTIONS[name]
    refused(jcamp(table, **records), words)


def test_pairs_with_a_mark_of_another_kind_are_refused(refused):
    """Decimal commas without a decimal comma in the limits above: 4 numbers in a line instead of 2."""
    mixed = PROCESSED.replace("400,36\n", "400.36\n", 1).replace("401,02\n##N", "401.02\n##N")
    refused(link(mixed), "NPOINTS states 3")
    refused(link(PROCESSED.replace("##LASTX= 401,02", "##LASTX= 499,02")), "LASTX is 499.02")


def test_forms_that_are_not_read_are_named(refused):
    refused(jcamp(AFFN, form="(XYA)"), "'(XYA)'", "(XY..XY)")
    refused(jcamp(AFFN, kind="PEAK TABLE", form="(XY..XY)"), "without a table of a spectrum")
