"""Ψ and Δ from plain columns: every way they are written, and one sentence where they cannot be."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read, rows

NM = np.array([400.0, 500.0, 600.0])
PSI = np.array([20.0, 25.5, 31.0])
DELTA = np.array([170.0, 179.5, 190.25])


def assert_film(spectrum):
    assert_read(spectrum, signal="psi-delta", calibrated=True, polarisation="unpolarised")
    assert_read(spectrum, rtol=1e-11, wavelength=NM)
    assert_read(spectrum, values=PSI, delta=DELTA)


@pytest.mark.parametrize("header", ["wl,psi_deg,delta_deg", "λ [nm],Psi (deg),Delta [°]", "nm,Ψ,Δ"])
def test_names(write, header):
    spectrum = read_spectrum(write(f"{header}\n{rows(NM, PSI, DELTA)}"))
    assert_film(spectrum)
    assert spectrum.angle is None  # then it is for the fit to ask
    assert_read(spectrum, sigma=None, delta_sigma=None)
    assert "psi and delta in degrees" in spectrum.notes


@pytest.mark.parametrize(
    "name", ["Einfallswinkel (°)", "Incidence angle", "angle d'incidence [deg]", "入射角"]
)
def test_angles_of_incidence_by_their_names(write, name):
    spectrum = read_spectrum(
        write(f"wl,{name},psi,delta\n400,65,20,90\n500,65,20,95\n400,70,21,80\n500,70,21,85\n")
    )
    np.testing.assert_array_equal(spectrum.angle, [65, 70, 65, 70])


def test_delta_is_stored_from_0_to_below_360(write):
    spectrum = read_spectrum(write("wl,psi,delta\n400,20,-180\n500,20,-0.5\n600,20,360\n"))
    np.testing.assert_array_equal(spectrum.delta, [180, 359.5, 0])


def test_errors_of_both(write):
    text = f"wl,psi,sigma_psi,delta,sigma_delta\n{rows(NM, PSI, [0.1, 0.2, 0.3], DELTA, [1, 2, 3])}"
    other = text.replace("sigma_psi", "psi_err").replace("sigma_delta", "delta_err_deg")
    for path in (write(text), write(other, "b")):
        spectrum = read_spectrum(path)
        assert_film(spectrum)
        assert_read(spectrum, sigma=[0.1, 0.2, 0.3], delta_sigma=[1, 2, 3])
    spectrum = read_spectrum(path, noise=0.05)
    assert_read(spectrum, sigma=[0.05] * 3, delta_sigma=[0.05] * 3)
    assert "the given noise replaces the columns of errors" in spectrum.notes


def test_one_sigma_for_both(write):
    spectrum = read_spectrum(write(f"wl,psi,delta,sigma\n{rows(NM, PSI, DELTA, [0.1, 0.2, 0.3])}"))
    np.testing.assert_array_equal(spectrum.sigma, spectrum.delta_sigma)
    np.testing.assert_array_equal(spectrum.sigma, [0.1, 0.2, 0.3])


def test_everything_is_sorted_and_cut_together(write):
    nm = np.linspace(800.0, 400.0, 21)
    text = f"wl,psi,delta,sigma_psi,sigma_delta\n{rows(nm, nm / 20, nm / 4, nm / 1000, nm / 500)}"
    spectrum = read_spectrum(write(text), range=(500, 700))
    assert len(spectrum) == 11
    for values, per in (
        (spectrum.values, 20),
        (spectrum.delta, 4),
        (spectrum.sigma, 1000),
        (spectrum.delta_sigma, 500),
    ):
        np.testing.assert_allclose(values, spectrum.wavelength / per, rtol=1e-12)


def test_one_wavelength_at_many_angles(write):
    spectrum = read_spectrum(write("wl,aoi,psi,delta\n658,70,10,160\n658,60,23,172\n658,50,31,176\n"))
    assert_read(spectrum, angle=[50, 60, 70], values=[31, 23, 10])
    assert str(spectrum).endswith("3 points of psi-delta, 658 nm")


def test_ncs_are_turned_into_psi_and_delta(write):
    psi, delta = np.deg2rad(2 * PSI), np.deg2rad(DELTA)
    n, c, s = 0.99 * np.array([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)])
    spectrum = read_spectrum(write(f"wavelength,N,C,S\n{rows(NM, n, c, s)}"))
    assert_read(spectrum, rtol=1e-9, values=PSI, delta=DELTA)
    assert any("1 - N² - C² - S² read as the depolarisation" in note for note in spectrum.notes)
    np.testing.assert_allclose(spectrum.depolarisation, 1 - 0.99**2, rtol=1e-9)


def test_psi_and_delta_go_before_ncs_beside_them(write):
    text = "wl,psi,delta,N,C,S\n400,20,170,0.1,0.2,0.3\n500,21,171,0.1,0.2,0.3\n"
    spectrum = read_spectrum(write(text))
    np.testing.assert_array_equal(spectrum.values, [20, 21])
    assert "ignored: 'N', 'C', 'S'" in spectrum.notes


def test_three_columns_without_a_header(write, refused):
    path = write(rows(NM, PSI, DELTA, mark=" "))
    assert_film(read_spectrum(path, signal="psi-delta"))
    refused(path, "no header", "`signal=", error=UsageError)


def test_four_columns_without_a_header_need_names(write, refused):
    path = write(rows(NM, [70, 70, 70], PSI, DELTA))
    refused(path, "4 columns and no header", "`columns=[", signal="psi-delta", error=UsageError)
    spectrum = read_spectrum(path, columns="wavelength,angle,psi,delta")
    assert_film(spectrum)
    np.testing.assert_array_equal(spectrum.angle, [70, 70, 70])


def test_the_signal_settles_what_to_read(write, refused):
    path = write("wl,R,psi,delta\n400,0.1,20,170\n500,0.2,21,171\n")
    refused(path, "psi and delta as well as R", "`signal`", read=read_spectrum, error=UsageError)
    assert read_spectrum(path, signal="R").signal == "R"
    np.testing.assert_array_equal(read_spectrum(path, signal="psi-delta").values, [20, 21])


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("500,90.5,171", ("line 3, column 'psi': 90.5", "0 to 90 degrees")),
        ("500,-0.1,171", ("line 3, column 'psi': -0.1", "0 to 90 degrees")),
        ("500,21,361", ("line 3, column 'delta': 361", "-180 to 360 degrees")),
        ("500,21,-181", ("line 3, column 'delta': -181", "-180 to 360 degrees")),
        ("500,nan,171", ("line 3, column 'psi': nan is not a finite number",)),
        ("500,21,", ("line 3, column 'delta' is empty",)),
        ("400,21,171", ("line 3", "400 repeats 400 of line 2", "within one angle")),
    ],
)
def test_impossible_rows(write, row, said, refused):
    refused(f"wl,psi,delta\n400,20,170\n{row}\n600,22,172\n", *said, error=DataError)


def test_errors_that_are_none(write, refused):
    text = "wl,psi,delta,sigma_psi,sigma_delta\n400,20,170,0.1,1\n500,21,171,0.1,0\n"
    refused(text, "line 3, column 'sigma_delta': 0", "above zero", error=DataError)
    refused(text.replace("sigma_delta", "x"), "only one of psi and delta", error=DataError)


@pytest.mark.parametrize("header", ["wl,psi,x", "wl,delta,x", "wl,N,C", "wl,R,x"])
def test_missing_columns(write, header, refused):
    path = write(f"{header}\n400,0.20,0.70\n500,0.21,0.71\n")
    refused(path, "not all among", "`columns=[", signal="psi-delta", error=DataError)


def test_radians_are_not_taken_for_degrees(write, refused):
    small = write("wl,psi,delta\n400,0.35,2.9\n500,0.36,3.0\n")
    refused(small, "look like radians", "psi_deg", error=DataError)
    stated = write("wl,psi (rad),delta (rad)\n400,0.35,2.9\n500,0.36,3.0\n")
    refused(stated, "'rad'", "convert both to degrees", error=DataError)


def test_a_pseudo_dielectric_function(write, refused):
    eps = "eV,<eps1>,<eps2>\n2.1,3.1,1.0\n2.0,3.0,0.9\n"
    refused(eps, "pseudo-dielectric function", "export psi and delta", error=DataError)
    stated = read_spectrum(write("wl,psi_deg,delta_deg\n400,0.35,2.9\n500,0.36,3.0\n"))
    np.testing.assert_array_equal(stated.values, [0.35, 0.36])


@pytest.mark.parametrize("row", ["0.1,0.1,0.1", "1,0.5,0.5"])
def test_impossible_ncs(write, row, refused):
    path = write(f"wl,N,C,S\n400,1,0,0\n500,{row}\n")
    refused(path, "line 3, column 'N'", "degree of polarisation", error=DataError)


def test_flags_without_a_meaning(write, refused, refuses):
    path = write(f"wl,psi,delta\n{rows(NM, PSI, DELTA)}")
    refused(path, "`signal_unit`", signal_unit="percent", error=UsageError)
    refused(path, "`polarisation`", polarisation="p", error=UsageError)
    refuses(UsageError, r"R, T, psi-delta", read_spectrum, path, signal="psi")


SHARE = np.array([0.01, 0.2, -0.004])


@pytest.mark.parametrize(
    ("names", "size"),
    [
        ("depolarisation,sigma_depolarisation", 1),
        ("depol,depol_err", 1),
        ("%depol,%depol_sigma", 100),
        ("Depolarization (%),sigma_depol (%)", 100),
    ],
)
def test_depolarisation(write, names, size):
    text = f"wl,psi,delta,{names}\n{rows(NM, PSI, DELTA, size * SHARE, size * SHARE**2)}"
    spectrum = read_spectrum(write(text))
    assert_film(spectrum)
    assert_read(spectrum, depolarisation=SHARE, depolarisation_sigma=SHARE**2)
    unit = "in percent" if size == 100 else "a fraction"
    name = names.split(",")[0]
    assert f"'{name}' read as the depolarisation, {unit}" in spectrum.notes
    assert not any("ignored" in note for note in spectrum.notes)


def test_n_c_s_of_polarised_light_have_no_depolarisation(write):
    """Rounded to three decimals."""
    psi, delta = 2 * np.deg2rad(PSI), np.deg2rad(DELTA)
    n, c, s = np.round([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)], 3)
    assert read_spectrum(write(f"wl,N,C,S\n{rows(NM, n, c, s)}")).depolarisation is None


@pytest.mark.parametrize(
    ("names", "cells", "said"),
    [
        ("depol", "2.5", "column 'depol': 2.5 is not from -0.5 to 1.05"),
        ("depol", "2.5", "if it is in percent, name the column `depolarisation (%)`"),
        ("depol (%)", "250", "column 'depol (%)': 2.5 is not"),
        ("depol (ppm)", "2", "'depol (ppm)' is in 'ppm'; write a depolarisation as a fraction"),
        ("depol,depol_err", "0.1,0", "column 'depol_err': 0 is a standard deviation not above zero"),
        ("depol,%depol", "0.1,10", "could each be the depolarisation"),
        ("depol", "x", "line 2"),
    ],
)
def test_what_is_no_depolarisation(write, refused, names, cells, said):
    refused(f"wl,psi,delta,{names}\n400,20,170,{cells}\n500,20,175,{cells}\n", said, error=DataError)


@pytest.mark.parametrize("header", ["nm,tan_psi,cos_delta", "λ,tan(psi),cos(delta)", "nm,TanPsi,CosDelta"])
def test_tan_psi_and_cos_delta(write, header, refuses):
    path = write(f"{header}\n500,1,0.5\n600,0.5773502691896258,-0.5\n700,0.5,1.04\n", "tan_cos.csv")
    spectrum = read_spectrum(path)
    assert_read(spectrum, folded=True, values=[45, 30, np.rad2deg(np.arctan(0.5))])
    np.testing.assert_allclose(spectrum.delta, [60, 120, 0], atol=1e-12)
    assert any("delta is 0 or 180 at 1 points" in note for note in spectrum.notes)
    path.write_text(f"{header}\n500,1,0.5\n600,0.5,-1.06\n")
    refuses(DataError, r"line 3, .*-1\.06 is no cos\(delta\)", read_spectrum, path)
