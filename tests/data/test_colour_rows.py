"""Colours in CSV: every naming and scale comes back as write, what is unclear is asked for."""

import numpy as np
import pytest

from pellicle.data.colour_rows import is_colour_table, read_colour_rows
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read, rows

RGB = np.array([[0.2, 0.41, 0.83], [0.5, 0.35, 0.11]])


@pytest.mark.parametrize(
    ("text", "space", "note"),
    [
        ("R,G,B\n" + rows(*RGB.T), "srgb", "as they are"),
        ("Blue;Green;Red\n" + rows(*RGB.T[::-1], mark=";").replace(".", ","), "srgb", "decimal commas"),
        ("r g b\n" + rows(*RGB.T, mark=" "), "srgb", "as they are"),
        ("R_8bit\tG_8bit\tB_8bit\n" + rows(*255 * RGB.T, mark="\t"), "srgb", "8-bit"),
        ("R (%),G (%),B (%)\n" + rows(*100 * RGB.T), "srgb", "percent"),
        ("# signal rgb, unpolarised\nR,G,B\n" + rows(*RGB.T), "rgb", "channels of a camera"),
        ("X,Y,Z\n" + rows(*RGB.T), "xyz", "Y = 1 is white"),
        ("X,Y,Z\n" + rows(*100 * RGB.T), "xyz", "divided by 100"),
        ("x,y,Y\n" + rows(*(RGB[:, :2] / RGB.sum(1, keepdims=True)).T, RGB[:, 1]), "xyz", "Y = 1 is white"),
    ],
)
def test_every_naming_and_scale(write, text, space, note):
    [film] = read_colour_rows(write(text))
    assert film.space == space
    np.testing.assert_allclose(film.values, RGB, atol=1e-9)
    assert note in " ".join(film.notes)
    assert_read(film, sigma=None, angle=None)
    assert is_colour_table(film.path)


def test_whole_numbers_are_8_bit_with_their_sigma(write):
    [film] = read_colour_rows(write("sigma,R,G,B\n2,51,102,255\n1,0,3,7\n"))
    np.testing.assert_allclose(film.values, np.array([[51, 102, 255], [0, 3, 7]]) / 255)
    np.testing.assert_allclose(film.sigma, np.array([[2] * 3, [1] * 3]) / 255)
    assert "divided by 255 (8-bit)" in " ".join(film.notes)


def test_films_by_name_with_angles_and_sigmas(write):
    header = "angle_deg,film,L*,a*,b*,sigma_L*,sigma_a*,sigma_b*,remark\n"
    text = header + "0,one,50,1,-2,.1,.2,.3,7\n0,two,60,3,4,.1,.2,.3,7\n45,one,55,2,-9,.4,.5,.6,7\n"
    one, two = read_colour_rows(write(text))
    assert (one.name, two.name) == ("one", "two")
    assert_read(one, angle=[0, 45], values=[[50, 1, -2], [55, 2, -9]])
    assert one.sigma[1].tolist() == [0.4, 0.5, 0.6]
    assert one.lines.tolist() == [2, 4]
    assert two.space == "lab"
    assert "ignored: remark" in one.notes


@pytest.mark.parametrize(
    ("text", "options", "error", "parts"),
    [
        ("R,G,B\n30.5,40.1,60.2\n", {}, UsageError, ("unclear unit", "signal_unit")),
        ("R,G,B\n0.1,0.2,-\n", {}, DataError, ("line 2", "'B'", "expected a number")),
        ("R,G,B\n0.1,0.2,0.3,0.4\n", {}, DataError, ("line 2", "4 values")),
        ("R,G,B\n", {}, DataError, ("no row",)),
        ("R,G,B\n0,0,256000\n", {}, UsageError, ("unclear unit",)),
        ("R,G,B\n0,0,300\n", {"unit": "8-bit"}, DataError, ("line 2", "300", "8-bit")),
        ("R,G,B\n0,0,3\n", {"unit": "fraction"}, DataError, ("line 2", "beyond 1")),
        ("X,Y,Z\n400,500,600\n", {}, DataError, ("beyond the 100",)),
        ("L*,a*,b*\n0.5,0.1,0.1\n", {}, DataError, ("0 to 100",)),
        ("L*,a*,b*\n500,1,1\n", {}, DataError, ("line 2", "no L*")),
        ("x,y,Y\n0.6,0.6,0.2\n", {}, DataError, ("line 2", "no chromaticity")),
        ("x,y,Y,sigma\n0.3,0.3,0.2,0.1\n", {}, UsageError, ("convert them to X, Y, Z",)),
        ("x,y,z\n0.3,0.3,0.2\n", {}, UsageError, ("no three columns",)),
        ("R,G,B,X,Y,Z\n0,0,0,0,0,0\n", {}, UsageError, ("more than one colour",)),
        ("R,G,B,sigma_R\n0,0,0,1\n", {}, DataError, ("one of each channel",)),
        ("R (%),G,B\n0,0,0\n", {}, DataError, ("different units",)),
        ("0.1,0.2,0.3\n", {}, UsageError, ("no header",)),
        ("X,Y,Z\n0.1,0.2,0.3\n", {"space": "lab"}, UsageError, ("in xyz, not in lab",)),
        ("# signal srgb\nR,G,B\n0.1,0.2,0.3\n", {"space": "rgb"}, UsageError, ("in srgb, not in rgb",)),
        ("", {}, DataError, ("is empty",)),
    ],
)
def test_what_is_damaged_or_unclear_is_refused(write, refusal, text, options, error, parts):
    refusal(read_colour_rows, write(text), error, *parts, **options)


def test_a_unit_that_is_none(write):
    with pytest.raises(UsageError, match="signal_unit"):
        read_colour_rows(write("R,G,B\n0.1,0.2,0.3\n"), unit="od")


def test_named_columns_replace_the_header(write):
    [film] = read_colour_rows(write("7,0.1,0.2,0.3\n"), columns="_,R,G,B")
    assert film.values.tolist() == [[0.1, 0.2, 0.3]]


@pytest.mark.parametrize(
    "text", ["wavelength_nm,R\n500,0.2\n", "theta_i,phi_i,theta_o,phi_o,R,G,B\n0,0,0,0,1,1,1\n", "500,0.2\n"]
)
def test_other_tables_are_no_colours(write, text):
    assert not is_colour_table(write(text))
