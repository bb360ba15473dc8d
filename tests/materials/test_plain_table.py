"""n,k tables of one's own, good and bad."""

import numpy as np
import pytest

from pellicle.errors import DataError
from pellicle.materials import material
from pellicle.optics.pair import imag, is_real, real


@pytest.fixture
def write(tmp_path):
    def written(text, name="film.csv"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return written


SAME = [
    "wavelength_nm,n,k\n400,1.5,0.1\n600,1.4,0.05\n",
    "wl,n,k\n400,1.5,0.1\n600,1.4,0.05\n",
    "Wavelength (nm); N ;K\n400;1,5;0,1\n600;1,4;0,05\n",
    "# mine\nk\tlambda_um\tn\n0.1\t0.4\t1.5\n0.05\t0.6\t1.4\n",
    "um n k\n0.4 1.5 0.1  # first\n\n0.6   1.4   0.05\n",
    "wavelength [µm],n,k,who\n0.4,1.5,0.1,1\n0.6,1.4,0.05,2\n",
    "400 1.5 0.1\n600 1.4 0.05\n",
    "wavelength,n,k\n600,1.4,0.05\n400,1.5,0.1\n",
    "energy_eV,n,k\n3.0996049616,1.5,0.1\n2.0664033077,1.4,0.05\n",
    b"\xef\xbb\xbfwavelength_nm,n,k\r\n400,1.5,0.1\r\n600,1.4,0.05\r\n",
]


@pytest.mark.parametrize("text", SAME)
def test_the_same_table_in_many_spellings(write, text):
    source = material(write(text))
    assert source.name == "film"
    assert source.wavelength_range == pytest.approx((400, 600), rel=1e-9)
    assert source.has_extinction
    value = source.index(np.array([450.0, 500.0]))
    np.testing.assert_allclose(real(value), [1.475, 1.45], rtol=1e-6)
    np.testing.assert_allclose(imag(value), [0.0875, 0.075], rtol=1e-6)


def test_without_k_it_is_real_and_warns(write):
    source = material(write("wavelength_nm,n\n400,1.5\n600,1.4\n"))
    assert is_real(source.index(500.0))
    assert "no data for k" in source.warnings()[0]


def test_k_of_zero_is_real_and_needs_no_warning(write):
    source = material(write("wavelength_nm,n,k\n400,1.5,0\n600,1.4,0\n"))
    assert is_real(source.index(500.0))
    assert source.warnings() == []


def test_any_existing_file_is_a_table(write):
    assert material(write("400 1.5\n600 1.4\n", "film.data")).name == "film"


def test_a_file_does_not_hide_a_catalogue_name(write, tmp_path, monkeypatch):
    write("400 1.5\n600 1.4\n", "Au")
    monkeypatch.chdir(tmp_path)
    assert material("Au").page == "main/Au/Johnson"


def test_the_range_check_names_the_file(write):
    path = write("400 1.5\n600 1.4\n")
    with pytest.raises(ValueError, match="film") as caught:
        material(path).check_range([300, 500])
    assert path in str(caught.value)
    assert "`range=(400, 500)`" in str(caught.value)


BAD = [
    ("", "empty", None),
    ("# only this\n", "comments", None),
    ("wavelength_nm,n,k\n", "numbers", None),
    ("wavelength_nm,n,k\n400,1.5,0.1\n500,abc,0.1\n600,1.4,0.1\n", "'abc'", "line 3"),
    ("wavelength_nm,n,k\n400,1.5,0.1\n500,nan,0.1\n600,1.4,0.1\n", "finite", "line 3"),
    ("wavelength_nm,n,k\n400,1.5,0.1\n500,1.4\n600,1.4,0.1\n", "empty", "line 3"),
    ("wavelength_nm,n,k\n400,1.5,0.1\n500,1.4,0.1,7\n600,1.4,0.1\n", "4 values", "line 3"),
    ("wavelength_nm,n,k\n400,1.5,0.1\n500,1.4,-0.1\n", "turn its sign", "line 3"),
    ("wavelength_nm,n,k\n400,1.5,0.1\n500,0,0.1\n", "above 0", "line 3"),
    ("wavelength_nm,n,k\n400,1.5,0.1\n500,1.4,0.1\n500,1.3,0.1\n", "sort the rows", "line 4"),
    ("wavelength_nm,n,k\n-400,1.5,0.1\n500,1.4,0.1\n", "above 0", "line 2"),
    ("wavelength_nm,n,k\n400,1.5,0.1\n", "two rows", None),
    ("wavelength_nm,eps,k\n400,1.5,0.1\n500,1.5,0.1\n", "column named n", None),
    ("x,n,k\n400,1.5,0.1\n500,1.5,0.1\n", "column named wavelength", None),
    ("wavelength_nm,n,n\n400,1.5,0.1\n500,1.5,0.1\n", "two columns are named n", None),
    ("wavelength (furlong),n\n400,1.5\n500,1.5\n", "unknown unit 'furlong'", None),
    ("wavelength,n\n0.4,1.5\n0.5,1.5\n", "wavelength_um", None),
    ("400,1.5,0.1,3\n500,1.5,0.1,3\n", "2 or 3 columns", None),
    ("my film of 1999\n\n400 1.5\n500 1.5\n", "header", None),
    (b"\x00\x01\x02\x03", "binary", None),
]


@pytest.mark.parametrize(("text", "words", "line"), BAD)
def test_bad_files_get_one_sentence(write, text, words, line):
    path = write(text)
    with pytest.raises(DataError, match="film") as caught:
        material(path)
    message = str(caught.value)
    assert words in message
    assert line is None or line in message
    assert "\n" not in message


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        material(str(tmp_path / "none.csv"))
    with pytest.raises(DataError, match="folder"):
        material(str(tmp_path))
