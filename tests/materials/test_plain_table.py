"""n,k tables of one's own, good and bad."""

import numpy as np
import pytest

from pellicle.materials import material
from pellicle.optics.pair import imag, real

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
    source = material(str(write(text)))
    assert source.name == "film"
    assert source.wavelength_range == pytest.approx((400, 600), rel=1e-9)
    assert source.has_extinction
    value = source.index(np.array([450.0, 500.0]))
    np.testing.assert_allclose(real(value), [1.475, 1.45], rtol=1e-6)
    np.testing.assert_allclose(imag(value), [0.0875, 0.075], rtol=1e-6)


def test_any_existing_file_is_a_table(write):
    assert material(str(write("400 1.5\n600 1.4\n", "film.data"))).name == "film"


def test_a_file_does_not_hide_a_catalogue_name(write, tmp_path, monkeypatch):
    write("400 1.5\n600 1.4\n", "Au")
    monkeypatch.chdir(tmp_path)
    assert material("Au").page == "main/Au/Johnson"


def test_the_range_check_names_the_file(write):
    path = str(write("400 1.5\n600 1.4\n"))
    with pytest.raises(ValueError, match="film") as caught:
        material(path).check_range([300, 500])
    assert path in str(caught.value)
    assert "`range=(400, 500)`" in str(caught.value)
