"""Cary, UVProbe and other tables with several scans side by side, and tables below each other."""

import numpy as np

from pellicle.data.read_spectrum import read_spectra, read_spectrum
from tests.data.tables import sample

CARY, ONE_SCAN, UVPROBE, UVPROBE_ONE = (
    sample(f"scans_side_by_side/{name}.txt") for name in ("cary", "one_scan", "uvprobe", "uvprobe_one")
)
STACKED = sample("stacked_tables/two.txt")


def by_name(path, **reading):
    return {one.name: one for one in read_spectra(path, **({"spectrum": "all"} | reading))}


def test_cary(write, refused):
    found = by_name(write(CARY))
    assert list(found) == ["film 1", "film 2"]
    np.testing.assert_allclose(found["film 1"].values, [0.92, 0.91, 0.90])
    np.testing.assert_array_equal(found["film 2"].wavelength, [799, 800])
    np.testing.assert_array_equal(found["film 2"].lines, [4, 3])
    assert any("'Baseline 100%T'" in note for note in found["film 1"].notes)
    facts = dict(found["film 2"].declared)
    assert (facts["instrument"], facts["date"]) == ("Cary 5000", "3/5/2024 10:14:52 AM")
    refused(CARY, "2 spectra: 'film 1', 'film 2'", '`spectrum="film 1"`')
    assert len(read_spectrum(write(CARY), spectrum="film 2")) == 2


def test_a_single_scan(write):
    spectrum = read_spectrum(write(ONE_SCAN))
    np.testing.assert_allclose(spectrum.values, [10**-0.5, 0.1])
    assert dict(spectrum.declared)["sample"] == "film 1"


def test_a_baseline_and_one_scan_need_no_choice(write):
    text = "Baseline 100%T;;film\nnm;%R;nm;%R\n800;50,5;800;90,5\n799;50,5;799;91,5\n"
    np.testing.assert_allclose(read_spectrum(write(text)).values, [0.915, 0.905])


def test_scans_of_r_and_t(write, refused):
    text = CARY.replace("Wavelength (nm),%T,\n", "Wavelength (nm),%R,\n")
    refused(text, "both R and T", '`signal="R"`')
    spectrum = read_spectrum(write(text), signal="R")
    np.testing.assert_allclose(spectrum.values, [0.81, 0.80])


def test_a_kubelka_munk_column_is_left_out(write):
    text = "film;;powder\nWavelength (nm);%R;Wavelength (nm);F(R)\n800;50,5;800;0,1\n799;51,5;799;0,2\n"
    spectrum = read_spectrum(write(text))
    np.testing.assert_allclose(spectrum.values, [0.515, 0.505])
    assert any("'powder'" in note for note in spectrum.notes)


def test_uvprobe(write):
    found = by_name(write(UVPROBE))
    assert list(found) == ["film, 3", "film 4"]
    np.testing.assert_allclose(found["film 4"].values, [0.2, 0.21])
    spectrum = read_spectrum(write(UVPROBE_ONE))
    np.testing.assert_allclose(spectrum.values, [0.1, 0.11])
    assert (spectrum.signal, dict(spectrum.declared)["sample"]) == ("T", "film 3")


def test_pairs_without_names(write):
    found = by_name(write("wl_nm,R,energy_eV,R\n400,0.1,2.0,0.3\n500,0.2,3.0,0.4\n"))
    assert list(found) == ["R", "R (2)"]
    np.testing.assert_allclose(found["R (2)"].values, [0.4, 0.3])


def test_stacked_tables(write, refused):
    found = by_name(write(STACKED))
    assert list(found) == ["1,4TZ 1", "second"]
    np.testing.assert_allclose(found["second"].values, 10.0 ** -np.array([0.4, 0.3]))
    np.testing.assert_array_equal(found["second"].lines, [10, 9])
    refused(STACKED, "2 spectra", "'second'")


def test_what_cannot_be_read(refused):
    header = "Wavelength (nm),Absorbance\n"
    refused(STACKED.replace(header, header * 2, 1), "line 3 ends the file without any row")
    refused(ONE_SCAN.replace("799,0.5", "799,x"), "line 4", "'Abs'", "'x'")
    refused(ONE_SCAN.partition("0.5")[0], "line 4", "is empty")
    refused(CARY.replace("799,91", "799,x"), "line 4", "'x'", spectrum="film 1")
    refused(CARY.partition("800,50")[0], "without any row")
    refused(ONE_SCAN.replace("(nm)", "(px)"), "unknown unit 'px'")
    refused(ONE_SCAN.replace("Abs", "Irradiance"), "'Irradiance'", "neither a reflectance")
