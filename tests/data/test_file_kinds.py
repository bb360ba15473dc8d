"""Files that are no measurement are named, with what to do; files that are one are not."""

import io
import zipfile

import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.tabular.text import foreign_format
from pellicle.errors import DataError


def packed(*names: str) -> bytes:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        for name in names:
            archive.writestr(name, "1,2\n")
    return whole.getvalue()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\x89PNG\r\n\x1a\n\x00\x00", "an image"),
        (b"\xff\xd8\xff\xe0\x00\x10JFIF", "an image"),
        (b"%PDF-1.7\n", "a PDF"),
        (packed("[Content_Types].xml", "word/document.xml"), "an office file; save its sheet as CSV"),
        (packed("[Content_Types].xml", "xl/workbook.xml"), "an Excel workbook that cannot be read"),
        (packed("spectrum.csv"), "packed; unpack it"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an office file"),
        (b"{\\rtf1\\ansi 1,2}", "a word processor's file"),
        (b"<!DOCTYPE html>\n<html>", "a web page"),
        (b'<?xml version="1.0"?>', "a web page or XML"),
        (b'{"wavelength": [400, 500]}', "JSON"),
        (b'[{"R": 0.1}]', "JSON"),
        (b"# a film\n[data]\nsignal = 'R'\n\n[scene]\nsubstrate = 'Si'\n", "a recipe; give it as `recipe`"),
    ],
)
def test_what_is_none_is_named(content, said, refusal, write):
    path = write(content, "film.dat")
    refusal(read_spectrum, path, DataError, f"is {said}", signal="R")


@pytest.mark.parametrize(
    "content",
    [
        b"wavelength_nm,R\n400,0.1\n",
        b"\xef\xbb\xbf400;0,1\n",
        b"[Data]\nnm %R\n400 12\n",
        b"# <html>\n400 0.1\n",
        b"BM 1\n400 0.1\n",
        b"\xff\xfe4\x000\x000\x00",
    ],
)
def test_what_may_be_one_passes(content):
    assert foreign_format(content) is None


def test_a_zero_byte_in_a_number_is_no_digit_and_none_between_fields_matters(refusal, write):
    text = "wavelength,R\n400,0.1\n500,0.{}3\n600,0.2\n"
    refusal(read_spectrum, write(text.format("\0")), DataError, "line 3: a zero byte within a number")
    filled = write("wavelength,R\n400,0.1\0\0\n500,\0" + "0.2\n600,0.3\n", "filled.csv")
    assert read_spectrum(filled).values.tolist() == [0.1, 0.2, 0.3]


@pytest.mark.parametrize("cell", ["x" * 100_000, "1" * 100_000, "x " * 50_000])
def test_a_long_cell_is_not_printed(cell, write):
    with pytest.raises(DataError) as error:
        read_spectrum(write(f"wavelength,R\n400,0.1\n500,{cell}\n600,0.2\n"))
    assert "line 3" in str(error.value)
    assert "characters)" in str(error.value)
    assert len(str(error.value)) < 400
