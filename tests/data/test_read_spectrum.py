"""Files that are read: every way the contract lets a spectrum be written."""

import hashlib

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.spectrum import Spectrum
from tests.data.tables import assert_read

WAVELENGTH = [400.0, 450.5, 500.0, 600.0, 700.0, 800.0]
VALUES = [0.1, 0.25, 0.3, 0.35, 0.2, 0.15]


def rows(separator=",", scale=1.0):
    return "".join(f"{w}{separator}{v * scale}\n" for w, v in zip(WAVELENGTH, VALUES, strict=True))


def assert_film(spectrum):
    assert_read(spectrum, wavelength=WAVELENGTH, values=VALUES)


@pytest.mark.parametrize("quotes_in_header", [True, False])
def test_decimal_commas_in_quotes(write, quotes_in_header):
    """As spreadsheets of a German locale write a CSV with commas between the columns."""
    quoted = "\n".join(f'"{row}"'.replace(".", ",").replace(";", '","') for row in rows(";").split())
    header = '"wavelength","R"' if quotes_in_header else "wavelength,R"
    spectrum = read_spectrum(write(f"sample,A 12\n{header}\n{quoted}\n"))
    assert_film(spectrum)
    assert "decimal commas" in spectrum.notes
    assert not any("separated" in note for note in spectrum.notes)


def test_what_a_spectrum_carries(write):
    path = write("wavelength,R\n" + rows())
    spectrum = read_spectrum(path)
    assert_read(spectrum, path=str(path), sha256=hashlib.sha256(path.read_bytes()).hexdigest())
    assert (spectrum.signal, spectrum.polarisation, spectrum.calibrated) == ("R", "unpolarised", True)
    assert_read(spectrum, sigma=None, angle=None)
    assert len(spectrum) == 6
    assert spectrum.wavelength.dtype == spectrum.values.dtype == np.float64
    assert "6 points of R, 400 to 800 nm" in str(spectrum)
    assert "wavelength unit: nm, assumed" in spectrum.notes
    assert "signal unit: fraction, assumed" in spectrum.notes


def test_no_header_three_and_four_columns_as_refnx_writes_them(write):
    for tail in ("", "\t0.5"):
        text = "".join(f"{w}\t{v}\t0.01{tail}\n" for w, v in zip(WAVELENGTH, VALUES, strict=True))
        spectrum = read_spectrum(write(text), signal="R")
        assert_film(spectrum)
        np.testing.assert_array_equal(spectrum.sigma, 0.01)
        assert any("column 3 read as sigma" in note for note in spectrum.notes)
        assert any("column 4" in note and "ignored" in note for note in spectrum.notes) == bool(tail)


def test_names_in_a_comment_as_numpy_writes_them(write, tmp_path):
    path = tmp_path / "savetxt.txt"
    np.savetxt(path, np.c_[WAVELENGTH, np.array(VALUES) * 100], header="wavelength (nm) R (%)")
    spectrum = read_spectrum(path)
    np.testing.assert_allclose(spectrum.values, VALUES, rtol=1e-15)
    assert any("comment" in note for note in spectrum.notes)


def test_a_preamble_without_column_names(write):
    for separator in (",", " "):
        spectrum = read_spectrum(write("Exported spectrum\n\n" + rows(separator)), signal="R")
        assert_film(spectrum)
        assert "1 line of preamble skipped" in spectrum.notes


def test_sigma_is_in_the_unit_of_the_signal_unless_it_says_its_own(write):
    assert read_spectrum(write("wl,R (%),sigma\n500,40,1\n600,50,1\n")).sigma[0] == 0.01
    assert read_spectrum(write("wl,R,sigma (%)\n500,0.4,1\n600,0.5,1\n")).sigma[0] == 0.01


def test_columns_flag_overrides_the_header(write):
    path = write("a,b,c,d\n1,0.1,400,9\n2,0.2,500,9\n")
    spectrum = read_spectrum(path, columns="_,R,wavelength")
    assert_read(spectrum, wavelength=[400, 500], values=[0.1, 0.2])
    again = read_spectrum(path, columns=["_", "R", "wavelength"])
    np.testing.assert_array_equal(again.values, spectrum.values)


def test_a_text_column_that_nobody_reads_is_left_alone(write):
    text = 'wavelength,R,remark\n400,0.1,"fine, dry"\n500,0.2,wet\n600,0.3,\n'
    spectrum = read_spectrum(write(text))
    np.testing.assert_array_equal(spectrum.values, [0.1, 0.2, 0.3])
    assert "ignored: 'remark'" in spectrum.notes


def test_polarised_columns(write):
    path = write("wavelength,Rs,Rp\n500,0.1,0.2\n600,0.3,0.4\n")
    spectrum = read_spectrum(path, polarisation="p")
    assert (spectrum.values[0], spectrum.polarisation, spectrum.signal) == (0.2, "p", "R")
    assert read_spectrum(write("wavelength,Ts\n500,0.1\n600,0.3\n")).polarisation == "s"
    assert read_spectrum(write("wavelength,R\n500,0.1\n600,0.3\n"), polarisation="s").polarisation == "s"


def test_an_angle_per_row(write):
    blocks = "wavelength,aoi_deg,R\n600,60,0.4\n500,60,0.3\n600,30,0.2\n500,30,0.1\n"
    mixed = "wavelength,angle,R\n500,60,0.3\n500,30,0.1\n600,60,0.4\n600,30,0.2\n"
    for text in (blocks, mixed):
        points = {"wavelength": [500, 500, 600, 600], "angle": [30, 60, 30, 60]}
        assert_read(read_spectrum(write(text)), **points, values=[0.1, 0.3, 0.2, 0.4])


def test_uncalibrated_values_may_be_anything(write):
    path = write("wavelength,intensity\n400,-3\n500,20\n600,40\n")
    assert_read(read_spectrum(path, signal="R"), calibrated=False, values=[-3, 20, 40])
    assert not read_spectrum(write("wl,R\n400,3\n500,4\n"), calibrated=False).calibrated


def test_range_cuts_before_values_are_judged(write):
    noisy = "wavelength,R\n" + "380,-7\n" + rows() + "900,55\n"
    spectrum = read_spectrum(write(noisy), range=(400, 800))
    assert_film(spectrum)
    assert "6 of 8 points kept, 400 to 800 nm" in spectrum.notes


def test_noise_is_the_sigma_of_every_point(write):
    spectrum = read_spectrum(write("wavelength,R,sigma\n500,0.1,0.5\n600,0.2,0.5\n"), noise=0.005)
    np.testing.assert_array_equal(spectrum.sigma, 0.005)
    assert any("the given noise replaces the column" in note for note in spectrum.notes)


def test_small_negative_values_are_noise(write):
    assert read_spectrum(write("wl,T\n500,-0.04\n600,0.2\n")).values[0] == -0.04
    assert read_spectrum(write("wl,T,sigma\n500,-0.09,0.02\n600,0.2,0.02\n")).values[0] == -0.09
    assert read_spectrum(write("wl,T,sigma\n500,-0.009,1e-6\n600,0.2,1e-6\n")).values[0] == -0.009


def test_extreme_ultraviolet_is_read_when_the_file_says_nm(write):
    path = write("wavelength_nm,R\n13.4,0.6\n13.5,0.7\n")
    assert read_spectrum(path).wavelength[-1] == 13.5
    assert read_spectrum(write("wl,R\n13.4,0.6\n13.5,0.7\n"), wavelength_unit="nm").wavelength[0] == 13.4


def test_a_spectrum_made_by_hand_is_sorted_and_read_only():
    spectrum = Spectrum(np.array([2, 1]), np.array([0.2, 0.1]), "R")
    np.testing.assert_array_equal(spectrum.values, [0.1, 0.2])
    with pytest.raises(ValueError, match="read-only"):
        spectrum.values[0] = 1
    with pytest.raises(ValueError, match=r"`sigma`: expected one number per wavelength \(2\)"):
        Spectrum(np.array([1, 2]), np.array([0.1, 0.2]), "R", sigma=np.ones(3))
