"""What a column's name says."""

import pytest

from pellicle.data.tabular.columns import is_header, recognise


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("wavelength (nm)", "wavelength", "nm"),
        ("Wavelength [um]", "wavelength", "um"),
        ("Wavelength [µm]", "wavelength", "um"),
        ("Wavelength (Å)", "wavelength", "A"),
        ("wavelength_nm", "wavelength", "nm"),
        ("WAVELENGTH", "wavelength", None),
        ("lambda", "wavelength", None),
        ("lambda / nm", "wavelength", "nm"),
        ("λ (nm)", "wavelength", "nm"),
        ("wl", "wavelength", None),
        ("nm", "wavelength", "nm"),
        ("energy", "wavelength", "eV"),
        ("energy (eV)", "wavelength", "eV"),
        ("photon energy (eV)", "wavelength", "eV"),
        ("wavenumber (1/cm)", "wavelength", "cm-1"),
        ("wavenumber_cm-1", "wavelength", "cm-1"),
        ("Wavenumber [cm⁻¹]", "wavelength", "cm-1"),
        ("R", "R", None),
        ("r", "R", None),
        ("R (%)", "R", "percent"),
        ("%R", "R", "percent"),
        ("R%", "R", "percent"),
        ("% Reflectance", "R", "percent"),
        ("R_percent", "R", "percent"),
        ("R_fraction", "R", "fraction"),
        ("Reflectance (%)", "R", "percent"),
        ("Reflectance [-]", "R", "fraction"),
        ("T", "T", None),
        ("%T", "T", "percent"),
        ("Transmittance / %", "T", "percent"),
        ("intensity", "intensity", None),
        ("Intensity (a.u.)", "intensity", None),
        ("sigma", "sigma", None),
        ("sigma (%)", "sigma", "percent"),
        ("angle_deg", "angle", "deg"),
        ("angle", "angle", "deg"),
        ("AOI (°)", "angle", "deg"),
        ("aoi_deg", "angle", "deg"),
        ("psi_deg", "psi", "deg"),
        ("delta", "delta", None),
        ("R_sigma_as_stated", "other", None),
        ("Rubbish", "other", None),
        ("temperature", "other", None),
        ("A", "T", "absorbance"),
        ("Abs", "T", "absorbance"),
        ("Absorbance (AU)", "T", "absorbance"),
        ("T (Abs)", "T", None),
        ("log(1/R)", "R", "absorbance"),
        ("frequency (THz)", "wavelength", "THz"),
        ("", "other", None),
    ],
)
def test_role_and_unit_of_a_name(name, role, unit):
    column = recognise(name)
    assert (column.role, column.unit) == (role, unit)


@pytest.mark.parametrize(
    ("name", "role", "polarisation"),
    [
        ("Rs", "R", "s"),
        ("Rp (%)", "R", "p"),
        ("T_s", "T", "s"),
        ("tp", "T", "p"),
        ("R", "R", None),
        ("Reflectance_s", "R", "s"),
    ],
)
def test_polarisation_of_a_name(name, role, polarisation):
    column = recognise(name)
    assert (column.role, column.polarisation) == (role, polarisation)


def test_a_unit_in_brackets_that_is_not_known_is_kept_for_the_message():
    assert recognise("wavelength (pm)").unknown_unit == "pm"
    assert recognise("R (dB)").unknown_unit == "db"


@pytest.mark.parametrize(
    "names", [["Integration time", "100 ms"], ["wavelength", "range"], ["R", "T"], ["380", "0.4"], []]
)
def test_free_text_is_no_header(names):
    assert not is_header(names)
