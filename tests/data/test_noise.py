"""The noise of a spectrum: in the unit of its file, as a share of the signal, or as a fraction."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError

PERCENT = "wavelength_nm,R (%)\n400,10\n500,20\n600,0.5\n"


@pytest.mark.parametrize(
    ("noise", "sigma", "said"),
    [
        (0.004, [0.004] * 3, None),
        ("0.4", [0.004] * 3, "0.4 %, as the file is in percent, 0.004"),
        ("2 %", [0.002, 0.004, 0.0002], "2 % of the signal at each point"),
    ],
)
def test_of_a_file_in_percent(noise, sigma, said, write):
    read = read_spectrum(write(PERCENT), noise=noise)
    np.testing.assert_allclose(read.sigma, sigma)
    assert any(said in note for note in read.notes) if said else not any("noise" in x for x in read.notes)


def test_of_a_file_in_absorbance(write):
    read = read_spectrum(write("wavelength_nm,absorbance\n400,0.1\n500,1\n"), noise="0.01")
    np.testing.assert_allclose(read.sigma, 0.01 * np.log(10) * 10.0 ** -np.array([0.1, 1.0]))


def test_of_a_file_of_fractions_a_text_is_the_number(write):
    path = write("wavelength_nm,R\n400,0.1\n500,0.2\n")
    assert read_spectrum(path, noise="0.01").sigma.tolist() == [0.01, 0.01]


def test_psi_and_delta_have_no_share(write, refuses):
    path = write("wavelength,psi,delta,angle\n400,20,90,70\n500,21,90,70\n")
    refuses(UsageError, "share of the signal, which psi and delta cannot", read_spectrum, path, noise="2 %")


def test_fractions_under_a_header_of_percent_are_asked_for(write, refused):
    path = write("wavelength_nm,R (%)\n" + "".join(f"{400 + i},0.{i + 1}\n" for i in range(9)))
    said = "in percent by its name", "0.9, is like a fraction", '`signal_unit="fraction"`'
    refused(path, *said, error=UsageError)
    assert read_spectrum(path, signal_unit="fraction").values[0] == 0.1
    assert read_spectrum(path, signal_unit="percent").values[0] == pytest.approx(0.001)
