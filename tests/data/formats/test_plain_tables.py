"""Plain tables as people and spreadsheets write them: read right, or refused with what to do."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum
from tests.data.tables import assert_read

PERCENT = "400{c}10{d}5{n}500{c}20{d}5{n}"


def rows(delimiter, decimal=".", end="\n"):
    return PERCENT.format(c=delimiter, d=decimal, n=end)


@pytest.mark.parametrize(
    ("text", "signal"),
    [
        ("Wellenlänge [nm];Transmission [%]\n" + rows(";", ","), "T"),
        ("Wellenlänge in nm;Reflexion in %\n" + rows(";", ","), "R"),
        ("longueur d'onde (nm);transmission (%)\n" + rows(";", ","), "T"),
        ("Longueur d’onde\tRéflectance\nnm\t%\n" + rows("\t", ","), "R"),
        ("Longitud de onda (nm);Transmitancia (%)\n" + rows(";"), "T"),
        ("Lunghezza d'onda (nm);Riflettanza (%)\n" + rows(";"), "R"),
        ("波長 (nm),反射率 (%)\n" + rows(","), "R"),
        ('"Wavelength (nm)","R (%)"\n"400","10.5"\n"500","20.5"\n', "R"),
        ("wavelength (nm),R (%),\n" + rows(",", end=",\n"), "R"),
        ("Sample 1\nmeasured by me, 2024\n\nwavelength (nm)\tR (%)\n" + rows("\t"), "R"),
        ("Wavelength;Reflectance\n[nm];[%]\n" + rows(";"), "R"),
        ("wavelength (nm),%R\n" + rows(",") + "\nMean,15\n", "R"),
        ("wavelength (nm),%R\n" + rows(",") + "[END]\n", "R"),
        ("wavelength (nm)  R (%)\n" + rows("   "), "R"),
        ("No,Wavelength (nm),R (%)\n1,400,10.5\n2,500,20.5\n", "R"),
        ("Wavelength (nm),Specular Reflectance (%)\n" + rows(","), "R"),
        ("Data Mode:\t%R\nStarting Wavelength:\t800.00 nm\nData Points\nnm\t%R\n" + rows("\t"), "R"),
        ("Nanometers,Percent Transmittance\n" + rows(","), "T"),
        ("Wavelength (nm),Transmittance (%T)\n" + rows(","), "T"),
        ("Energy (eV),nm,R (%)\n3.1,400,10.5\n2.48,500,20.5\n", "R"),
        ("Angstrom;%R\n4000;10.5\n5000;20.5\n", "R"),
        ("Wellenzahl (cm-1);Reflexion (%)\n25000;10,5\n20000;20,5\n", "R"),
    ],
)
def test_read_without_flags(write, text, signal):
    assert_read(read_spectrum(write(text)), signal=signal, wavelength=[400, 500], values=[0.105, 0.205])


@pytest.mark.parametrize(
    "header",
    [
        "Sample Name,film 1,film 2\nWavelength (nm),%R,%R\n",
        "Wavelength (nm),film 1 %R,film 2 %R\n",
        "Wavelength,film 1,film 2\nnm,%,%\n",
        "Wavelength (nm),film 1,film 2\nnm,%,%\n",
        "Wavelength (nm),film 1 (%),film 2 (%)\n",
        "Wavelength (nm);Reflectance (SCI) [%];Reflectance (SCE) [%]\n",
    ],
)
def test_percent_of_several_samples(write, header):
    delimiter = ";" if ";" in header else ","
    text = header + "400,50.5,11.0\n500,60.5,12.0\n".replace(",", delimiter)
    one, other = read_spectra(write(text), signal="R", spectrum="all")
    np.testing.assert_allclose([one.values, other.values], [[0.505, 0.605], [0.11, 0.12]])
    assert one.name != other.name


@pytest.mark.parametrize(
    ("text", "said", "reading"),
    [
        ("wavelength,T\n1,400.5;0.5\n1,500.5;0.6\n", ("thousands separators",), {}),
        ("wavelength;T\n1.400,5;0,5\n1.500,5;0,6\n", ("'1.400,5'", "thousands"), {"signal": "T"}),
        ("wavelength,R\n400,10%\n500,20%\n", ("% signs", "header"), {}),
        ("date,R\n2024-01-02,0.1\n2024-01-03,0.2\n", ("dates, not wavelengths",), {}),
        ("wavelength,R\n400,0.1\n500,0.2\nMean,0.15\n", ("line 4", "'Mean'"), {}),
        ("nm,n,k\n400,0.2,3.1\n500,0.3,4\n", ("optical constants", "`layer`"), {}),
        ("nm,n,k\n400,0.2,3.1\n500,0.3,4\n", ("optical constants", "`layer`"), {"signal": "psi-delta"}),
        ("eV,eps1,eps2\n2,-5,1\n3,-4,2\n", ("optical constants",), {"signal": "R"}),
        ("400,0.2,3.1\n500,0.3,7\n", ("n and k", "psi_deg"), {"signal": "psi-delta"}),
        ("400,0.2,3.1\n500,0.3,4\n", ("third column", "`layer`"), {"signal": "R"}),
        ("X-axis: pixels\n400,0.1\n500,0.2\n", ("unknown unit 'pixels'",), {"signal": "R"}),
        ("X-axis: Raman shift (cm-1)\nwavelength,R\n400,0.1\n", ("'Raman shift",), {}),
        ("Data mode: CD\nnm\tmdeg\n400\t0.1\n500\t0.2\n", ("'mdeg'", "neither a"), {"signal": "T"}),
        ("nm,Kubelka-Munk\n400,0.1\n500,0.2\n", ("'Kubelka-Munk'",), {"signal": "R"}),
        ("nm,Absorption\n400,1\n500,2\n", ("'Absorption' states no quantity",), {}),
    ],
)
def test_refused(refused, text, said, reading):
    refused(text, *said, **reading)


def test_angles_that_look_like_optical_constants_are_read_by_name(write):
    path = write("400,5,3\n500,6,7\n")
    spectrum = read_spectrum(path, signal="psi-delta", columns="wavelength,psi_deg,delta_deg")
    np.testing.assert_array_equal(spectrum.delta, [3, 7])


@pytest.mark.parametrize(
    ("text", "columns", "wavelength", "values"),
    [
        ("Wavenumber (cm-1),spec (%)\n2000,50\n1000,60\n", "wavelength,R", [5000, 10000], [0.5, 0.6]),
        ("Photon Energy (eV);%T\n40;50,5\n30;60,5\n", "wavelength,T", [30.996, 41.328], [0.505, 0.605]),
        ("nm,Abs\n400,0.3\n500,0.5\n", "wavelength,T_fraction", [400, 500], [0.3, 0.5]),
        ("nm,Abs\n400,1\n500,2\n", "wavelength,absorbance", [400, 500], [0.1, 0.01]),
        ("XUNITS=1/CM\n2000,0.5\n1000,0.6\n", "wavelength,R", [5000, 10000], [0.5, 0.6]),
    ],
)
def test_names_of_the_caller_without_a_unit_keep_that_of_the_file(write, text, columns, wavelength, values):
    spectrum = read_spectrum(write(text), columns=columns)
    np.testing.assert_allclose(spectrum.wavelength, wavelength, rtol=1e-4)
    np.testing.assert_allclose(spectrum.values, values)


@pytest.mark.parametrize(
    "text",
    [
        "Wavelength (nm),Abs\n400,0.3\n500,0.5\n",
        "Wellenlänge [nm];Extinktion\n400;0,3\n500;0,5\n",
        "Y-axis mode: Abs\n400 0.3\n500 0.5\n",
    ],
)
def test_an_absorbance_is_not_renamed_in_silence(refused, text):
    refused(text, "an absorbance", "T_fraction", columns="wavelength,T")
    refused(text, "an absorbance", "R_fraction", columns="wavelength,R")


PROCESSED = """\
Model,WP-UV-VIS
Technique,{}
Pixel Count,1024

Pixel,Wavelength,Processed,Raw,Dark,Reference
0,319.03,{},873,827,74
1,319.51,{},867,829,87
"""


def test_a_technique_is_the_quantity_of_the_processed_column(write, refused):
    assert_read(read_spectrum(write(PROCESSED.format("Absorbance", 1, 2))), signal="T", values=[0.1, 0.01])
    percent = read_spectrum(write(PROCESSED.format("Transmission", 60, 70)), signal_unit="percent")
    np.testing.assert_allclose(percent.values, [0.6, 0.7])
    refused(PROCESSED.format("Absorbance", 1, 2), "absorbance", signal="R")
    refused(PROCESSED.format("Scope", 0.6, 0.7), "neither", columns=None)


@pytest.mark.parametrize(
    "text",
    [
        ";;;\n;Wavelength (nm);T (%);\n;400;81,5;\n;500;82,5;\n",
        ",,Wavelength (nm),T (%)\n,,400,81.5\n,,500,82.5\n",
        "sep=;\nWavelength (nm);T (%)\n400;81,5\n500;82,5\n",
        "% Wavelength (nm)  T (%)\n400 81.5\n500 82.5\n",
        '"Sample - RawData"\n"Wavelength nm." "T%"\n400.00 81.5\n500.00 82.5\n',
    ],
)
def test_tables_as_sheets_and_programs_save_them(write, text):
    spectrum = read_spectrum(write(text))
    assert_read(spectrum, wavelength=[400, 500], values=[0.815, 0.825])
    assert ("sample", "sep=") not in spectrum.declared


def test_the_measured_column_is_read_beside_the_calculated_one(write):
    text = "Wavelength(nm),Reflectance (Measured),Reflectance (Calculated)\n400,0.31,0.9\n500,0.32,0.9\n"
    np.testing.assert_allclose(read_spectrum(write(text)).values, [0.31, 0.32])


@pytest.mark.parametrize("header", ["Absorption (%)", "Is,Ic", "Re(rho),Im(rho)", "1-R", "-ln(T)"])
def test_shares_absorbed_and_ratios_of_amplitudes_are_no_reflectance(refused, header):
    row = ",0.5" * len(header.split(","))
    refused(f"nm,{header}\n400{row}\n500{row}\n", "neither", signal="R")


def test_percent_in_the_names_of_samples(write):
    spectra = read_spectra(write("nm,S1 (%),R(%) site 2\n400,50,60\n500,52,62\n"), signal="R", spectrum="all")
    np.testing.assert_allclose(spectra[1].values, [0.6, 0.62])


def test_ellipsometry_that_is_no_table_of_wavelengths(refused):
    wide = "nm,Psi 65,Delta 65,Psi 70,Delta 70\n400,25,120,20,100\n500,26,119,21,99\n"
    refused(wide, "'Psi 65'", "several angles", "angle_deg")
    refused(wide, "several angles", signal="R", signal_unit="percent")
    refused("70 168.2 10.5\n71 167.9 10.1\n", "wavelength_nm", columns="angle,delta,psi")


def test_logarithms_are_absorbances(write):
    assert read_spectrum(write("nm,-log(R)\n400,1\n500,2\n")).signal == "R"
    np.testing.assert_allclose(read_spectrum(write("nm,-log10(T)\n400,1\n500,2\n")).values, [0.1, 0.01])
