"""Workbooks, angle scans, matrices of a series, Konica Minolta, binary files of CompleteEASE."""

import io

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum

NM = np.arange(400, 700, 10)
SERIES = "Wavelength (nm),{heads}\n" + "".join(f"{nm},0.2,0.21,0.22\n" for nm in NM)
ANGLES = "# Wavelength: 632.8 nm\nangle,psi,delta\n"
ANGLES += "".join(f"{angle},20,{200 - angle}\n" for angle in range(50, 80, 5))
MINOLTA = "Wavelength [nm],SCI [%],SCE [%]\n" + "".join(f"{nm},20,15\n" for nm in NM)


def workbook(*sheets):
    """The content of a workbook of sheets of rows."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets:
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()


def film(level):
    return [["Film 3"], [], ["Wavelength (nm)", "R (%)"], *([int(nm), level] for nm in NM)]


WORKBOOK = workbook(("Film", film(20)), ("Thick", film(30)))  # for `make fuzz`


def test_a_workbook(tmp_path):
    """Empty sheets and a sheet of text are passed over."""
    path = tmp_path / "film.xlsx"
    path.write_bytes(workbook(("About", [["measured by", "me"]]), ("Film", film(20.5)), ("Sheet3", [])))
    spectrum = read_spectrum(path)
    np.testing.assert_allclose(spectrum.values, 0.205)
    assert any("sheet 'Film'" in note for note in spectrum.notes)
    assert spectrum.lines[0] == 4


def test_sheets_are_chosen_by_name(tmp_path, refused):
    path = tmp_path / "film.xlsx"
    path.write_bytes(workbook(("one", film(20)), ("two", film(30))))
    refused(path, "has 2 spectra", "'one', 'two'")
    assert read_spectrum(path, spectrum="two").values[0] == pytest.approx(0.3)


def test_workbooks_that_cannot_be_read(tmp_path, refused):
    path = tmp_path / "film.xlsx"
    whole = workbook(("Film", film(20)))
    path.write_bytes(whole.replace(b"xl/worksheets/sheet1.xml", b"xl/worksheets/sheet9.xml"))
    refused(path, "save its sheet as CSV")
    path.write_bytes(workbook(("Film", film("=1/0"))))
    refused(path, "line 33 ends the file without any row of two numbers")


@pytest.mark.parametrize("heads", ["0.0 s,2.0 s,4.0 s", "0.0,2.0,4.0", '"N, #1","N, #2","N, #3"'])
def test_a_matrix_is_never_its_first_spectrum(write, refused, heads):
    path = write(SERIES.format(heads=heads))
    refused(path, "has 3 spectra", signal="R")
    every = read_spectra(path, signal="R", spectrum="all")
    assert [one.values[0] for one in every] == [0.2, 0.21, 0.22]
    assert every[1].name in heads


def test_psi_and_delta_against_the_angle(write, refused):
    spectrum = read_spectrum(write(ANGLES, "film.phi"))
    np.testing.assert_allclose(spectrum.wavelength, 632.8)
    np.testing.assert_allclose(spectrum.angle, np.arange(50, 80, 5))
    np.testing.assert_allclose(spectrum.delta, 200 - spectrum.angle)
    assert read_spectrum(write(ANGLES.replace("632.8 nm", "6328 A"))).wavelength[0] == pytest.approx(632.8)
    refused(ANGLES.partition("\n")[2], "no wavelength", "`# wavelength: 632.8 nm`")


def test_konica_minolta(write, refused):
    """With (SCI) and without (SCE) the specular component, both a reflectance in percent."""
    path = write(MINOLTA)
    refused(path, "'SCI [%]', 'SCE [%]'")
    np.testing.assert_allclose(read_spectrum(path, spectrum="SCE [%]").values, 0.15)


def test_binary_files_of_complete_ease(tmp_path, refused):
    path = tmp_path / "film.SEsnap"
    path.write_bytes(b"\x00\x05\x01 _FitLog MSE = 3")
    refused(path, "binary file of CompleteEASE", ".dat")
