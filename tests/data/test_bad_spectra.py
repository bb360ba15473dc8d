"""Files that are refused: one sentence with file, line and remedy, and the right kind of error."""

from functools import partial

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError

GOOD = "400,0.1\n500,0.2\n600,0.3\n"
EITHER = '`signal="R"` or `signal="T"`'


@pytest.fixture
def refused(refusal):
    return partial(refusal, read_spectrum)


def test_missing_file(tmp_path, refused):
    refused(tmp_path / "gone.csv", DataError, "no such file", "check the name")


def test_folder(tmp_path, refused):
    refused(tmp_path, DataError, "is a folder", "name the file")


def test_binary(tmp_path, refused):
    for content in (b"spc\x00\x01\n\x00\x00", b"\xff\xfe\x00"):
        path = tmp_path / "spectrum.spc"
        path.write_bytes(content)
        refused(path, DataError, "binary", "export")


@pytest.mark.parametrize("text", ["", "\n\n  \n"])
def test_empty(write, text, refused):
    refused(write(text), DataError, "is empty", "expected rows")


def test_comments_only(write, refused):
    refused(write("# nothing\n# here\n"), DataError, "only comments", "expected rows")


@pytest.mark.parametrize(
    "text", ["wavelength,R\n", "some words\nand more\n", "400\n500\n600\n", ">>>>>Begin\t1\t2\n"]
)
def test_no_row_of_two_numbers(write, text, refused):
    refused(write(text), DataError, "line", "without any row of two numbers", "expected rows")


@pytest.mark.parametrize(
    ("row", "line", "column", "what"),
    [
        ("500,abc", 3, "'R'", "found 'abc'"),
        ("abc,0.2", 3, "'wavelength'", "found 'abc'"),
        ("500,", 3, "'R'", "is empty"),
        (",0.2", 3, "'wavelength'", "is empty"),
        ("500", 3, "'R'", "is empty"),
        ("500,nan", 3, "'R'", "not a finite number"),
        ("500,NaN", 3, "'R'", "not a finite number"),
        ("500,inf", 3, "'R'", "not a finite number"),
        ("-inf,0.2", 3, "'wavelength'", "not a finite number"),
        ("500,1e999", 3, "'R'", "not a finite number"),
        ("500,NA", 3, "'R'", "found 'NA'"),
        ("500,True", 3, "'R'", "found 'True'"),
        ("500,0_2", 3, "'R'", "found '0_2'"),
        ("500,0.2 0.3", 3, "'R'", "found '0.2 0.3'"),
    ],
)
def test_a_cell_that_is_no_number(write, row, line, column, what, refused):
    path = write(f"wavelength,R\n400,0.1\n{row}\n600,0.3\n700,0.4\n")
    refused(path, DataError, f"line {line}", f"column {column}", what, "delete that row")


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("", "is empty, and 2 more rows have no number; fill them in or delete those rows"),
        ("nan", "nan is not a finite number, and 2 more rows have no number; delete those rows"),
        ("#DIV/0!", "found '#DIV/0!', and 2 more rows have no number; correct or delete those rows"),
        ("#N/A", "found '#N/A'"),
        ("#WERT!", "found '#WERT!'"),
    ],
)
def test_all_cells_without_a_number_are_counted(write, cell, message, refused):
    """A spreadsheet's error begins as a comment does."""
    rows = [f"{nm},{cell if nm in (410, 440, 450) else 0.2}" for nm in range(400, 500, 10)]
    refused(write("\n".join(["wavelength,R", *rows])), DataError, "line 3, column 'R'", message)


@pytest.mark.parametrize(
    ("nm", "remedy"),
    [
        ([400, 401, 401, 402, 403, 404, 404, 405, 406, 407, 407, 408, 409, 410, 410], "4 repeated ones"),
        ([440, 400, 430, 410, 420, 405, 450, 402, 455], "sort the rows, which turn back 4 times"),
        ([*range(400, 410), *range(404, 399, -1)], "delete or correct one of the rows"),  # a broken sweep
    ],
)
def test_remedies_for_a_whole_axis(write, nm, remedy, refused):
    text = "wavelength,R\n" + "".join(f"{x},{0.2 + 0.001 * i}\n" for i, x in enumerate(nm))
    refused(write(text), DataError, "within one angle", remedy)


def test_decimal_commas_between_commas(write, refused):
    text = "wavelength,R\n400,5,0,11\n500,5,0,21\n600,5,0,31\n"
    refused(write(text), DataError, "4 values", "names 2 columns", "semicolons", "decimal commas")


def test_a_comment_after_an_empty_cell(write, refused):
    refused(write("wavelength,R\n400,0.1\n500, # dust\n600,0.3\n"), DataError, "line 3", "is empty; fill")


@pytest.mark.parametrize("row", ["400,abc", "abc,0.1", "400,nan"])
def test_a_bad_first_row_is_no_preamble(write, row, refused):
    refused(write(f"wavelength,R\n{row}\n500,0.2\n600,0.3\n"), DataError, "line 2, column")


def test_a_bad_first_row_without_a_header_is_no_preamble(write, refused):
    refused(write("400,abc\n500,0.2\n600,0.3\n"), DataError, "line 1, column 2", "'abc'", signal="R")


def test_text_after_the_rows_began(write, refused):
    refused(write("wavelength,R\n" + GOOD + "end of file\n"), DataError, "line 5", "'end of file'")


def test_parse_errors_apply_outside_the_range_too(write, refused):
    path = write("wavelength,R\n300,abc\n" + GOOD + "700,0.1\n800,0.1\n")
    refused(path, DataError, "line 2", "'abc'", range=(400, 800))


def test_too_many_values_in_a_row(write, refused):
    refused(
        write("wavelength,R\n400,0.1\n500,0,2\n600,0.3\n"), DataError, "line 3 has 3 values", "decimal comma"
    )
    refused(write("wavelength,R\n400,0.1,nan?\n500,0.2\n600,0.3\n"), DataError, "line 2 has 3 values")
    refused(write("wavelength,R\n400,0,1\n500,0,2\n"), DataError, "line 2 has 3 values", "header on line 1")


def test_mixed_decimal_marks(write, refused):
    path = write("wavelength;R\n1,050;0.49\n1,051;0.50\n")
    refused(path, DataError, "'1,050'", "'0.49'", "decimal mark", "export it again")


@pytest.mark.parametrize(
    ("values", "line", "what"),
    [
        ([400, 401, 401, 402], 4, "401 repeats 401 of line 3"),
        ([400, 500, 450, 600], 4, "450 turns back after 500 of line 3"),
        ([600, 500, 550, 400], 4, "550 turns back after 500 of line 3"),
        ([500, 400, 600, 700], 3, "400 turns back after 500 of line 2"),
        ([400, 400], 3, "400 repeats 400 of line 2"),
    ],
)
def test_wavelengths_that_are_not_monotone(write, values, line, what, refused):
    path = write("wavelength,R\n" + "".join(f"{v},0.5\n" for v in values))
    refused(path, DataError, f"line {line}, column 'wavelength'", what, "delete or correct")


def test_wavelengths_that_are_not_monotone_within_one_angle(write, refused):
    path = write("wavelength,angle,R\n400,30,0.1\n500,30,0.1\n400,60,0.1\n400,60,0.2\n")
    refused(path, DataError, "line 5", "400 repeats 400 of line 4", "within one angle")


@pytest.mark.parametrize("value", ["0", "-500"])
def test_wavelength_not_above_zero(write, value, refused):
    refused(write(f"wavelength,R\n{value},0.1\n" + GOOD), DataError, "line 2", "not above zero", "delete")


@pytest.mark.parametrize("rows", ["0.4,0.1\n0.5,0.2\n0.6,0.3\n", "1.5,0.1\n2.5,0.2\n3.5,0.3\n"])
@pytest.mark.parametrize("header", ["", "wavelength,R\n"])
def test_an_axis_that_looks_like_another_unit(write, header, rows, refused):
    signal = None if header else "R"
    refused(write(header + rows), DataError, "is unlike nm", "`wavelength_unit=", signal=signal)


def test_percent_without_a_sign(write, refused):
    path = write("wavelength,R\n400,12\n500,49.5\n600,30\n")
    refused(path, DataError, "line 3, column 'R'", "49.5 is above 1.5", '`signal_unit="percent"`')
    refused(path, DataError, "line 3", "above 1.5", "`range`", signal_unit="fraction")


def test_above_one_and_a_half_in_percent_too(write, refused):
    path = write("wavelength,T (%)\n400,12\n500,151\n600,30\n")
    refused(path, DataError, "line 3", "1.51 is above 1.5 for a transmittance", "`range`")


@pytest.mark.parametrize(
    ("header", "row"),
    [("R", "-0.06"), ("R (%)", "-6"), ("R,sigma", "-0.02,0.001"), ("R,sigma", "-0.11,0.02")],
)
def test_negative_beyond_noise(write, header, row, refused):
    good = "0.1,0.001" if "sigma" in header else "0.1"
    path = write(f"wavelength,{header}\n400,{good}\n500,{row}\n600,{good}\n")
    refused(path, DataError, "line 3, column 'R", "below zero by more than noise", "`range`")


def test_negative_beyond_the_noise_of_the_flag(write, refused):
    path = write("wavelength,R\n400,0.1\n500,-0.04\n600,0.2\n")
    refused(path, DataError, "line 3", "more than noise", noise=0.002)


def test_an_intensity_that_is_nowhere_positive(write, refused):
    refused(write("wl,intensity\n400,-1\n500,0\n"), DataError, "nowhere positive", "check", signal="R")


def test_sigma_not_above_zero(write, refused):
    refused(write("wl,R,sigma\n400,0.1,0.01\n500,0.1,0\n"), DataError, "line 3", "sigma", "not above zero")


@pytest.mark.parametrize("angle", ["-1", "90", "120"])
def test_impossible_angle(write, angle, refused):
    path = write(f"wl,angle,R\n400,30,0.1\n500,{angle},0.1\n")
    refused(path, DataError, "line 3, column 'angle'", "90 degrees", "delete")


def test_angle_in_radians(write, refused):
    refused(write("wl,angle (rad),R\n400,0.3,0.1\n500,0.3,0.1\n"), DataError, "'rad'", "in degrees")


def test_no_header_and_no_signal(write, refused):
    refused(write(GOOD), UsageError, "no header", '`signal="R"`')


def test_no_header_and_five_columns(write, refused):
    refused(write("1,2,3,4,5\n2,3,4,5,6\n"), UsageError, "5 columns", "`columns=[", signal="R")


def test_both_r_and_t(write, refused):
    refused(
        write("wl,R,T\n400,0.1,0.2\n500,0.1,0.2\n"),
        UsageError,
        "both R and T",
        EITHER,
    )


def test_intensity_without_a_signal(write, refused):
    refused(write("wl,intensity\n400,1\n500,2\n"), UsageError, "uncalibrated", EITHER)


def test_signal_that_is_not_there(write, refused):
    refused(write("wl,T\n400,0.1\n500,0.2\n"), UsageError, "has T", 'contradicts `signal="R"`', signal="R")


def test_two_polarisations(write, refused):
    path = write("wl,Rs,Rp\n400,0.1,0.2\n500,0.1,0.2\n")
    refused(path, UsageError, "'Rs', 'Rp'", '`polarisation="s"`')
    refused(path, UsageError, "'Rs', 'Rp'", '`polarisation="s"`', polarisation="unpolarised")
    refused(
        write("wl,Rs\n400,0.1\n500,0.2\n"),
        UsageError,
        "measured in s",
        'contradicts `polarisation="p"`',
        polarisation="p",
    )


def test_no_signal_column(write, refused):
    path = write("wavelength,brightness,gloss\n400,0.1,0.2\n500,0.2,0.3\n")
    refused(path, UsageError, "'brightness', 'gloss' state no quantity", '`signal="R"`', "`columns=[")
    refused(write("wavelength,psi_err\n400,1\n500,2\n"), DataError, "no column is a signal", "`columns=[")


def test_names_that_differ_by_case_are_different_quantities(write):
    spectrum = read_spectrum(write("wavelength,x,y,Y,R\n400,0.1,0.2,0.3,0.4\n500,0.1,0.2,0.3,0.5\n"))
    assert spectrum.values.tolist() == [0.4, 0.5]


def test_no_wavelength_column(write, refused):
    refused(write("x,R\n400,0.1\n500,0.2\n"), DataError, "'x', 'R'", "`columns=[")


def test_psi_and_delta_are_not_read_as_something_else(write, refused):
    path = write("wl,psi,delta\n400,20,170\n500,21,171\n")
    refused(path, UsageError, "psi and delta", 'contradicts `signal="R"`', signal="R")


@pytest.mark.parametrize("header", ["wavelength,R,R", "wavelength,R,r", "wavelength,wavelength,R"])
def test_a_name_twice(write, header, refused):
    refused(write(f"{header}\n400,0.1,0.2\n500,0.1,0.2\n"), DataError, "twice", "`columns`")


@pytest.mark.parametrize("header", ["wavelength,lambda,R", "wavelength,energy,R"])
def test_two_columns_that_could_be_the_same(write, header, refused):
    refused(write(f"{header}\n400,0.1,0.2\n500,0.1,0.2\n"), DataError, "could each be", "`columns`")


def test_numbers_that_overflow(write, refused):
    refused(write("wavenumber,T\n1e-305,0.1\n1e-304,0.2\n"), DataError, "line 2", "far from any wavelength")
    path = write("nm,A\n400,-400\n500,0.1\n")
    refused(path, DataError, "line 2", "column 'A'")


def test_samples_of_a_brdf(write, refused):
    path = write("theta_i,phi_i,theta_o,phi_o,R\n30,0,30,180,0.4\n30,0,40,180,0.2\n")
    refused(path, UsageError, "samples of a BRDF", "`recipe`")


def test_two_signals_of_one_kind(write, refused):
    path = write("wl,R,Reflectance\n400,0.1,0.2\n500,0.1,0.2\n")
    refused(path, UsageError, "has 2 spectra", "'R', 'Reflectance'", "`spectrum=", '`spectrum="all"`')


def test_unknown_units(write, refused):
    refused(write("wavelength (pm),R\n" + GOOD), DataError, "'pm'", "`wavelength_unit`")
    refused(write("wavelength,R (dB)\n" + GOOD), DataError, "'db'", "`signal_unit=")
    path = write("wavelength,R\n" + GOOD)
    for flag in ("wavelength_unit", "signal_unit"):
        with pytest.raises(UsageError, match=f"`{flag}` must be one of .*, not 'furlong'"):
            read_spectrum(path, **{flag: "furlong"})


def test_a_flag_that_contradicts_the_file(write, refused):
    path = write("wavelength_um,R (%)\n0.4,10\n0.5,20\n")
    refused(
        path,
        UsageError,
        "in um",
        'contradicts `wavelength_unit="nm"`',
        "leave that out",
        wavelength_unit="nm",
    )
    refused(
        path,
        UsageError,
        "in percent",
        'contradicts `signal_unit="fraction"`',
        "leave that out",
        signal_unit="fraction",
    )


def test_columns_flag_that_fits_nothing(write, refused):
    path = write("a,b\n" + GOOD)
    refused(path, UsageError, "3 names", "has 2", columns="wavelength,R,T")
    refused(path, UsageError, "'gloss'", "use wavelength", columns="wavelength,gloss")
    refused(path, DataError, "no column is a signal", columns="wavelength")


@pytest.mark.parametrize("noise", [0, -0.1, np.nan, np.inf])
def test_noise_that_is_none(write, noise):
    with pytest.raises(UsageError, match=r"`noise` must be .* above zero, as in `noise=0\.005`"):
        read_spectrum(write("wl,R\n" + GOOD), noise=noise)


def test_flags_with_unknown_words(write):
    path = write("wl,R\n" + GOOD)
    words = "R, T, psi-delta, mueller, generalised-psi-delta, contrast"
    with pytest.raises(UsageError, match=f"`signal` must be one of {words}, not 'X'"):
        read_spectrum(path, signal="X")
    with pytest.raises(UsageError, match="`polarisation` must be one of s, p, unpolarised, not 'q'"):
        read_spectrum(path, polarisation="q")


def test_a_range_that_leaves_too_little(write, refused):
    path = write("wl,R\n" + GOOD + "700,0.1\n800,0.1\n")
    refused(path, DataError, "only 4 of 5", "400 to 800 nm", "`range=(450, 900)`", "widen", range=(450, 900))
    for lo, hi in ((800, 400), (500, 500), (-1, 500), (np.nan, 500)):
        with pytest.raises(UsageError, match=r"`range=.* lower wavelength in nm first"):
            read_spectrum(path, range=(lo, hi))
