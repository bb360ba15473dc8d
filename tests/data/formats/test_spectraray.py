"""ASCII files of Sentech's SpectraRay."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum

SPECTRARAY = """\
; WAVELENGTH 50.20000 50.20000 70.10000 70.10000
400.5 40.1 170.5 30.1 120.5\x20
401.5 40.2 180.5 30.2 121.5\x20
402.5 40.3 190.5 30.3 122.5\x20
"""


def assert_read(spectrum, **expected):
    assert spectrum.signal == "psi-delta"
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(spectrum, name), values, rtol=1e-12, err_msg=name)


def test_spectraray(write):
    spectrum = read_spectrum(write(SPECTRARAY))
    assert_read(
        spectrum,
        wavelength=[400.5, 400.5, 401.5, 401.5, 402.5, 402.5],
        angle=[50.2, 70.1] * 3,
        values=[40.1, 30.1, 40.2, 30.2, 40.3, 30.3],
        delta=[170.5, 120.5, 180.5, 121.5, 190.5, 122.5],
        lines=[2, 2, 3, 3, 4, 4],
    )
    assert spectrum.sigma is None
    assert spectrum.notes[1] == "measured at 50.20000, 70.10000 degrees"


def test_spectraray_of_one_angle_with_decimal_commas(write):
    text = "; WAVELENGTH 70.06 70.06\n319.8 1.75 20.5\n320.2 2.25 352.0\n"
    spectrum = read_spectrum(write(text.replace(".", ",")))
    assert_read(
        spectrum, wavelength=[319.8, 320.2], angle=[70.06] * 2, values=[1.75, 2.25], delta=[20.5, 352]
    )


def test_spectraray_in_energies(write):
    spectrum = read_spectrum(write("; ENERGY 70 70\n2.0 20 170\n2.5 21 171\n"))
    np.testing.assert_allclose(spectrum.wavelength, 1239.8419843320026 / np.array([2.5, 2.0]))


def test_spectraray_files_that_are_refused(refused):
    refused(SPECTRARAY.replace("70.10000 70.10000", "70.1 70.2"), "line 1", "each angle", "twice")
    refused(SPECTRARAY.replace(" 70.10000 70.10000", " 70.10000"), "line 1", "each angle", "twice")
    apart = SPECTRARAY.replace("50.20000 70.10000", "70.10000 50.20000", 1)
    refused(apart, "line 1", "50.20000 70.10000 50.20000 70.10000")
    refused(SPECTRARAY.replace("70.10000", "50.20000"), "line 1", "each angle", "twice")
    refused(SPECTRARAY.replace(" 121.5", ""), "line 3 has 4 values", "make 5")
    refused("; WAVELENGTH 70 70\n", "no rows")
    refused(SPECTRARAY.replace("30.2", "nan"), "line 3, column 'psi_deg': nan")


def test_a_heading_without_its_mark(write):
    text = SPECTRARAY.removeprefix("; ").replace("WAVELENGTH", "Wavelength")
    np.testing.assert_array_equal(read_spectrum(write(text)).angle, [50.2, 70.1] * 3)


def test_a_mueller_matrix(write, refused):
    """Sixteen columns for each angle, row by row of the matrix."""
    matrix = " ".join(
        f"{x / 100:.2f}" for x in (100, *range(12, 15), *range(21, 25), *range(31, 35), *range(41, 45))
    )
    heading = f"; WAVELENGTH{' 70.20000' * 16}{' 60.2' * 16}\n"
    rows = "".join(f"{nm} {matrix} {matrix.replace('0.12', f'0.{nm}')}\n" for nm in (190, 191, 192))
    spectrum = read_spectrum(write(heading + rows))
    assert spectrum.signal == "mueller"
    assert spectrum.elements[0] == "m12"
    assert len(spectrum.elements) == 15
    np.testing.assert_array_equal(spectrum.angle, [60.2, 70.2] * 3)
    np.testing.assert_allclose(spectrum.values[:, 0], [0.190, 0.12, 0.191, 0.12, 0.192, 0.12])
    np.testing.assert_allclose(spectrum.values[0, 1:], [0.13, 0.14, *np.r_[21:25, 31:35, 41:45] / 100])
    refused(f"{heading}190.5{' 0.5' * 31}\n", "line 2 has 32 values", "make 33")
    refused(heading.replace(" 60.2", "", 1), "line 1", "16 times, for a Mueller matrix")


@pytest.mark.parametrize("text", [SPECTRARAY, SPECTRARAY.replace(".", ",")])
def test_encodings(same_in_every_encoding, text):
    same_in_every_encoding(text)
