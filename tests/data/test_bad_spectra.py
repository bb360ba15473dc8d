"""Files that are refused: one sentence with file, line and remedy, and the right kind of error."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError

GOOD = "400,0.1\n500,0.2\n600,0.3\n"
EITHER = '`signal="R"` or `signal="T"`'


def test_missing_file(tmp_path, refused):
    refused(tmp_path / "gone.csv", "no such file", "check the name", error=DataError)


def test_folder(tmp_path, refused):
    refused(tmp_path, "is a folder", "name the file", error=DataError)


def test_binary(write, refused):
    for content in (b"spc\x00\x01\n\x00\x00", b"\xff\xfe\x00"):
        path = write(content, "spectrum.spc")
        refused(path, "binary", "export", error=DataError)


NONE = {}
R = {"signal": "R"}
DATA = [
    (NONE, "", "is empty", "expected rows"),
    (NONE, "# nothing\n# here\n", "only comments", "expected rows"),
    (NONE, "wavelength,R\n", "line", "without any row of two numbers", "expected rows"),
    (NONE, ">>>>>Begin\t1\t2\n", "without any row of two numbers"),
    (NONE, "some words\nand more\n", "without any row of two numbers"),
    (NONE, "wl,R\n400,5,0,11\n500,5,0,21\n", "4 values", "names 2 columns", "semicolons", "decimal commas"),
    (NONE, "wavelength,R\n400,0.1\n500, # dust\n600,0.3\n", "line 3", "is empty; fill"),
    *((NONE, f"wavelength,R\n{row}\n{GOOD}", "line 2, column") for row in ("400,abc", "abc,0.1", "400,nan")),
    (R, "400,abc\n500,0.2\n600,0.3\n", "line 1, column 2", "'abc'"),
    (NONE, f"wavelength,R\n{GOOD}end of file\n", "line 5", "'end of file'"),
    ({"range": (400, 800)}, f"wavelength,R\n300,abc\n{GOOD}700,0.1\n800,0.1\n", "line 2", "'abc'"),
    (NONE, "wavelength,R\n400,0.1\n500,0,2\n600,0.3\n", "line 3 has 3 values", "decimal comma"),
    (NONE, "wavelength,R\n400,0,1\n500,0,2\n", "line 2 has 3 values", "header on line 1"),
    (NONE, "wavelength;R\n1,050;0.49\n1,051;0.50\n", "'1,050'", "'0.49'", "decimal mark", "export it again"),
    (NONE, "nm,angle,R\n400,30,0.1\n400,60,0.1\n400,60,0.2\n", "line 4", "400 of line 3", "within one angle"),
    *((NONE, f"wl,R\n{value},0.1\n{GOOD}", "line 2", "not above zero", "delete") for value in (0, -500)),
    (NONE, "wavelength,R\n0.4,0.1\n0.5,0.2\n0.6,0.3\n", "is unlike nm", "`wavelength_unit="),
    ({"wavelength_unit": "eV"}, f"wavelength,R\n{GOOD}", "600 eV, which is no wavelength of light"),
    (NONE, "wl,R\n400,12\n500,49.5\n", "line 3, column", "49.5 is above 1.5", '`signal_unit="percent"`'),
    ({"signal_unit": "fraction"}, "wavelength,R\n400,1\n500,49.5\n", "line 3", "above 1.5", "`range`"),
    (NONE, "wl,T (%)\n400,12\n500,151\n", "line 3", "1.51 is above 1.5 for a transmittance", "`range`"),
    ({"noise": 0.002}, "wavelength,R\n400,0.1\n500,-0.04\n600,0.2\n", "line 3", "more than noise"),
    (R, "wl,intensity\n400,-1\n500,0\n", "nowhere positive", "check"),
    (NONE, "nm,R,sigma\n400,0.1,0.01\n500,0.1,0\n", "line 3", "sigma", "not above zero"),
    *((NONE, f"nm,angle,R\n400,{x},0\n", "line 2, column 'angle'", "90 degrees") for x in (-1, 90, 120)),
    (NONE, "wl,angle (rad),R\n400,0.3,0.1\n500,0.3,0.1\n", "'rad'", "in degrees"),
    (NONE, "wavelength,psi_err\n400,1\n500,2\n", "no column is a signal", "`columns=["),
    (NONE, "x,R\n400,0.1\n500,0.2\n", "'x', 'R'", "`columns=["),
    *((NONE, f"{names}\n4,0,1\n5,0,1\n", "twice", "`columns`") for names in ("nm,R,R", "nm,R,r", "nm,nm,R")),
    *((NONE, f"wl,{name},R\n400,0,1\n500,0,1\n", "each be", "`columns`") for name in ("lambda", "energy")),
    (NONE, "wavenumber,T\n1e-305,0.1\n1e-304,0.2\n", "line 2", "far from any wavelength"),
    (NONE, "nm,A\n400,-400\n500,0.1\n", "line 2", "column 'A'"),
    (NONE, f"wavelength (pm),R\n{GOOD}", "'pm'", "`wavelength_unit`"),
    (NONE, f"wavelength,R (dB)\n{GOOD}", "'db'", "`signal_unit="),
    ({"columns": "wavelength"}, f"a,b\n{GOOD}", "no column is a signal"),
]  # fmt: skip
UM = "wavelength_um,R (%)\n0.4,10\n0.5,20\n"
TWO = "wl,Rs,Rp\n400,0.1,0.2\n500,0.1,0.2\n"
USAGE = [
    (NONE, GOOD, "no header", '`signal="R"`'),
    (R, "1,2,3,4,5\n2,3,4,5,6\n", "5 columns", "`columns=["),
    (NONE, "wl,R,T\n400,0.1,0.2\n500,0.1,0.2\n", "both R and T", EITHER),
    (NONE, "wl,intensity\n400,1\n500,2\n", "uncalibrated", EITHER),
    (R, "wl,T\n400,0.1\n500,0.2\n", "has T", 'contradicts `signal="R"`'),
    (NONE, TWO, "'Rs', 'Rp'", '`polarisation="s"`'),
    ({"polarisation": "unpolarised"}, TWO, "'Rs', 'Rp'", '`polarisation="s"`'),
    ({"polarisation": "p"}, "wl,Rs\n400,0.1\n500,0.2\n", "measured in s", 'contradicts `polarisation="p"`'),
    (NONE, "nm,glow,gloss\n4,1,2\n5,2,3\n", "'glow', 'gloss' state no quantity", '`signal=', "`columns=["),
    (R, "wl,psi,delta\n400,20,170\n500,21,171\n", "psi and delta", 'contradicts `signal="R"`'),
    (NONE, "theta_i,phi_i,theta_o,phi_o,R\n30,0,30,180,0.4\n", "samples of a BRDF", "`recipe`"),
    (NONE, "nm,R,Reflectance\n4,0,0\n5,0,0\n", "2 spectra: 'R', 'Ref", '`spectrum="R"`', '`spectrum="all"`'),
    ({"wavelength_unit": "nm"}, UM, "in um", 'contradicts `wavelength_unit="nm"`', "leave that out"),
    ({"signal_unit": "fraction"}, UM, "in percent", 'contradicts `signal_unit="fraction"`', "leave that out"),
    ({"columns": "wavelength,R,T"}, f"a,b\n{GOOD}", "3 names", "has 2"),
    ({"columns": "wavelength,gloss"}, f"a,b\n{GOOD}", "'gloss'", "use wavelength"),
]  # fmt: skip


ROWS = [*((DataError, row) for row in DATA), *((UsageError, row) for row in USAGE)]


@pytest.mark.parametrize(("error", "row"), ROWS)
def test_refused(write, refused, error, row):
    options, text, *parts = row
    refused(text, *parts, error=error, **options)


@pytest.mark.parametrize(
    ("row", "column", "what"),
    [
        ("abc,0.2", "'wavelength'", "found 'abc'"),
        ("500,", "'R'", "is empty"),
        ("500", "'R'", "is empty"),
        ("-inf,0.2", "'wavelength'", "not a finite number"),
        ("500,1e999", "'R'", "not a finite number"),
        ("500,True", "'R'", "found 'True'"),
        ("500,0_2", "'R'", "found '0_2'"),
        ("500,0.2 0.3", "'R'", "found '0.2 0.3'"),
    ],
)
def test_a_cell_that_is_no_number(write, row, column, what, refused):
    path = write(f"wavelength,R\n400,0.1\n{row}\n600,0.3\n700,0.4\n")
    refused(path, "line 3", f"column {column}", what, "delete that row", error=DataError)


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
    refused("\n".join(["wavelength,R", *rows]), "line 3, column 'R'", message, error=DataError)


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
    refused(text, "within one angle", remedy, error=DataError)


@pytest.mark.parametrize(("header", "row"), [("R", "-0.06"), ("R (%)", "-6"), ("R,sigma", "-0.11,0.02")])
def test_negative_beyond_noise(write, header, row, refused):
    good = "0.1,0.001" if "sigma" in header else "0.1"
    path = write(f"wavelength,{header}\n400,{good}\n500,{row}\n600,{good}\n")
    refused(path, "line 3, column 'R", "below zero by more than noise", "`range`", error=DataError)


@pytest.mark.parametrize(
    ("flag", "value", "expected"),
    [
        ("wavelength_unit", "furlong", "one of .*, not 'furlong'"),
        ("signal_unit", "furlong", "one of .*, not 'furlong'"),
        ("signal", "X", "one of R, T, psi-delta, mueller, generalised-psi-delta, contrast, not 'X'"),
        ("polarisation", "q", "one of s, p, unpolarised, not 'q'"),
        *(("noise", noise, r".* above zero, as in `noise=0\.005`") for noise in (0, -0.1, np.nan, np.inf)),
    ],
)
def test_flags_with_wrong_values(write, flag, value, expected):
    with pytest.raises(UsageError, match=f"`{flag}` must be {expected}"):
        read_spectrum(write("wl,R\n" + GOOD), **{flag: value})


def test_a_range_that_leaves_too_little(write, refused, refuses):
    path = write("wl,R\n" + GOOD + "700,0.1\n800,0.1\n")
    refused(
        path, "only 4 of 5", "400 to 800 nm", "`range=(450, 900)`", "widen", range=(450, 900), error=DataError
    )
    for lo, hi in ((800, 400), (500, 500), (-1, 500), (np.nan, 500)):
        refuses(UsageError, r"`range=.* lower wavelength in nm first", read_spectrum, path, range=(lo, hi))
