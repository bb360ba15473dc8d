"""What a file declares above its rows: axis, quantity and unit, and several spectra beside each other."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.read_spectrum import read_spectra, read_spectrum
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

AXES = ["XUNITS=1/CM", "X-Axis: cm-1", "Wavelength unit; 1/cm", '"x unit","cm^-1"']


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("quantity", ["YUNITS=ABSORBANCE", "Data mode: Abs", "Y-axis mode\tA"])
def test_axis_and_absorbance_of_a_preamble(write, axis, quantity):
    spectrum = read_spectrum(write(f"{axis}\n{quantity}\n25000,1.0\n20000,0.5\n12500,0\n"))
    assert_read(spectrum, signal="T", wavelength=[400, 500, 800], values=[0.1, 10**-0.5, 1])
    assert any("absorbance A, converted to T" in note for note in spectrum.notes)


@pytest.mark.parametrize(
    ("text", "flags", "parts"),
    [
        ("XUNITS=1/CM\nwavelength_nm,R\n400,0.1\n500,0.2\n", {}, ("line 1 declares '1/CM'", "`columns`")),
        ("Mode: x\nData mode: %T\nnm,%R\n400,10\n500,20\n", {}, ("line 2 declares '%T'", "`columns`")),
        ("Y-axis: Irradiance\n400,0.1\n500,0.2\n", {"signal": "T"}, ("'Irradiance'", "`reference`")),
        ("Y-axis: Counts\nnm,R\n400,0.1\n500,0.2\n", {"signal": "T"}, ("'Counts'",)),
    ],
)
def test_a_contradiction(write, refused, text, flags, parts):
    refused(text, *parts, error=DataError, **flags)


def test_log_of_the_inverse_reflectance(write):
    path = write("XUNITS=1/CM\nYUNITS=ABSORBANCE\n25000,1\n20000,0.5\n")
    spectrum = read_spectrum(path, columns="wavelength,log(1/R)", wavelength_unit="cm-1")
    assert_read(spectrum, signal="R", values=[0.1, 10**-0.5])


def test_error_of_an_absorbance(write):
    spectrum = read_spectrum(write("nm,A,sigma\n400,1,0.01\n500,2,0.01\n"))
    step = 1e-6
    slope = (10 ** -(np.array([1, 2]) - step) - 10 ** -(np.array([1, 2]) + step)) / (2 * step)
    np.testing.assert_allclose(spectrum.sigma, 0.01 * slope, rtol=1e-8)


@pytest.mark.parametrize("name", ["T (Abs)", "R (abs.)"])
def test_absolute_or_absorbance(write, refused, name):
    refused(f"nm,{name}\n400,0.1\n500,0.2\n", "unit 'abs", '`signal_unit="absorbance"`', error=DataError)


WIDE = "Wavelength (nm),film a,film b,film c\n400,10,20,30\n500,11,21,31\n"


def test_several_samples_beside_each_other(write, refused):
    path = write(WIDE)
    refused(path, "'film a', 'film b', 'film c'", '`spectrum="film a"`', signal="R", error=UsageError)
    refused(path, "no spectrum 'film d'", "'film a'", signal="R", spectrum="film d", error=UsageError)
    one = read_spectrum(path, signal="R", signal_unit="percent", spectrum="Film B")
    np.testing.assert_allclose(one.values, [0.2, 0.21])
    every = pl.read_spectra(path, signal="R", signal_unit="percent", spectrum="all")
    assert [spectrum.name for spectrum in every] == ["film a", "film b", "film c"]
    np.testing.assert_allclose([spectrum.values[0] for spectrum in every], [0.1, 0.2, 0.3])


def test_ellipsometry_with_reflectances_is_of_one_film(write, refused):
    path = write("nm,psi,delta,Rs,Rp\n400,20,170,0.3,0.1\n500,21,160,0.3,0.1\n")
    refused(path, "psi and delta as well as R", "`signal`", read=read_spectrum, error=UsageError)
    assert [spectrum.signal for spectrum in read_spectra(path)] == ["psi-delta", "R", "R"]
    assert [spectrum.name for spectrum in read_spectra(path)] == ["psi-delta", "Rs", "Rp"]
    assert read_spectrum(path, signal="psi-delta").delta is not None
    assert read_spectrum(path, spectrum="Rp").values[0] == 0.1


def test_facts(write):
    text = "Spectrometer: SD2000\nDate; 2024-03-05 10:00\nSample name: wafer 7\nnm,R\n400,0.1\n500,0.2\n"
    declared = dict(read_spectrum(write(text)).declared)
    assert declared == {"instrument": "SD2000", "date": "2024-03-05 10:00", "sample": "wafer 7"}


@pytest.mark.parametrize(
    ("head", "angle", "polarisation"),
    [
        ("Polarization: s\nAngle of incidence: 45\n", 45, "s"),
        ("Polarisation state;TM\nAOI (deg);8,5°\n", 8.5, "p"),
        ("# Polarizer = P-polarized\n# Einfallswinkel: 60 deg\n", 60, "p"),
        ("Polarizer: none\nIncident angle: 0\n", 0, "unpolarised"),
    ],
)
def test_declared_angle_and_polarisation(write, head, angle, polarisation, refuses):
    path = write(f"{head}nm;R\n400;0,5\n500;0,6\n", "oblique.csv")
    spectrum = read_spectrum(path)
    assert_read(spectrum, polarisation=polarisation, angle=[angle, angle])
    assert any("as the file declares" in note for note in spectrum.notes)
    other = "s" if polarisation == "p" else "p"
    refuses(UsageError, f"declares {polarisation} light", read_spectrum, path, polarisation=other)


@pytest.mark.parametrize("line", ["Angle: front", "Polarizer angle: 45", "Polarization: 30", "AOI: 120-140"])
def test_what_declares_neither_angle_nor_polarisation(write, line):
    path = write(f"{line}\nnm;R\n400;0,5\n500;0,6\n", "plain.csv")
    assert_read(read_spectrum(path), angle=None, polarisation="unpolarised")


def test_columns_of_angles_and_polarisation_hold_against_the_text_above(write):
    path = write("Angle: 10\nPolarization: p\nnm;angle;Rs\n400;45;0,5\n500;45;0,6\n", "columns.csv")
    assert_read(read_spectrum(path), polarisation="s", angle=[45, 45])
